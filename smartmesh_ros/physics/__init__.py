"""Colliders, bodies and the world: PyBullet on patches."""
