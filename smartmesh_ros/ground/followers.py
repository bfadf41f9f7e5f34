"""Attached bodies and links. Each has a slot for life, and a patch; its surface may move."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from numbers import Integral
from typing import Any

from smartmesh_ros.core.body_shape import BodyShape
from smartmesh_ros.errors import InputError, as_float, require
from smartmesh_ros.ground.limits import FARTHEST_BODY, FASTEST
from smartmesh_ros.ground.state import Vector
from smartmesh_ros.terrain.motion import next_revision

# Shortest axis [any unit].
LEAST_AXIS = 1e-6


@dataclass(frozen=True)
class Belt:
    """How the surface of a body or link moves: where the ground touches it with a normal n, along n x ``axis`` at a
    ``speed`` [m/s].

    A positive speed drives the body as a wheel that turns about ``axis``, a vector of any length in the frame of the
    centre of mass. Raises `InputError` if the axis is zero or a number is not finite.
    """

    axis: Vector = (0.0, 1.0, 0.0)
    speed: float = 0.0

    def __post_init__(self) -> None:
        axis = tuple(map(as_float, self.axis)) if isinstance(self.axis, Iterable) else ()
        speed = as_float(self.speed)
        length = math.hypot(*axis) if len(axis) == 3 else math.nan
        good = LEAST_AXIS <= length <= FARTHEST_BODY
        require(good, "surface", "the axis of a surface", self.axis, "three numbers, not all zero")
        good = abs(speed) <= FASTEST  # False for NaN
        require(good, "non_finite", "the speed of a surface", self.speed, f"finite, to {FASTEST:g} m/s")
        object.__setattr__(self, "axis", axis)  # to be compared and saved
        object.__setattr__(self, "speed", speed)


@dataclass(eq=False)
class Follower:
    """An attached body or link, with a patch under it.

    ``solid``: collides with the ground; otherwise only the patch is computed. ``own``: may be lifted out of the ground,
    because this world moves it. ``remote``: another node simulates it. ``name``: for outputs; links are ``robot/link``.
    ``slot``: its number among `Followers`. ``collider``: PyBullet body that is its ground, None = none. ``belt``: how
    its surface moves.
    """

    body: int
    link: int
    shape: BodyShape
    solid: bool
    own: bool = False
    remote: bool = False
    name: str = ""
    slot: int = -1
    collider: int | None = None
    belt: Belt = field(default_factory=Belt)

    @property
    def radius(self) -> float:
        """Bounding radius about the centre of mass [m]."""
        return self.shape.radius


class Followers:
    """The attached bodies and links by slot; iteration is over those in use, by slot. ``epoch`` changes when a follower
    is added or removed."""

    def __init__(self) -> None:
        self.epoch = next_revision()
        self._items: list[Follower | None] = []
        self._unused: list[int] = []
        self._slots: dict[int, list[int]] = {}  # by PyBullet body

    def __len__(self) -> int:
        return len(self._items) - len(self._unused)

    def __iter__(self) -> Iterator[Follower]:
        return (follower for follower in self._items if follower is not None)

    def __getitem__(self, slot: int) -> Follower:
        follower = self._items[slot]
        if follower is None:
            raise IndexError(f"slot {slot} is not in use")
        return follower

    @property
    def capacity(self) -> int:
        """Number of slots, in use or not."""
        return len(self._items)

    @property
    def names(self) -> list[str]:
        """Names by slot, empty for unused slots."""
        return ["" if follower is None else follower.name for follower in self._items]

    def require_new(self, body: int, links: list[int]) -> None:
        """Raise `InputError` if one of the links of a PyBullet body has a slot already."""
        for slot in self.of(body):
            if self[slot].link in links:
                raise InputError(
                    "duplicate_id", f"body {body}, link {self[slot].link} is attached already; detach it first"
                )

    def add(self, follower: Follower) -> None:
        """Give a follower a slot; its body and link must have none."""
        slot = self._unused[-1] if self._unused else len(self._items)
        slots, epoch = [*self.of(follower.body), slot], next_revision()
        # A signal is handled after a call, and there is none from here on: an interrupt leaves all or nothing.
        if self._unused:
            del self._unused[-1]
            self._items[slot] = follower
        else:
            self._items += [follower]
        follower.slot, self._slots[follower.body], self.epoch = slot, slots, epoch

    def remove(self, slot: int) -> None:
        """Free a slot."""
        body = self[slot].body
        slots, epoch = [each for each in self.of(body) if each != slot], next_revision()
        # As in `add`.
        if slots:
            self._slots[body] = slots
        else:
            del self._slots[body]
        self._items[slot], self.epoch = None, epoch
        self._unused += [slot]

    def of(self, body: Any) -> list[int]:
        """Slots of a PyBullet body and its links, empty if it is not attached. Raises `InputError` if it is no
        number."""
        found = self._slots.get(body)
        if found is None and not isinstance(body, Integral):
            raise InputError(
                "unknown_body", f"there is no body {body!r}; pass the number that loadURDF or createMultiBody returned"
            )
        return found or []

    def at(self, body: int, link: int) -> Follower | None:
        """Return the follower of a PyBullet body's link, None if it is not attached."""
        return next((self[slot] for slot in self.of(body) if self[slot].link == link), None)
