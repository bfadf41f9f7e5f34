"""MuJoCo with one height field of the whole map, whose data are written in place."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import mujoco
import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.errors import InputError
from smartmesh_ros.ground.shapes import Sphere
from smartmesh_ros.terrain.grid import FloatArray
from studies.engines.engine import Contacts, Engine, EngineBody, Setup

# Memory for the contacts of one body [bytes]: MuJoCo takes up to 50 between it and the ground.
_ARENA = 1 << 20


@dataclass(frozen=True, kw_only=True)
class MujocoOptions:
    """``time_constant`` [s]: of the contact (MuJoCo's solref, at least two steps), None = two steps, the tuned value;
    MuJoCo's own default is 0.02. ``substeps``: MuJoCo's steps in one ``dt``. ``lowest``, ``highest`` [m]: range of the
    ground, which is fixed when the model is built. ``surface_velocity``: True = sliding ground has MuJoCo's
    ``surfacevel``; False = the ground has no velocity in contacts."""

    time_constant: float | None = None
    substeps: int = 1
    surface_velocity: bool = False
    lowest: float = -20.0
    highest: float = 20.0


class MujocoHfield(Engine):
    """MuJoCo stores heights as float32 from 0 to 1 of a fixed range; heights outside the range are refused.

    The ground has no velocity in contacts. MuJoCo's ``surfacevel`` is one velocity field for the whole map (a constant
    and a rotation), of which a contact uses the tangential part: the field drags bodies but cannot lift them, and
    cannot describe waves, whose velocity differs at every sample.
    """

    name: ClassVar[str] = "mujoco"

    def __init__(self, setup: Setup, options: MujocoOptions | None = None) -> None:
        self._options = chosen = options or MujocoOptions()
        rows, columns = setup.heights.shape
        width, length = setup.size
        spec = mujoco.MjSpec()
        spec.option.timestep = setup.dt / chosen.substeps
        spec.option.gravity = setup.gravity
        spec.memory = _ARENA * (16 + len(setup.bodies))
        spec.add_hfield(
            name="ground",
            nrow=rows,
            ncol=columns,
            size=[0.5 * width, 0.5 * length, chosen.highest - chosen.lowest, 1.0],
            userdata=np.zeros(rows * columns, np.float32),
        )
        self._setup = setup
        # Ground that slides hangs on a body that is placed anew with every map; other ground needs none.
        holder = spec.worldbody.add_body(mocap=True) if setup.slides else spec.worldbody
        # The model takes it only where it is not zero when compiled; `geom_surfacevel` may change from then on.
        velocity = [*setup.slide, 0.0, 0.0, 0.0, 0.0] if chosen.surface_velocity else [0.0] * 6
        holder.add_geom(
            type=mujoco.mjtGeom.mjGEOM_HFIELD,
            hfieldname="ground",
            pos=[0.5 * width, 0.5 * length, chosen.lowest],
            condim=3,
            surfacevel=velocity,
        )
        for body in setup.bodies:
            self._add(spec, body)
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        self._heights = self.model.hfield_data.reshape(rows, columns)
        for index, body in enumerate(setup.bodies):
            self._place(index, body)
        self.set_ground(setup.heights)

    def set_ground(self, heights: FloatArray, velocities: FloatArray | None = None) -> None:
        self.write(self.normalised(heights))

    def normalised(self, heights: FloatArray) -> NDArray[np.float32]:
        """Return heights (R, C) [m] as MuJoCo stores them: 0 to 1 of the range; raise `InputError` outside the
        range."""
        low, high = self._options.lowest, self._options.highest
        if not (heights.min() >= low and heights.max() <= high):
            raise InputError("height", f"heights leave {low} to {high} m; build the engine with a wider range")
        return np.asarray((heights - low) / (high - low), np.float32)

    def write(self, data: NDArray[np.float32]) -> None:
        """Write heights that are `normalised` already: the cheapest possible update of MuJoCo."""
        self._heights[...] = data
        if self._setup.slides:
            self.data.mocap_pos[0, :2] = self._setup.offset(self.data.time)

    def step(self) -> None:
        mujoco.mj_step(self.model, self.data, self._options.substeps)

    def positions(self) -> FloatArray:
        return np.array(self.data.qpos).reshape(-1, 7)[:, :3]

    def orientations(self) -> FloatArray:
        return np.array(self.data.qpos).reshape(-1, 7)[:, [4, 5, 6, 3]]

    def velocities(self) -> FloatArray:
        twists = np.array(self.data.qvel).reshape(-1, 6)
        # MuJoCo's angular velocity is in the body's frame.
        for twist, orientation in zip(twists, self.data.qpos.reshape(-1, 7)[:, 3:], strict=True):
            angular = twist[3:].copy()
            mujoco.mju_rotVecQuat(twist[3:], angular, orientation)
        return twists

    def contacts(self) -> Contacts:
        count = len(self._setup.bodies)
        bodies = range(self.model.nbody - count, self.model.nbody)
        return mujoco_contacts(self.model, self.data, dict(zip(bodies, range(count), strict=True)))

    def close(self) -> None:
        """Nothing is left open."""

    def _add(self, spec: mujoco.MjSpec, body: EngineBody) -> None:
        ball = isinstance(body.shape, Sphere)
        size = [body.shape.radius, 0.0, 0.0] if isinstance(body.shape, Sphere) else _half(body)
        # The tightest contact that MuJoCo takes, unless another is asked for.
        step = spec.option.timestep
        time_constant = self._options.time_constant or 2.0 * step
        # Priority: the body's friction and contact hold, not a mixture with the ground's.
        part = spec.worldbody.add_body(pos=body.state.position)
        part.add_freejoint()
        part.add_geom(
            type=mujoco.mjtGeom.mjGEOM_SPHERE if ball else mujoco.mjtGeom.mjGEOM_BOX,
            size=size,
            mass=body.mass,
            friction=[body.friction, 0.0, 0.0],
            condim=3,
            priority=1,
            solref=[time_constant, _damping_ratio(body.restitution)],
        )

    def _place(self, index: int, body: EngineBody) -> None:
        state = body.state
        x, y, z, w = state.orientation
        self.data.qpos[7 * index : 7 * index + 7] = [*state.position, w, x, y, z]
        turned = np.empty(3)
        mujoco.mju_rotVecQuat(turned, np.array(state.angular), np.array([w, -x, -y, -z]))
        self.data.qvel[6 * index : 6 * index + 6] = [*state.linear, *turned]


def mujoco_contacts(model: mujoco.MjModel, data: mujoco.MjData, parts: Mapping[int, int]) -> Contacts:
    """Return the contacts of ``parts``, MuJoCo's bodies by their indices, with a height field, in the last step."""
    rows, force, jacobian = [], np.zeros(6), np.zeros((3, model.nv))
    for index, contact in enumerate(data.contact):
        ground, body = model.geom_bodyid[contact.geom]  # sorted by kind: a height field comes first
        if ground in parts:
            continue
        mujoco.mj_contactForce(model, data, index, force)
        normal, tangents = contact.frame[:3], contact.frame[3:].reshape(2, 3)
        point = contact.pos + 0.5 * contact.dist * normal
        mujoco.mj_jac(model, data, jacobian, None, point, body)  # of the poses before the step
        velocity, friction = jacobian @ data.qvel, force[1:3] @ tangents
        rows.append((parts[body], *point, *normal, contact.dist, *velocity, force[0], *friction))
    return Contacts.of(rows)


def _half(body: EngineBody) -> list[float]:
    assert not isinstance(body.shape, Sphere)
    return [0.5 * body.shape.x, 0.5 * body.shape.y, 0.5 * body.shape.z]


def _damping_ratio(restitution: float) -> float:
    """Damping ratio of a spring that throws back with that share of the closing speed; critical where with none."""
    if restitution <= 0.0:
        return 1.0
    decay = -math.log(restitution)
    return decay / math.hypot(math.pi, decay)
