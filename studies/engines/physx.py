"""PhysX, through SAPIEN, with a triangle mesh of the whole map that is cooked anew for every map: bodies, and robots by
SAPIEN's loader."""

import math
import warnings
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from smartmesh_ros import Sphere
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.terrain.trimesh import grid_triangles
from studies.engines.engine import Contacts, Engine, EngineBody, GroundSetup, Links, Setup, Simulation
from studies.robots.robot import FRICTION, SERVO, RobotEngine, RobotSetup
from studies.robots.urdf import as_file

with warnings.catch_warnings():
    warnings.simplefilter("ignore")  # about pictures, which are not wanted here
    import sapien
    from sapien import physx


Pose = sapien.Pose
# Distance at which contacts begin [m].
CONTACT_OFFSET = 0.01
# Turns PhysX's plane, whose normal is x, so that it is z; (w, x, y, z).
ALONG_Z = (math.sqrt(0.5), 0.0, -math.sqrt(0.5), 0.0)
# Groups of bodies and of the ground: robots touch the ground, and not one another.
BODY, GROUND = 1, 2


def poses_of(parts: Sequence[Any]) -> FloatArray:
    """Return positions and orientations (x, y, z, w) of bodies or links (N, 7)."""
    return np.array([[*part.entity_pose.p, *np.roll(part.entity_pose.q, -1)] for part in parts], np.float64).reshape(
        -1, 7
    )


class PhysxGround(Simulation):
    """The mesh of the ground has one material. Contacts have no velocity of the ground. ``bounce_threshold`` [m/s]:
    slower impacts do not bounce. Bodies below ``sleep_threshold`` fall asleep."""

    bounce_threshold: ClassVar[float] = 2.0

    def __init__(self, setup: GroundSetup, friction: float, restitution: float, sleep_threshold: float = 0.0) -> None:
        self.setup = setup
        self._steps = 0
        # These are global to SAPIEN and read when a scene, a shape or a body is made.
        physx.set_scene_config(gravity=np.array(setup.gravity, np.float32), bounce_threshold=self.bounce_threshold)
        physx.set_shape_config(contact_offset=CONTACT_OFFSET)
        physx.set_body_config(sleep_threshold=sleep_threshold)
        self.scene = sapien.Scene([physx.PhysxCpuSystem()])
        self.scene.set_timestep(setup.dt)
        self._material = physx.PhysxMaterial(friction, friction, restitution)
        self._triangles = grid_triangles(*setup.heights.shape).astype(np.uint32)
        self._vertices = setup.vertices().astype(np.float32)
        self._ground: Any = None
        self._bodies: list[Any] = []  # or robots

    def set_ground(self, ready: FloatArray) -> None:
        if self._ground is not None:
            self.scene.remove_entity(self._ground)
        physx.set_shape_config(contact_offset=CONTACT_OFFSET)
        if self.setup.plane:
            shape = physx.PhysxCollisionShapePlane(self._material)
            shape.local_pose = Pose(q=ALONG_Z)
        else:
            self._vertices[:, 2] = ready.ravel()
            scale = np.ones(3, np.float32)
            shape = physx.PhysxCollisionShapeTriangleMesh(self._vertices, self._triangles, scale, self._material)
        shape.set_collision_groups([GROUND, BODY, 0, 0])
        collider = physx.PhysxRigidStaticComponent()
        collider.attach(shape)
        self._ground = sapien.Entity()
        self._ground.add_component(collider)
        self._ground.pose = Pose((*self.setup.offset(self._steps * self.setup.dt), 0.0))
        self.scene.add_entity(self._ground)

    def step(self) -> None:
        self.scene.step()
        self._steps += 1

    def close(self) -> None:
        self._bodies.clear()
        self._ground = None
        self.scene = None


class PhysxTrimesh(PhysxGround, Engine):
    """PhysX mixes the coefficients of a contact by their mean, and the ground has one material: bodies of different
    friction or restitution get a mixture of theirs and the mean of all. Bodies never sleep."""

    bounce_threshold: ClassVar[float] = 0.2

    def __init__(self, setup: Setup) -> None:
        both = [(body.friction, body.restitution) for body in setup.bodies] or [(0.5, 0.0)]
        super().__init__(setup, *np.mean(both, axis=0).tolist())
        self._bodies = [self._add(body) for body in setup.bodies]
        self.set_ground(self.ready(setup.heights))

    def poses(self) -> FloatArray:
        return poses_of(self._bodies)

    def velocities(self) -> FloatArray:
        twists = [[*body.linear_velocity, *body.angular_velocity] for body in self._bodies]
        return np.array(twists, np.float64).reshape(-1, 6)

    def contacts(self) -> Contacts:
        """Return the contacts of the last step; SAPIEN tells their normal forces only."""
        rows, index = [], {body.entity.per_scene_id: number for number, body in enumerate(self._bodies)}
        for contact in self.scene.get_contacts():
            first, second = (index.get(part.entity.per_scene_id) for part in contact.bodies)
            if first is not None and second is not None:
                continue
            own, sign = (first, 1.0) if first is not None else (second or 0, -1.0)
            body, dt = self._bodies[own], self.setup.dt
            before = body.entity_pose.p - dt * body.linear_velocity
            for point in contact.points:
                velocity = body.linear_velocity + np.cross(body.angular_velocity, point.position - before)
                force, normal = float(point.impulse @ point.normal) / dt, sign * point.normal
                rows.append((own, *point.position, *normal, point.separation, *velocity, force, *[np.nan] * 3))
        return Contacts.of(rows)

    def _add(self, body: EngineBody) -> Any:
        material = physx.PhysxMaterial(body.friction, body.friction, body.restitution)
        if isinstance(body.shape, Sphere):
            shape = physx.PhysxCollisionShapeSphere(body.shape.radius, material)
            volume = 4.0 / 3.0 * np.pi * body.shape.radius**3
        else:
            edges = np.array([body.shape.x, body.shape.y, body.shape.z])
            shape = physx.PhysxCollisionShapeBox((0.5 * edges).astype(np.float32), material)
            volume = edges.prod()
        shape.density = body.mass / volume
        state = body.state
        part = physx.PhysxRigidDynamicComponent()
        part.attach(shape)
        part.linear_damping = part.angular_damping = 0.0
        entity = sapien.Entity()
        entity.add_component(part)
        x, y, z, w = state.orientation
        entity.pose = Pose(state.position, (w, x, y, z))
        self.scene.add_entity(entity)
        part.linear_velocity = np.array(state.linear, np.float32)
        part.angular_velocity = np.array(state.angular, np.float32)
        return part


# Gain [Nm s/rad] of the servos: joints follow as far as the torque allows, as PyBullet's do.
GAIN = 200.0


class PhysxRobots(PhysxGround, RobotEngine):
    """Articulations of the loader. ``sleeps``: robots at rest fall asleep, by SAPIEN's own threshold, and wake when the
    ground's mesh is exchanged."""

    has_prisms: ClassVar[bool] = True

    def __init__(self, setup: RobotSetup, *, sleeps: bool = False) -> None:
        super().__init__(setup, FRICTION, 0.0, 0.005 if sleeps else 0.0)
        self._bodies = [self._add(setup, start, sleeps=sleeps) for start in setup.starts]
        self.names = tuple(link.name for link in self._bodies[0].links if link.collision_shapes)
        self._links = [[robot.find_link_by_name(name) for name in self.names] for robot in self._bodies]
        masses = np.array([link.mass for link in self._bodies[0].links])
        self._shares = masses / masses.sum()
        self.hold(setup.robot.stance)
        self.set_ground(self.ready(setup.heights))

    def _add(self, setup: RobotSetup, start: FloatArray, *, sleeps: bool) -> Any:
        loader = self.scene.create_urdf_loader()
        loader.fix_root_link = False
        loader.set_material(FRICTION, FRICTION, 0.0)
        with as_file(setup.text) as path, warnings.catch_warnings():
            warnings.simplefilter("ignore")
            robot = loader.load(path)
        if not sleeps:
            robot.sleep_threshold = 0.0
        for link in robot.links:
            link.linear_damping = link.angular_damping = 0.0
            for shape in link.collision_shapes:
                shape.set_collision_groups([BODY, GROUND, 0, 0])
        stance, torque = setup.robot.stance, setup.robot.torque
        positions = robot.qpos
        for index, joint in enumerate(robot.active_joints):
            name = joint.name
            joint.friction = 0.0
            if name in stance:
                positions[index] = stance[name]
                joint.set_drive_properties(GAIN / SERVO, GAIN, torque, "force")
            elif name in setup.robot.wheels:
                joint.set_drive_properties(0.0, GAIN, torque, "force")
                joint.set_drive_velocity_target(setup.speed)
            else:
                joint.set_drive_properties(0.0, 0.0, 0.0, "force")
        robot.set_qpos(positions)
        robot.set_root_pose(Pose(start.astype(np.float32)))
        return robot

    def hold(self, positions: Mapping[str, float]) -> None:
        for robot in self._bodies:
            for joint in robot.active_joints:
                if joint.name in positions:
                    joint.set_drive_target(positions[joint.name])

    def links(self) -> Links:
        frames = np.array([poses_of(links) for links in self._links])
        return Links(frames[..., :3], frames[..., 3:])

    def velocities(self) -> FloatArray:
        linear = np.array([[link.linear_velocity for link in robot.links] for robot in self._bodies], np.float64)
        return np.asarray(np.einsum("l,nlk->nk", self._shares, linear))
