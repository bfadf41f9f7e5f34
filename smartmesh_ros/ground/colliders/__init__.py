"""Colliders of PyBullet's own under patches: the contacts with them, and a file for each kind."""
