"""Bodies and robots of the simulated world."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple
from xml.etree import ElementTree

import pybullet as pb

from smartmesh_ros.core.body_shape import BodyShape
from smartmesh_ros.errors import InputError
from smartmesh_ros.ground.body_shapes import link_name, read_shapes
from smartmesh_ros.ground.bullet import is_fixed, undone
from smartmesh_ros.ground.config import PhysicsConfig
from smartmesh_ros.ground.limits import FASTEST_SPIN, MASSES, require_between
from smartmesh_ros.ground.shapes import Box, Cylinder, Hull, Shape, Solid, Sphere, box_around
from smartmesh_ros.ground.state import BodyState
from smartmesh_ros.ground.transform import IDENTITY, Transform, fixed_to
from smartmesh_ros.world.joints import JointCommand, command_joint
from smartmesh_ros.world.link_frames import LinkFrames
from smartmesh_ros.world.robots.loading import (
    PYBULLETS_FASTEST,
    couple_joints,
    damp_joints,
    load_robot,
    set_masses,
)
from smartmesh_ros.world.robots.meaning import SurfaceDrive
from smartmesh_ros.world.robots.prepared import PreparedRobot
from smartmesh_ros.world.standing import Underside

# Collision margin of boxes and cylinders [m]. PyBullet rounds their edges by it; at its default of 1 mm a box standing
# on an edge would be 0.4 mm deep in the ground.
ROUNDED = 1e-4


# Use the URDF's inertias, which PyBullet otherwise computes from the collision shapes, and cylinders as they are, which
# PyBullet otherwise replaces by hulls of 64 vertices. A cylinder rolls as truly on a field, at half the cost.
URDF_FLAGS = pb.URDF_USE_INERTIA_FROM_FILE | pb.URDF_USE_IMPLICIT_CYLINDER | pb.URDF_IGNORE_VISUAL_SHAPES

# Share of a joint's damping below which the user is told, and below which a robot's damping follows its posture.
TOLD_SHARE, STIFF_SHARE = 0.5, 0.8


class BodyMaterial(NamedTuple):
    """Friction and restitution of a body."""

    friction: float
    restitution: float


@dataclass(eq=False)
class Body:
    """A body of the world: simulated (moves by physics), tracked (its pose is dictated), or remote (another node, its
    ``owner``, simulates it)."""

    name: str
    uid: int
    radius: float
    tracked: bool
    initial: BodyState
    links: dict[int, str]  # that touch the ground, by PyBullet's index; of a body that is no robot "" alone
    joints: dict[str, int]
    mass: float = 0.0
    shape: Solid | None = None  # of a body that is no robot
    urdf: str | None = None  # file or text of a robot
    friction: float = 0.0
    restitution: float = 0.0
    commands: dict[str, JointCommand] = field(default_factory=dict)  # by joint
    inertial: Transform = IDENTITY  # pose of the centre of mass in the frame of the base link
    owner: str = ""
    notes: tuple[str, ...] = ()  # what its description was taken as, for the user
    warnings: tuple[str, ...] = ()  # what its author likely did not mean
    fixed: bool = False  # a robot whose base has no mass, so that physics does not move it
    box: Box | None = None  # of a robot: the box around its links where joints start, in the frame of its `state`
    shapes: dict[int, BodyShape] = field(default_factory=dict)  # of a robot's links
    frames: LinkFrames | None = None  # of a robot's links
    surfaces: Mapping[str, SurfaceDrive] = field(default_factory=dict)  # of a robot, that are driven
    starts: Mapping[str, float] = field(default_factory=dict)  # positions of joints that do not start at zero [rad, m]
    damping: dict[int, float] = field(default_factory=dict)  # of the URDF, by PyBullet's joint [Nms/rad, Ns/m]
    stiff: bool = False  # whether its damping depends on the posture

    @property
    def simulated(self) -> bool:
        """True if this world simulates the body."""
        return not self.tracked and not self.owner

    @property
    def outline(self) -> Shape:
        """Shape that other nodes use for the body; of a robot its box."""
        return self.shape.bounds if isinstance(self.shape, Hull) else self.shape or self.box or Sphere(self.radius)

    @property
    def is_robot(self) -> bool:
        """True if the body is a URDF robot."""
        return self.urdf is not None

    @property
    def centre(self) -> Transform:
        """The centre of mass in the frame of the base link, with the axes of this frame."""
        return Transform(self.inertial.translation)

    @property
    def axes(self) -> Transform:
        """The principal axes of inertia, along which PyBullet turns a body, in the axes of the base link's frame."""
        return Transform(rotation=self.inertial.rotation)

    def joint(self, name: str) -> int:
        """Return PyBullet's index of a joint; raises `InputError` if there is none."""
        if not isinstance(name, str) or name not in self.joints:
            there = ", ".join((*self.joints, *self.surfaces)) or "none"
            raise InputError("unknown_joint", f"{self.name!r} has no joint {name!r}; it has {there}")
        return self.joints[name]

    def link(self, name: str) -> int:
        """Return PyBullet's index of a link that touches the ground; raises `InputError` if there is none."""
        for index, found in self.links.items():
            if found == name:
                return index
        there = ", ".join(map(repr, self.links.values()))
        raise InputError("unknown_body", f"{self.name!r} has no link {name!r} with a collision shape; it has {there}")


class BodyFactory:
    """Creates bodies in one PyBullet world. Shapes of equal size are created once, because PyBullet leaks removed
    shapes."""

    def __init__(self, client: Any, config: PhysicsConfig) -> None:
        self._client = client
        self.config = config
        self._shapes: dict[Solid, int] = {}

    def simulated(
        self, name: str, shape: Shape, mass: float, state: BodyState, material: BodyMaterial | None = None
    ) -> Body:
        """Create a body that moves by physics, with the configured friction and restitution or the given ones.

        It is a rigid body (PyBullet's maximal coordinates), because this is several times faster than a multibody
        without joints.
        """
        if not isinstance(shape, Shape):
            raise InputError("shape", f"the shape of {name!r} is {shape!r}; pass Sphere, Box, Cylinder or Capsule")
        require_between(f"mass of {name!r}", mass, MASSES, "kg")
        client, config = self._client, self.config
        uid = client.createMultiBody(
            mass, self._shape(shape), basePosition=state.position, baseOrientation=state.orientation,
            useMaximalCoordinates=1,
        )  # fmt: skip
        material = material or BodyMaterial(config.friction, config.restitution)
        body = Body(name, uid, shape.bounding_radius, False, state, {-1: ""}, {}, mass, shape, None, *material)
        with undone(lambda: client.removeBody(uid)):
            client.changeDynamics(
                uid, -1, lateralFriction=material.friction, restitution=material.restitution, linearDamping=0.0,
                angularDamping=0.0,
            )  # fmt: skip
            self._sharpen(uid, shape)
            self.place(body, state)
        return body

    def tracked(self, name: str, shape: Solid, state: BodyState) -> Body:
        """Create a body whose pose is dictated; simulated bodies collide with it."""
        # A multibody, because only a fixed multibody moves at its velocity and carries it into contacts.
        uid = self._client.createMultiBody(
            0.0, self._shape(shape), basePosition=state.position, baseOrientation=state.orientation
        )
        body = Body(name, uid, shape.bounding_radius, True, state, {-1: ""}, {}, shape=shape)
        with undone(lambda: self._client.removeBody(uid)):
            self._sharpen(uid, shape)
            self.place(body, state)
        return body

    def robot(self, name: str, robot: PreparedRobot, state: BodyState, material: BodyMaterial | None = None) -> Body:
        """Load a robot, whose joints turn freely, with the centre of mass of its root link in a ``state`` whose
        orientation is that of the link's frame. Links without ``<contact>`` have the configured friction and
        restitution or the given ones. Raises `InputError`, and adds nothing, if the robot is refused."""
        uid = load_robot(self._client, robot, URDF_FLAGS)
        with undone(lambda: self._client.removeBody(uid)):
            body = self._robot(name, uid, robot)
            body.initial = fixed_to(state, body.axes)
            body.friction, body.restitution = material or BodyMaterial(self.config.friction, self.config.restitution)
            self._set_contacts(body, robot.text)
            shares = self.damp(body)
            if less := [joint for joint, index in body.joints.items() if shares.get(index, 1.0) < TOLD_SHARE]:
                words = f"joints that have less damping than given, as much as a step bears: {', '.join(less)}"
                body.warnings = (*body.warnings, words)
            body.fixed = is_fixed(self._client, uid)
            body.box = self._box_of(body)
            self.place(body, body.initial)
        return body

    def _robot(self, name: str, uid: int, robot: PreparedRobot) -> Body:
        """Return the body of a robot that PyBullet has loaded. Raises `InputError`."""
        client = self._client
        client.changeDynamics(uid, -1, linearDamping=0.0, angularDamping=0.0)  # PyBullet's default is drag
        links, joints, damping, fastest = {}, {}, {}, PYBULLETS_FASTEST
        for index in range(-1, client.getNumJoints(uid)):
            link = link_name(client, uid, index)
            found = len(client.getCollisionShapeData(uid, index))
            if found != robot.collisions.get(link, 0):
                raise InputError(
                    "urdf", f"PyBullet has {found} of the {robot.collisions.get(link, 0)} collision shapes of link "
                    f"{link!r}"
                )  # fmt: skip
            if found:
                links[index] = link
                # PyBullet ignores this for links other than the base whose shapes have an origin of their own.
                client.changeDynamics(uid, index, collisionMargin=ROUNDED)
            if index >= 0:
                info = client.getJointInfo(uid, index)
                if info[2] in (pb.JOINT_REVOLUTE, pb.JOINT_PRISMATIC):
                    joints[info[1].decode()] = index
                    damping[index], fastest = info[6], max(fastest, min(info[11], FASTEST_SPIN))
                    command_joint(client, uid, index, JointCommand())
        if not links:
            raise InputError("urdf", "the URDF has no collision shape, so nothing could touch the ground")
        shapes = read_shapes(client, uid)
        couple_joints(client, uid, joints, robot.mimics)
        body = Body(
            name, uid, next(iter(shapes.values())).radius, False, BodyState(), links, joints, urdf=robot.given,
            shapes=shapes, frames=LinkFrames(client, uid), surfaces=robot.surfaces, starts=robot.starts,
            damping=damping,
        )  # fmt: skip
        client.changeDynamics(uid, -1, maxJointVelocity=fastest)
        note, warning = set_masses(client, uid, robot.text)
        body.notes = (*robot.notes, note) if note else robot.notes
        body.warnings = (*robot.warnings, warning) if warning else robot.warnings
        body.inertial = Transform(*client.getDynamicsInfo(uid, -1)[3:5])
        body.mass = sum(client.getDynamicsInfo(uid, index)[0] for index in range(-1, client.getNumJoints(uid)))
        return body

    def _box_of(self, body: Body) -> Box:
        """Return the box around a robot's links where their joints start, in the frame of its `state`."""
        assert body.frames is not None
        root = fixed_to(BodyState(), body.centre.inverse())
        frames = body.frames.states(root, {at: (body.starts.get(name, 0.0), 0.0) for name, at in body.joints.items()})
        inertial = {link: Transform(*self._client.getDynamicsInfo(body.uid, link)[3:5]) for link in body.shapes}
        poses = [Transform.of(fixed_to(frames[link + 1], pose)) for link, pose in inertial.items()]
        return box_around(*Underside([*body.shapes.values()], poses).bounds(BodyState()))

    def damp(self, body: Body) -> dict[int, float]:
        """Give a robot's joints the damping of its URDF, or as much of it as is stable with the present steps and
        posture. Returns the share of its damping that each joint has, by PyBullet's index."""
        shares = damp_joints(self._client, body.uid, body.damping, self.config.dt)
        body.stiff = min(shares.values(), default=1.0) < STIFF_SHARE
        return shares

    def _set_contacts(self, body: Body, urdf: str) -> None:
        """Give the links of a robot its friction and restitution, unless the ``<contact>`` of its URDF gives theirs."""
        elements = {link.get("name", ""): link for link in ElementTree.fromstring(urdf).iterfind("link")}
        for index, name in body.links.items():
            link = elements.get(name)
            if link is None or link.find("contact/lateral_friction") is None:
                self._client.changeDynamics(body.uid, index, lateralFriction=body.friction)
            if link is None or link.find("contact/restitution") is None:
                self._client.changeDynamics(body.uid, index, restitution=body.restitution)

    def state(self, body: Body) -> BodyState:
        """Return the state of a body's centre of mass, turned as PyBullet turns it: along its principal axes."""
        client = self._client
        return BodyState(*client.getBasePositionAndOrientation(body.uid), *client.getBaseVelocity(body.uid))

    def move(self, body: Body, state: BodyState) -> None:
        """Set the state of a body as `state` tells it; a robot's joints stay. A fixed base takes no velocity, because
        PyBullet would move it on with this velocity for ever."""
        self._client.resetBasePositionAndOrientation(body.uid, state.position, state.orientation)
        if not body.fixed:
            self._client.resetBaseVelocity(body.uid, state.linear, state.angular)

    def place(self, body: Body, state: BodyState) -> None:
        """Set the state of a body, and a robot's joints to zero; joints that mimic others to their offsets."""
        self.move(body, state)
        for name, joint in body.joints.items():
            self._client.resetJointState(body.uid, joint, body.starts.get(name, 0.0), 0.0)

    def underside(self, body: Body) -> Underside:
        """Return the lower surface of a simulated body or robot, with its joints as they are."""
        if body.shape is not None:
            return Underside([body.shape.body_shape], [IDENTITY])
        base = Transform(*self._client.getBasePositionAndOrientation(body.uid))
        poses = [
            base if link < 0 else Transform(*self._client.getLinkState(body.uid, link, computeForwardKinematics=1)[:2])
            for link in body.shapes
        ]
        return Underside([*body.shapes.values()], [base.inverse().then(pose) for pose in poses])

    def _sharpen(self, uid: int, shape: Solid) -> None:
        """Round the edges of a body by `ROUNDED` alone."""
        if isinstance(shape, Box | Cylinder):
            self._client.changeDynamics(uid, -1, collisionMargin=ROUNDED)

    def _shape(self, shape: Solid) -> int:
        if shape not in self._shapes:
            self._shapes[shape] = self._client.createCollisionShape(**shape.bullet())
        return self._shapes[shape]
