"""A world's bodies as data: to save, restore and compare.

PyBullet caches contacts from step to step, and this cache cannot be read or set. A world built from the positions and
velocities of another therefore evolves slightly differently. `World.save` rebuilds the running world from the snapshot
it returns, and `World.restore` builds another in the same way. Given the same maps at the same steps, the two worlds
stay equal to the last bit.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass, field
from typing import Any

from smartmesh_ros.errors import InputError
from smartmesh_ros.ground.followers import Belt
from smartmesh_ros.ground.shapes import SHAPES, Hull, Solid
from smartmesh_ros.ground.state import BodyState
from smartmesh_ros.world.bodies import Body
from smartmesh_ros.world.joints import JointCommand

_SHAPES: dict[str, type[Solid]] = {made.__name__: made for made in (*SHAPES.values(), Hull)}


@dataclass(frozen=True, kw_only=True)
class BodySnapshot:
    """One body, simulated or ``tracked``. ``shape``: of a body that is no robot; ``radius`` [m]: bounding radius;
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


def body_snapshot(
    client: Any, body: Body, state: BodyState, belts: dict[str, Belt], ends: dict[str, float]
) -> BodySnapshot:
    """Return a body in a ``state``, with its moving surfaces and the ends of its velocities [s], as data."""
    joints = {name: client.getJointState(body.uid, index)[:2] for name, index in body.joints.items()}
    return BodySnapshot(
        name=body.name, state=state, initial=body.initial, radius=body.radius, mass=body.mass, shape=body.shape,
        tracked=body.tracked,
        urdf=body.urdf, friction=body.friction, restitution=body.restitution, joints=joints,
        commands=dict(body.commands), belts=belts, ends=ends,
    )  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Snapshot:
    """All bodies of a world, in the order they were added, and its ``time`` [s]. The terrain is not part of it."""

    time: float
    bodies: tuple[BodySnapshot, ...]

    @property
    def hash(self) -> str:
        """Digest of all numbers: equal if and only if two worlds are in the same state."""
        return hashlib.sha256(self.to_json().encode()).hexdigest()

    def to_json(self) -> str:
        """Return the snapshot as text, without loss of precision."""
        bodies = []
        for body in self.bodies:
            fields = asdict(body)
            fields["shape"] = None if body.shape is None else [type(body.shape).__name__, asdict(body.shape)]
            bodies.append(fields)
        return json.dumps({"time": self.time, "bodies": bodies})

    @classmethod
    def from_json(cls, text: str) -> Snapshot:
        """Parse the text of `to_json`; raises `InputError` if the text is no snapshot."""
        try:
            data = json.loads(text)
            return cls(time=float(data["time"]), bodies=tuple(_body(fields) for fields in data["bodies"]))
        except (ValueError, KeyError, TypeError) as error:
            if isinstance(error, InputError):
                raise
            raise InputError("snapshot", f"this is no saved world ({error}); save one with World.save()") from None


def _body(fields: dict[str, Any]) -> BodySnapshot:
    shape = fields["shape"] and _SHAPES[fields["shape"][0]](**fields["shape"][1])
    states = {key: BodyState(**{k: tuple(v) for k, v in fields[key].items()}) for key in ("state", "initial")}
    joints = {name: tuple(pair) for name, pair in fields["joints"].items()}
    commands = {name: JointCommand(**command) for name, command in fields["commands"].items()}
    belts = {link: Belt(tuple(belt["axis"]), belt["speed"]) for link, belt in fields.get("belts", {}).items()}
    made = {"shape": shape, "joints": joints, "commands": commands, "belts": belts}
    return BodySnapshot(**{**fields, **states, **made})
