"""Colliders of patches: one pool, one driver, a file for each kind."""
