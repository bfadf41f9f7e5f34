"""Bodies that press the soil, as the soil model needs them: shapes, places and velocities."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple, Protocol

import numpy as np

from smartmesh_ros.errors import InputError
from smartmesh_ros.patches.shapes import BodyShape, ShapeKind, box, cylinder, primitive
from smartmesh_ros.terrain.grid import FloatArray

# Kinds of shape that press the soil.
PRESSING = (ShapeKind.BOX, ShapeKind.BALL, ShapeKind.CYLINDER, ShapeKind.CAPSULE)
# Rotations of a cylinder's axis from z to x, y and z.
_TURNS = ((0.0, 0.5**0.5, 0.0, 0.5**0.5), (-(0.5**0.5), 0.0, 0.0, 0.5**0.5), (0.0, 0.0, 0.0, 1.0))
# Share of a cylinder's radius at which vertices of its mesh count as on its rim; PyBullet gives URDF cylinders 32.
ON_RIM = 0.97
# Smaller changes of friction are not worth a call.
LEAST_CHANGE = 0.01
# Largest bounding radius of a shape [m].
LARGEST = 1e6


def require_pressing(shape: BodyShape) -> None:
    """Raise `InputError` unless a shape can press the soil."""
    if shape.kind not in PRESSING:
        raise InputError(
            "shape", f"a {shape.kind.name.lower()} cannot press the soil; a box, ball, cylinder or capsule can"
        )
    half = shape.record["half"]
    if not (half.min() >= 0.0 and (half + shape.record["rounding"]).min() > 0.0 and shape.radius < LARGEST):
        raise InputError("shape", f"the dimensions of a {shape.kind.name.lower()} must be above zero and finite [m]")


class ManyBodies(NamedTuple):
    """Bodies that press the soil: the ``shapes`` (n,), None = there is no such body; and ``states`` (n, 13), position
    [m] and quaternion of the centre of mass, linear [m/s] and angular velocity [rad/s], all in the terrain's frame,
    zero where there is no body."""

    shapes: list[BodyShape | None]
    states: FloatArray


class PressingBodies(Protocol):
    """Where `Soil` gets bodies from."""

    def read(self, names: list[str]) -> ManyBodies:
        """Return bodies by name."""

    def set_grip(self, name: str, grip: float) -> None:
        """Set the friction coefficient of a body with the soil, if that is possible."""


# A body, None = there is no such body, and its state (13,).
_Body = tuple[BodyShape | None, tuple[float, ...]]
_NOBODY: _Body = None, (0.0,) * 13


def _many(bodies: list[_Body]) -> ManyBodies:
    states = np.array([state for _, state in bodies], np.float64).reshape(-1, 13)
    return ManyBodies([shape for shape, _ in bodies], states)


class BulletBodies:
    """Bodies of a PyBullet world, by the names that contacts use.

    ``client``: the connected `BulletClient`, or the module ``pybullet``. ``world``: a `smartmesh_ros.World`; its bodies
    and robots then are known by themselves. Without one, `add` each body.
    """

    def __init__(self, client: Any, world: Any = None) -> None:
        self._client = client
        self._pose_of, self._velocity_of = client.getBasePositionAndOrientation, client.getBaseVelocity
        self._world = world
        self._known: dict[str, tuple[int, int, BodyShape]] = {}
        self._slots: dict[str, int] = {}  # in the world's tables, as of an epoch of these
        self._epoch = -1
        self._grips: dict[str, float] = {}

    def add(self, name: str, body: int, link: int = -1, shape: BodyShape | None = None) -> None:
        """Add a PyBullet body or link under a name; its shape is read from PyBullet unless it is given.

        PyBullet does not report shapes of bodies in maximal coordinates. Of several shapes of a link the first counts.
        A mesh counts as the cylinder or box around it. Raises `InputError`.
        """
        known = shape or self._shape_of(name, body, link)
        require_pressing(known)
        self._known[name] = body, link, known
        self._slots.pop(name, None)

    def read(self, names: list[str]) -> ManyBodies:
        """Return bodies by name. The world reads its own at once, without a call of PyBullet for each."""
        if self._world is None:
            return _many([self._read(name) for name in names])
        if self._epoch != self._world.followers.epoch:
            self._epoch, self._slots = self._world.followers.epoch, {}
        known = self._slots
        slots = [known[name] if name in known else self._find_slot(name) for name in names]
        states = None if -1 in slots or not slots else self._world.ground.contacts.states_of(np.array(slots))
        if states is None or np.isnan(states).any():
            return _many([self._read(name) for name in names])
        return ManyBodies([self._known[name][2] for name in names], states)

    def _read(self, name: str) -> _Body:
        if name not in self._known and not self._find(name):
            return _NOBODY
        body, link, shape = self._known[name]
        try:
            if link < 0:
                pose, velocity = self._pose_of(body), self._velocity_of(body)
            else:
                found = self._client.getLinkState(body, link, computeLinkVelocity=1)
                pose, velocity = found[:2], found[6:8]
        except Exception:  # noqa: BLE001  # PyBullet's error, whose class this room does not import
            del self._known[name]
            return _NOBODY
        return shape, pose[0] + pose[1] + velocity[0] + velocity[1]

    def _find_slot(self, name: str) -> int:
        """Return the row of a body in the world's tables, -1 if it has none or is a link, and note it."""
        slot = -1
        if name in self._known or self._find(name):
            body, link, _ = self._known[name]
            followers = self._world.followers
            slot = next((each for each in followers.of(body) if followers[each].link == link == -1), -1)
        self._slots[name] = slot
        return slot

    def set_grip(self, name: str, grip: float) -> None:
        """Set the friction of a body; colliders of the ground have friction 1, and PyBullet multiplies the two."""
        if name in self._known and abs(grip - self._grips.get(name, -1.0)) > LEAST_CHANGE:
            self._grips[name] = grip
            body, link, _ = self._known[name]
            self._client.changeDynamics(body, link, lateralFriction=grip)

    def _find(self, name: str) -> bool:
        """Look a body of the world up, and note it."""
        root, _, part = name.partition("/")
        body = None if self._world is None else self._world.bodies.get(root)
        if body is None:
            return False
        if not part:
            self.add(name, body.uid, -1, None if body.shape is None else body.shape.body_shape)
            return True
        for link, called in body.links.items():
            if called == part:
                self.add(name, body.uid, link)
                return True
        return False

    def _shape_of(self, name: str, body: int, link: int) -> BodyShape:
        for _, _, kind, size, _, centre, turn in self._client.getCollisionShapeData(body, link):
            known = primitive(self._client, kind, size, centre, turn)
            if known is None and kind == self._client.GEOM_MESH:
                known = self._shape_of_mesh(body, link)
            if known is not None:
                return known
        raise InputError(
            "shape", f"{name!r} has no box, sphere, cylinder or capsule to press the soil with; give its shape to add()"
        )

    def _shape_of_mesh(self, body: int, link: int) -> BodyShape | None:
        """Return the shape of a mesh: the box or cylinder around it; None if PyBullet does not report its vertices."""
        try:
            vertices = np.array(self._client.getMeshData(body, link)[1], np.float64)
        except Exception:  # noqa: BLE001  # PyBullet's error, whose class this room does not import
            return None
        return _shape_around(vertices) if vertices.ndim == 2 and len(vertices) else None


def _shape_around(vertices: FloatArray) -> BodyShape:
    """Return the cylinder along an axis on whose rim all vertices (n, 3) [m] lie, else the box around them."""
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    centre, half = 0.5 * (low + high), 0.5 * (high - low)
    x, y, z = centre.tolist()
    for axis, turn in enumerate(_TURNS):
        others = [k for k in range(3) if k != axis]
        radius = float(half[others].max())
        rim = np.hypot(*(vertices - centre)[:, others].T)
        if rim.min() > ON_RIM * radius and rim.max() < radius / ON_RIM:
            return cylinder(radius, 2.0 * float(half[axis]), (x, y, z), turn)
    return box(np.maximum(2.0 * half, 1e-6).tolist(), (x, y, z))


class GivenBodies:
    """Bodies whose states are set by hand, such as those of messages and of studies."""

    def __init__(self) -> None:
        self._bodies: dict[str, _Body] = {}
        self.grips: dict[str, float] = {}

    def put(self, name: str, shape: BodyShape, state: Iterable[float]) -> None:
        """Set a body's ``shape``, and its ``state`` (13,): position [m] and quaternion of its centre of mass, linear
        [m/s] and angular velocity [rad/s], all in the terrain's frame. Raises `InputError`."""
        require_pressing(shape)
        numbers = tuple(float(value) for value in state)
        length = float(np.linalg.norm(numbers[3:7]))
        if len(numbers) != 13 or not np.isfinite(numbers).all() or abs(length - 1.0) > 1e-3:
            raise InputError(
                "state", f"the state of {name!r} is {numbers}; it must be 13 finite numbers, unit quaternion"
            )
        self._bodies[name] = shape, numbers

    def keep(self, names: Iterable[str]) -> None:
        """Forget all bodies but ``names``."""
        kept = set(names)
        self._bodies = {name: body for name, body in self._bodies.items() if name in kept}

    def read(self, names: list[str]) -> ManyBodies:
        """Return bodies by name."""
        return _many([self._bodies.get(name, _NOBODY) for name in names])

    def set_grip(self, name: str, grip: float) -> None:
        """Note the friction coefficient of a body."""
        self.grips[name] = grip
