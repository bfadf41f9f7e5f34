"""Bodies and robots of the simulated world."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pybullet as pb

from smartmesh_ros.errors import InputError
from smartmesh_ros.physics.base_frames import InertialFrame
from smartmesh_ros.physics.body_shapes import read_shape
from smartmesh_ros.physics.bullet_sleep import is_fixed
from smartmesh_ros.physics.config import PhysicsConfig
from smartmesh_ros.physics.joints import JointCommand, command_joint
from smartmesh_ros.physics.limits import MASSES, SIZES, require_between
from smartmesh_ros.physics.link_contacts import given_contacts
from smartmesh_ros.physics.shapes import Box, Cylinder, Form, Shape, Sphere, form_of
from smartmesh_ros.physics.state import BodyState

# Collision margin of boxes and cylinders [m]. PyBullet rounds their edges by it; at its default of 1 mm a box standing
# on an edge would be 0.4 mm deep in the ground.
ROUNDED = 1e-4
# Use the URDF's inertias, which PyBullet otherwise computes from the collision shapes, and cylinders as they are, which
# PyBullet otherwise replaces by hulls of 64 vertices. A cylinder rolls as truly on a field, at half the cost.
URDF_FLAGS = pb.URDF_USE_INERTIA_FROM_FILE | pb.URDF_USE_IMPLICIT_CYLINDER


def is_text(urdf: str) -> bool:
    """Return True if a robot is given by the text of its URDF, not by a file."""
    return urdf.lstrip().startswith("<")


class Surface(NamedTuple):
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
    links: dict[int, str]
    joints: dict[str, int]
    mass: float = 0.0
    shape: Shape | None = None  # of a simulated body that is no robot
    urdf: str | None = None  # file or text of a robot
    friction: float = 0.0
    restitution: float = 0.0
    commands: dict[str, JointCommand] = field(default_factory=dict)  # by joint
    inertial: InertialFrame = field(default_factory=InertialFrame)  # of the base link
    owner: str = ""
    fixed: bool = False  # a robot whose base has no mass, so that physics does not move it
    hull: Box | None = None  # of a robot: the box around its links at joint positions zero, relative to its base

    @property
    def simulated(self) -> bool:
        """True if this world simulates the body."""
        return not self.tracked and not self.owner

    @cached_property
    def form(self) -> Form:
        """Shape that other nodes use for the body; of a robot its box."""
        return form_of(self.shape or self.hull or Sphere(self.radius))

    @property
    def is_robot(self) -> bool:
        """True if the body is a URDF robot."""
        return bool(self.links)


class BodyFactory:
    """Creates bodies in one PyBullet world. Shapes of equal size are created once, because PyBullet leaks removed
    shapes."""

    def __init__(self, client: Any, config: PhysicsConfig) -> None:
        self._client = client
        self.config = config
        self._shapes: dict[Shape, int] = {}

    def simulated(self, name: str, shape: Shape, mass: float, state: BodyState, surface: Surface | None = None) -> Body:
        """Create a body that moves by physics, with the configured friction and restitution or the given ones.

        It is a rigid body (PyBullet's maximal coordinates), because against a patch this is several times faster than a
        multibody without joints, and the only kind that supports continuous collision detection.
        """
        require_between(f"mass of {name!r}", mass, MASSES, "kg")
        client, config = self._client, self.config
        uid = client.createMultiBody(
            mass, self._shape(shape), basePosition=state.position, baseOrientation=state.orientation,
            useMaximalCoordinates=1,
        )  # fmt: skip
        surface = surface or Surface(config.friction, config.restitution)
        client.changeDynamics(
            uid, -1, lateralFriction=surface.friction, restitution=surface.restitution, linearDamping=0.0,
            angularDamping=0.0,
        )  # fmt: skip
        if isinstance(shape, Box | Cylinder):
            client.changeDynamics(uid, -1, collisionMargin=ROUNDED)
        body = Body(name, uid, shape.bounding_radius, False, state, {}, {}, mass, shape, None, *surface)
        self.place(body, state)
        return body

    def tracked(self, name: str, radius: float, state: BodyState) -> Body:
        """Create a sphere whose pose is dictated; simulated bodies collide with it."""
        # A multibody, because only a fixed multibody moves at its velocity and carries it into contacts.
        uid = self._client.createMultiBody(
            0.0, self._shape(Sphere(radius)), basePosition=state.position, baseOrientation=state.orientation
        )
        body = Body(name, uid, radius, True, state, {}, {})
        self.place(body, state)
        return body

    def robot(self, name: str, urdf: str, state: BodyState, surface: Surface | None = None) -> Body:
        """Load a robot from a URDF file, or from the URDF's text (starts with ``<``). Its joints turn freely. Links
        without ``<contact>`` have the configured friction and restitution or the given ones."""
        client, config = self._client, self.config
        surface = surface or Surface(config.friction, config.restitution)
        try:
            if is_text(urdf):
                with tempfile.NamedTemporaryFile("w", suffix=".urdf") as file:
                    file.write(urdf)
                    file.flush()
                    uid = client.loadURDF(file.name, state.position, state.orientation, flags=URDF_FLAGS)
            else:
                if not Path(urdf).is_file():
                    raise InputError("urdf", f"there is no URDF file {urdf!r}")
                uid = client.loadURDF(urdf, state.position, state.orientation, flags=URDF_FLAGS)
        except pb.error as error:
            raise InputError(
                "urdf", f"the URDF of {name!r} does not load ({error}); check it with check_urdf"
            ) from None
        client.changeDynamics(uid, -1, linearDamping=0.0, angularDamping=0.0)  # PyBullet's default is drag
        links, joints = {}, {}
        for index in range(-1, client.getNumJoints(uid)):
            if client.getCollisionShapeData(uid, index):
                links[index] = self._link_name(uid, index)
                # PyBullet ignores this for links other than the base whose shapes have an origin of their own.
                client.changeDynamics(uid, index, collisionMargin=ROUNDED)
            if index >= 0:
                info = client.getJointInfo(uid, index)
                if info[2] in (pb.JOINT_REVOLUTE, pb.JOINT_PRISMATIC):
                    joints[info[1].decode()] = index
                    command_joint(client, uid, index, JointCommand())
        if not links:
            client.removeBody(uid)
            raise InputError("urdf", f"the URDF of {name!r} has no collision shape, so nothing could touch the ground")
        body = Body(
            name,
            uid,
            read_shape(client, uid, next(iter(links))).radius,
            False,
            state,
            links,
            joints,
            urdf=urdf,
            friction=surface.friction,
            restitution=surface.restitution,
        )
        self._set_contacts(body)
        body.fixed = is_fixed(client, uid)
        body.inertial = InertialFrame(*client.getDynamicsInfo(uid, -1)[3:5])
        body.mass = sum(client.getDynamicsInfo(uid, index)[0] for index in range(-1, client.getNumJoints(uid)))
        self.place(body, BodyState())
        body.hull = self._hull(body)
        self.place(body, state)
        return body

    def _set_contacts(self, body: Body) -> None:
        """Give the links of a robot its friction and restitution, unless its URDF gives theirs."""
        assert body.urdf is not None
        given = given_contacts(body.urdf if is_text(body.urdf) else Path(body.urdf).read_text(errors="replace"))
        for index, link in body.links.items():
            known = given.get(link, frozenset())
            if "lateral_friction" not in known:
                self._client.changeDynamics(body.uid, index, lateralFriction=body.friction)
            if "restitution" not in known:
                self._client.changeDynamics(body.uid, index, restitution=body.restitution)

    def move(self, body: Body, state: BodyState) -> None:
        """Set the state of a body; a robot's joints stay as they are. A fixed base takes no velocity, because PyBullet
        would move it on with this velocity for ever."""
        self._client.resetBasePositionAndOrientation(body.uid, state.position, state.orientation)
        if not body.fixed:
            self._client.resetBaseVelocity(body.uid, state.linear, state.angular)

    def place(self, body: Body, state: BodyState) -> None:
        """Set the state of a body, and a robot's joints to zero."""
        self.move(body, state)
        for joint in body.joints.values():
            self._client.resetJointState(body.uid, joint, 0.0, 0.0)

    def _hull(self, body: Body) -> Box:
        """Return the box around the links of a robot at the origin."""
        bounds = np.array([self._client.getAABB(body.uid, link) for link in body.links])
        low, high = bounds[:, 0].min(axis=0), bounds[:, 1].max(axis=0)
        edges = np.clip(high - low, *SIZES).tolist()
        x, y, z = np.clip(0.5 * (low + high), -SIZES[1], SIZES[1]).tolist()
        return Box(*edges, centre=(x, y, z))

    def _shape(self, shape: Shape) -> int:
        if shape not in self._shapes:
            self._shapes[shape] = self._client.createCollisionShape(**shape.bullet())
        return self._shapes[shape]

    def _link_name(self, uid: int, index: int) -> str:
        client = self._client
        return str((client.getBodyInfo(uid)[0] if index < 0 else client.getJointInfo(uid, index)[12]).decode())
