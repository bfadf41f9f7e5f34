"""MuJoCo with one height field of the whole map, whose data are written in place."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, ClassVar

import mujoco
import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.errors import InputError
from smartmesh_ros.ground.shapes import Sphere
from smartmesh_ros.terrain.grid import FloatArray
from studies.engines.engine import Contacts, Engine, EngineBody, GroundSetup, Setup, Simulation

# Bits of bodies and of the ground, so that robots may touch the ground alone.
BODY, GROUND = 1, 2


class MujocoGround(Simulation):
    """MuJoCo stores heights as float32 from 0 to 1 of a fixed range; heights outside the range are refused.

    The ground has no velocity in contacts. MuJoCo's ``surfacevel`` is one velocity field for the whole map (a constant
    and a rotation), of which a contact uses the tangential part: the field drags bodies but cannot lift them, and
    cannot describe waves, whose velocity differs at every sample.
    """

    reach: ClassVar[float] = 20.0  # of heights, up and down [m]

    def __init__(
        self, setup: GroundSetup, memory: int, time_constant: float | None = None, *, surface_velocity: bool = False
    ) -> None:
        """``memory``: for contacts [bytes], of which MuJoCo takes up to 50 between a body and the ground.
        ``time_constant`` [s]: of the contact (MuJoCo's solref, at least two steps), None = two steps, the tuned value;
        MuJoCo's own default is 0.02. ``surface_velocity``: True = sliding ground has MuJoCo's ``surfacevel``; False =
        the ground has no velocity in contacts."""
        rows, columns = setup.heights.shape
        (width, length), (x, y) = setup.size, setup.origin
        self.setup = setup
        # The tightest contact that MuJoCo takes, unless another is asked for.
        self.time_constant = time_constant or 2.0 * setup.dt
        self.spec = spec = mujoco.MjSpec()
        spec.option.timestep = setup.dt
        spec.option.gravity = setup.gravity
        spec.memory = memory
        if setup.plane:
            plane = mujoco.mjtGeom.mjGEOM_PLANE
            spec.worldbody.add_geom(type=plane, size=[0.0, 0.0, 1.0], condim=3, contype=GROUND, conaffinity=BODY)
            return
        spec.add_hfield(
            name="ground", nrow=rows, ncol=columns, userdata=np.zeros(rows * columns, np.float32),
            size=[0.5 * width, 0.5 * length, 2.0 * self.reach, 1.0],
        )  # fmt: skip
        # Ground that slides hangs on a body that is placed anew with every map; other ground needs none.
        holder = spec.worldbody.add_body(mocap=True) if setup.slides else spec.worldbody
        # The model takes it only where it is not zero when compiled; `geom_surfacevel` may change from then on.
        velocity = [*setup.slide, 0.0, 0.0, 0.0, 0.0] if surface_velocity else [0.0] * 6
        holder.add_geom(
            type=mujoco.mjtGeom.mjGEOM_HFIELD, hfieldname="ground", condim=3, contype=GROUND, conaffinity=BODY,
            pos=[x + 0.5 * width, y + 0.5 * length, -self.reach], surfacevel=velocity,
        )  # fmt: skip

    def touch(self, geom: Any, friction: float, damping_ratio: float = 1.0) -> None:
        """Give a body's shape its friction, and its contacts. Priority: these hold, not a mixture with the ground's."""
        geom.priority, geom.condim, geom.friction = 1, 3, [friction, 0.0, 0.0]
        # Stiffness and damping by themselves: with a time constant, less damping would also make the spring stiffer.
        geom.solref = [-(self.time_constant**-2), -2.0 * damping_ratio / self.time_constant]

    def compile(self) -> None:
        """Make the model of all that was added."""
        self.model = self.spec.compile()
        self.data = mujoco.MjData(self.model)
        if not self.setup.plane:
            self._heights = self.model.hfield_data.reshape(self.setup.heights.shape)

    def ready(self, heights: Any) -> NDArray[np.float32]:
        """Return heights (R, C) [m] as MuJoCo stores them: 0 to 1 of the range; raise `InputError` outside the
        range."""
        if not (heights.min() >= -self.reach and heights.max() <= self.reach):
            raise InputError("height", f"heights leave {-self.reach} to {self.reach} m")
        return np.asarray((heights + self.reach) / (2.0 * self.reach), np.float32)

    def set_ground(self, ready: NDArray[np.float32]) -> None:
        self._heights[...] = ready
        if self.setup.slides:
            self.data.mocap_pos[0, :2] = self.setup.offset(self.data.time)

    def contacts_of(self, parts: Mapping[int, int]) -> Contacts:
        """Return the contacts of ``parts``, MuJoCo's bodies by their indices, with the ground, in the last step."""
        model, data = self.model, self.data
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


class MujocoHfield(MujocoGround, Engine):
    """Balls and boxes."""

    def __init__(self, setup: Setup, **options: Any) -> None:
        super().__init__(setup, (16 + len(setup.bodies)) << 20, **options)
        self._bodies = setup.bodies
        for body in setup.bodies:
            self._add(body)
        self.compile()
        for index, body in enumerate(setup.bodies):
            self._place(index, body)
        if not setup.plane:
            self.set_ground(self.ready(setup.heights))

    def step(self) -> None:
        mujoco.mj_step(self.model, self.data)

    def poses(self) -> FloatArray:
        return np.array(self.data.qpos).reshape(-1, 7)[:, [0, 1, 2, 4, 5, 6, 3]]

    def velocities(self) -> FloatArray:
        twists = np.array(self.data.qvel).reshape(-1, 6)
        # MuJoCo's angular velocity is in the body's frame.
        for twist, orientation in zip(twists, self.data.qpos.reshape(-1, 7)[:, 3:], strict=True):
            angular = twist[3:].copy()
            mujoco.mju_rotVecQuat(twist[3:], angular, orientation)
        return twists

    def contacts(self) -> Contacts:
        count = len(self._bodies)
        bodies = range(self.model.nbody - count, self.model.nbody)
        return self.contacts_of(dict(zip(bodies, range(count), strict=True)))

    def _add(self, body: EngineBody) -> None:
        shape = body.shape
        part = self.spec.worldbody.add_body(pos=body.state.position)
        part.add_freejoint()
        if isinstance(shape, Sphere):
            kind, size = mujoco.mjtGeom.mjGEOM_SPHERE, [shape.radius, 0.0, 0.0]
        else:
            kind, size = mujoco.mjtGeom.mjGEOM_BOX, [0.5 * shape.x, 0.5 * shape.y, 0.5 * shape.z]
        geom = part.add_geom(type=kind, size=size, mass=body.mass)
        self.touch(geom, body.friction, _damping_ratio(body.restitution))

    def _place(self, index: int, body: EngineBody) -> None:
        state = body.state
        x, y, z, w = state.orientation
        self.data.qpos[7 * index : 7 * index + 7] = [*state.position, w, x, y, z]
        turned = np.empty(3)
        mujoco.mju_rotVecQuat(turned, np.array(state.angular), np.array([w, -x, -y, -z]))
        self.data.qvel[6 * index : 6 * index + 6] = [*state.linear, *turned]


def _damping_ratio(restitution: float) -> float:
    """Damping ratio of a spring that throws back with that share of the closing speed; critical where with none."""
    if restitution <= 0.0:
        return 1.0
    decay = -math.log(restitution)
    return decay / math.hypot(math.pi, decay)
