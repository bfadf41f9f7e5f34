"""What a patch is put under."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(eq=False)
class Follower:
    """A body or link with a patch under it.

    ``solid``: it gets a collider; otherwise only the patch is computed. ``ball``: it is a sphere. ``collider``:
    PyBullet's body of the collider it has now, if any.
    """

    body: int
    link: int
    radius: float
    solid: bool
    ball: bool = False
    collider: int | None = None
