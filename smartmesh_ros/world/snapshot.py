"""A world's bodies as data, to compare; and its whole state, to save and restore.

PyBullet caches contacts from step to step, and gives this cache to nobody. A world that is built from the positions and
velocities of another therefore evolves slightly differently. `World.save` rebuilds the running world from the state
that it returns, and `World.restore` builds another in the same way: the two worlds stay equal to the last bit.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field, replace
from typing import Any

from smartmesh_ros.errors import require
from smartmesh_ros.ground.config import PhysicsConfig, SleepConfig
from smartmesh_ros.ground.followers import Belt
from smartmesh_ros.ground.quaternions import rounded
from smartmesh_ros.ground.shapes import SHAPES, Hull, Solid
from smartmesh_ros.ground.state import BodyState
from smartmesh_ros.terrain import state_file
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.terrain.terrain import STATE_TYPES, Terrain
from smartmesh_ros.world.driving import Carrier
from smartmesh_ros.world.joints import JointCommand
from smartmesh_ros.world.settings import FallConfig, GuestConfig, WorldConfig


@dataclass(frozen=True, kw_only=True)
class BodySnapshot:
    """One body, simulated or ``tracked``. ``state`` and ``initial`` are turned as PyBullet turns bodies, along their
    principal axes of inertia. ``shape``: of a body that is no robot; ``radius`` [m]: bounding radius;
    ``urdf``: file or text of a robot. ``joints``: position and velocity by name [rad, rad/s or m, m/s]; ``commands``:
    current commands of the joints; ``belts``: moving surfaces by link, "" = of a body that is no robot; ``ends``: times
    at which the velocities of joints and surfaces end [s]."""

    name: str
    state: BodyState
    initial: BodyState
    radius: float
    mass: float = 0.0
    shape: Solid | None = None
    tracked: bool = False
    urdf: str | None = None
    friction: float = 0.0
    restitution: float = 0.0
    joints: dict[str, tuple[float, float]]
    commands: dict[str, JointCommand]
    belts: dict[str, Belt] = field(default_factory=dict)
    ends: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class Snapshot:
    """All bodies of a world, in the order they were added, and its ``time`` [s]. The terrain is not part of it."""

    time: float
    bodies: tuple[BodySnapshot, ...]

    def rounded(self) -> Snapshot:
        """Return the snapshot with rounded orientations, as a world that is restored from it gives them back."""
        bodies = []
        for body in self.bodies:
            state = replace(body.state, orientation=rounded(body.state.orientation))
            bodies.append(replace(body, state=state))
        return replace(self, bodies=tuple(bodies))

    @property
    def hash(self) -> str:
        """Digest of all numbers: equal if and only if two worlds are in the same state."""
        return hashlib.sha256(state_file.to_bytes("Snapshot", self)).hexdigest()


@dataclass(frozen=True, kw_only=True)
class WorldState:
    """The whole state of a world, to be restored once, because the world takes its objects.

    ``snapshot``: the bodies. ``soil``: state of the soil, None = there is none; ``tile``: the tile that gives way.
    ``carried``: carriers of decks, by deck. ``first``: terrain at the start of episodes. ``memory``: past of the bodies
    that the ground knows. ``falls`` [s]: time of the last check for falling bodies. ``extra``: what the caller of
    `World.save` added."""

    snapshot: Snapshot
    terrain: Terrain
    soil: dict[str, Any] | None
    tile: str
    carried: dict[str, Carrier]
    config: WorldConfig
    seed: int
    first: Terrain | None
    memory: tuple[FloatArray, list[FloatArray]]
    falls: float
    extra: dict[str, Any]

    @staticmethod
    def from_bytes(data: bytes) -> WorldState:
        """Return the state of a file; raises `InputError` if it is none, was damaged, or is of another version."""
        state: WorldState = state_file.from_bytes(data, KIND, _TYPES)
        return state


KIND = "World"
_MADE: tuple[type, ...] = (
    *(Belt, BodySnapshot, BodyState, Carrier, FallConfig, GuestConfig, JointCommand, PhysicsConfig),
    *(SleepConfig, Snapshot, WorldConfig, WorldState, Hull, *SHAPES.values()),
)
_TYPES = {**STATE_TYPES, **{made.__name__: made for made in _MADE}}


def checked_extra(extra: Any) -> dict[str, Any]:
    """Return what the caller of `World.save` adds to a state, nothing for None. Raises `InputError` unless it is a dict
    that a state gives back."""
    found = {} if extra is None else extra
    good = isinstance(found, dict)
    try:
        state_file.from_bytes(state_file.to_bytes(KIND, found), KIND, _TYPES)
    except (TypeError, ValueError):
        good = False
    wanted = "a dict, or None; a state holds numbers, texts, arrays, lists, tuples and dicts"
    require(good, "state", "the extra state", extra, wanted)
    return found
