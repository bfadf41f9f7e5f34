"""The kinds of colliders that PyBullet moves with the ground. A new kind is a file, a row here, and a branch of `plan`
in ``driver.py``."""

from __future__ import annotations

from collections.abc import Callable
from enum import IntEnum
from typing import Any, NamedTuple, Protocol

from smartmesh_ros.physics.colliders.field import describe_field, field_key, make_field
from smartmesh_ros.physics.colliders.plane import describe_box, make_box, plane_key

Key = tuple[Any, ...]


class Kind(IntEnum):
    """Index of a kind in `KINDS`."""

    PLANE = 0
    FIELD = 1


class KeyOf(Protocol):
    """Returns the sizes of the collider that a support needs for a body with a bounding ``radius`` [m]. Colliders of
    equal key are interchangeable."""

    def __call__(self, support: Any, radius: float, resolution: float, *, round_: bool) -> Key: ...


class KindFunctions(NamedTuple):
    """Functions of a kind. ``key_of``: see `KeyOf`. ``make``: creates PyBullet's shape of a key. ``describe``: writes
    the constants of a key to a record of ``COLLIDER``. ``shared``: all colliders of a key can use one shape, because
    the shape never changes."""

    key_of: KeyOf
    make: Callable[[Any, Key], int]
    describe: Callable[[Any, Key], None]
    shared: bool


KINDS = (
    KindFunctions(plane_key, make_box, describe_box, shared=True),
    KindFunctions(field_key, make_field, describe_field, shared=False),
)
