"""MuJoCo with one height field of the whole map, whose data are written in place: bodies, and robots by its loader."""

import math
from collections.abc import Mapping
from typing import Any, ClassVar

import mujoco
import numpy as np
from numpy.typing import NDArray

from smartmesh_ros import InputError, Sphere
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.world.robots.description import read_description
from studies.engines.engine import Contacts, Engine, EngineBody, GroundSetup, Links, Setup, Simulation
from studies.robots.robot import FRICTION, SERVO, RobotEngine, RobotSetup

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
        for body, place, twist in zip(setup.bodies, *self._states(), strict=True):
            x, y, z, w = body.state.orientation
            place[:] = *body.state.position, w, x, y, z
            twist[:3] = body.state.linear
            mujoco.mju_rotVecQuat(twist[3:], np.array(body.state.angular), np.array([w, -x, -y, -z]))
        if not setup.plane:
            self.set_ground(self.ready(setup.heights))

    def step(self) -> None:
        mujoco.mj_step(self.model, self.data)

    def _states(self) -> tuple[FloatArray, FloatArray]:
        """Return views of poses (N, 7), scalars of orientations first, and twists (N, 6), angular ones in the bodies'
        frames."""
        return self.data.qpos.reshape(-1, 7), self.data.qvel.reshape(-1, 6)

    def poses(self) -> FloatArray:
        return self._states()[0][:, [0, 1, 2, 4, 5, 6, 3]]

    def velocities(self) -> FloatArray:
        poses, twists = self._states()
        found = twists.copy()
        for pose, twist, turned in zip(poses, twists, found, strict=True):
            mujoco.mju_rotVecQuat(turned[3:], twist[3:], pose[3:])
        return found

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
        # A spring that throws back with that share of the closing speed; critically damped where with none.
        decay = -math.log(body.restitution) if body.restitution > 0.0 else math.inf
        self.touch(geom, body.friction, decay / math.hypot(math.pi, decay) if math.isfinite(decay) else 1.0)


class MujocoRobots(MujocoGround, RobotEngine):
    """Speculative contacts are off: they do nothing on height fields.

    Servos are constraints, as PyBullet's are, but have no limit of torque; driven wheels follow the angle of their
    speed.
    """

    reach: ClassVar[float] = 2.0

    def __init__(self, setup: RobotSetup, **options: Any) -> None:
        super().__init__(setup, (1 + len(setup.starts)) << 23, **options)
        robot, spec = setup.robot, self.spec
        self._prefixes = [f"r{index}/" for index in range(len(setup.starts))]
        self._root = read_description(setup.text).root
        for prefix in self._prefixes:
            spec.attach(self._loaded(setup), prefix=prefix, frame=spec.worldbody.add_frame())
            # Constraints hold joints at a position. Actuators as stiff would make robots tremble: MuJoCo solves
            # contacts without the damping that its integrator adds for actuators.
            for joint in (f"{prefix}{name}" for name in (*robot.stance, *robot.wheels)):
                constraint = spec.add_equality(name=joint, type=mujoco.mjtEq.mjEQ_JOINT, name1=joint)
                constraint.objtype = mujoco.mjtObj.mjOBJ_JOINT
                constraint.data = np.zeros((len(constraint.data), 1))
                # Overdamped: two time constants, which together are that of a servo. A tighter one would tremble
                # against contacts.
                constraint.solref = [0.25 * SERVO, math.sqrt(2.0)]
        self.compile()
        model, first = self.model, self._prefixes[0]
        with_shapes = [model.body(body).name for body in sorted(set(model.geom_bodyid.tolist()) - {0})]
        self.names = tuple(name.removeprefix(first) for name in with_shapes if name.startswith(first))
        self._bodies = np.array([[model.body(f"{one}{name}").id for name in self.names] for one in self._prefixes])
        self._roots = [model.body(f"{prefix}{self._root}").id for prefix in self._prefixes]
        for prefix, start in zip(self._prefixes, setup.starts, strict=True):
            floating = model.joint(f"{prefix}floating").qposadr[0]
            self.data.qpos[floating : floating + 7] = [*start, 1.0, 0.0, 0.0, 0.0]
            for joint, position in robot.stance.items():
                self.data.qpos[model.joint(f"{prefix}{joint}").qposadr[0]] = position
        self.hold(robot.stance)
        self._wheels = [self.model.equality(f"{one}{wheel}").id for one in self._prefixes for wheel in robot.wheels]
        self._speed = setup.speed
        self.set_ground(self.ready(setup.heights))
        mujoco.mj_forward(self.model, self.data)

    def _loaded(self, setup: RobotSetup) -> mujoco.MjSpec:
        """Return one robot as MuJoCo's loader reads it, on a floating joint."""
        floating = (
            '<mujoco><compiler fusestatic="false" strippath="false"/></mujoco><link name="world"/>'
            f'<joint name="floating" type="floating"><parent link="world"/><child link="{self._root}"/></joint>'
        )
        spec = mujoco.MjSpec.from_string(setup.text.replace("<link ", f"{floating}<link ", 1))
        for geom in spec.geoms:
            self.touch(geom, FRICTION)
            geom.contype, geom.conaffinity = BODY, GROUND  # robots do not touch one another
        return spec

    def hold(self, positions: Mapping[str, float]) -> None:
        for prefix in self._prefixes:
            for joint, position in positions.items():
                self.model.eq_data[self.model.equality(f"{prefix}{joint}").id, 0] = position

    def step(self) -> None:
        if self._speed:
            self.model.eq_data[self._wheels, 0] = self._speed * self.data.time
        mujoco.mj_step(self.model, self.data)

    def links(self) -> Links:
        mujoco.mj_kinematics(self.model, self.data)
        return Links(self.data.xpos[self._bodies].copy(), np.roll(self.data.xquat[self._bodies], -1, axis=-1))

    def velocities(self) -> FloatArray:
        mujoco.mj_comPos(self.model, self.data)
        mujoco.mj_comVel(self.model, self.data)
        mujoco.mj_subtreeVel(self.model, self.data)
        return np.asarray(self.data.subtree_linvel[self._roots]).copy()

    def contacts(self) -> Contacts:
        return self.contacts_of({body: robot for robot, bodies in enumerate(self._bodies.tolist()) for body in bodies})
