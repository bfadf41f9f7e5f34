"""Commands to the joints of a world's robots and to their driven surfaces, and the decks that bodies carry."""

from __future__ import annotations

import logging
import math
from collections import defaultdict
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

import pybullet as pb

from smartmesh_ros.errors import InputError, as_float, named, require
from smartmesh_ros.ground.config import PhysicsConfig
from smartmesh_ros.ground.followers import Belt
from smartmesh_ros.ground.ground import Ground
from smartmesh_ros.ground.quaternions import conjugate, rotate
from smartmesh_ros.ground.state import Quaternion, Vector
from smartmesh_ros.ground.transform import Transform
from smartmesh_ros.terrain.deck import LEVEL, pose_of
from smartmesh_ros.terrain.terrain import Terrain
from smartmesh_ros.terrain.tiles import require_tile_name
from smartmesh_ros.world.bodies import Body, BodyFactory
from smartmesh_ros.world.joints import JointCommand, JointReading, command_joint, read_joints

# Steps from one fit of joints' damping to the next, in which postures change little.
DAMPED_STEPS = 8


class Carrier(NamedTuple):
    """What carries a deck: a ``link`` of a ``body``, "" = its base, and the pose of the deck's frame in that of the
    link: position [m] and orientation (x, y, z, w)."""

    body: str
    link: str = ""
    position: Vector = (0.0, 0.0, 0.0)
    orientation: Quaternion = LEVEL


class SurfaceReading(NamedTuple):
    """A driven surface of a robot: its name, the link, the present and the largest speed [m/s]."""

    name: str
    link: str
    speed: float
    limit: float


class Driving:
    """What drives the bodies of a world, by name, and what they carry. ``say`` tells the user what stops because no
    command came. ``carried``: by the names of decks, which may come later, as the bodies may."""

    carried: dict[str, Carrier]
    time: float
    say: Callable[[str], object] = logging.getLogger("smartmesh_ros").warning
    _terrain: Terrain
    _next_end: float  # not after the first end of a velocity [s]

    def _begin(self, client: Any, ground: Ground, physics: PhysicsConfig) -> None:
        """Start without bodies."""
        self._bodies: dict[str, Body] = {}
        self.client, self.ground = client, ground
        self._factory = BodyFactory(client, physics)
        self._efforts: dict[tuple[str, str], float] = {}  # [Nm or N] to apply before each step, by robot and joint
        self._stiff: dict[str, Body] = {}  # robots whose damping depends on their posture
        self._undamped = 0  # steps since it was fitted
        self._linkless: dict[str, Body] = {}  # bodies that lack the link that is to carry a deck, by the deck's name
        self._set_ends({})

    def drive(self, name: str, joint: str, velocity: float, force: float | None = None) -> None:
        """Drive a robot's joint at ``velocity`` [rad/s or m/s] with at most ``force`` [Nm or N], None = the joint's
        limit; or one of its driven surfaces at ``velocity`` [m/s]."""
        self.command(name, joint, JointCommand(velocity=velocity, effort=force))

    @property
    def bodies(self) -> dict[str, Body]:
        """The bodies by name, without those that were removed through ``client``."""
        self.ground.drop_gone()
        return self._bodies

    @property
    def terrain(self) -> Terrain:
        """The ground itself: replace the heights of its maps, or put and remove tiles and decks."""
        return self._terrain

    def command(self, name: str, joint: str, command: JointCommand, lasts: float = math.inf) -> None:
        """Drive a robot's joint by a command from now on, or one of its driven surfaces by a velocity, which is limited
        to that of the URDF. What a velocity drives stops after it ``lasts`` [s], unless the next command comes before.
        Raises `InputError` as `require_command` does."""
        self.require_command(name, joint, command)
        require(as_float(lasts) >= 0.0, "joint_command", "the duration of a command", lasts, "zero or more [s]")
        body = self.bodies[name]
        self._ends.pop((name, joint), None)
        if command.velocity and command.position is None and lasts < math.inf:
            self._ends[name, joint] = self.time + lasts
            self._next_end = min(self._next_end, self.time + lasts)
        if surface := body.surfaces.get(joint):
            self.drive_surface(name, surface.link, surface.within(command.velocity or 0.0), surface.axis)
            return
        if body.commands.get(joint) != command:  # a robot may sleep while it holds a position
            self.ground.wake(body.uid)
        self._command(body, joint, command)
        body.commands[joint] = command

    def _command(self, body: Body, joint: str, command: JointCommand) -> None:
        """Drive a joint by a command from now on."""
        command_joint(self.client, body.uid, body.joints[joint], command)
        self._efforts.pop((body.name, joint), None)
        if command.effort is not None and not command.has_target:  # to be applied in every step
            self._efforts[body.name, joint] = command.effort

    def _drive_all(self) -> None:
        """Do what the drives and the damping of joints need before a step."""
        self._stop_overdue()
        self._undamped += 1
        if self._undamped >= DAMPED_STEPS:
            self._undamped = 0
            for body in self._stiff.values():
                if not self.ground.is_asleep(body.uid):
                    self._factory.damp(body)
        for (name, joint), effort in self._efforts.items():
            body = self._bodies[name]
            self.client.setJointMotorControl2(body.uid, body.joints[joint], pb.TORQUE_CONTROL, force=effort)

    def _stop_overdue(self) -> None:
        """Stop what is driven by velocities whose time is over."""
        if self.time < self._next_end:
            return
        stopped = defaultdict(list)
        for (name, joint), end in list(self._ends.items()):
            if end <= self.time:
                self.command(name, joint, JointCommand(velocity=0.0))
                stopped[name].append(joint)
        self._next_end = min(self._ends.values(), default=math.inf)
        for name, joints in stopped.items():
            self.say(f"no command came for {', '.join(joints)} of {name!r} in time: stopped")

    def _set_ends(self, ends: dict[tuple[str, str], float]) -> None:
        """Replace the times at which velocities end [s], by robot and joint or surface."""
        self._ends, self._next_end = ends, min(ends.values(), default=math.inf)

    def require_command(self, name: str, joint: str, command: JointCommand) -> None:
        """Raise `InputError` if there is no robot of that name with this joint or driven surface, or if the command is
        not one for a surface."""
        body = self.body(name)
        if not isinstance(command, JointCommand):
            raise InputError("joint_command", f"the command is {command!r}; pass JointCommand(velocity=..., ...)")
        if isinstance(joint, str) and joint in body.surfaces:
            if command.velocity is None or command.position is not None or command.effort is not None:
                raise InputError("joint_command", f"{joint!r} of {name!r} is a track; it takes a velocity alone [m/s]")
        else:
            body.joint(joint)

    def drive_surface(self, name: str, link: str, speed: float, axis: Vector = (0.0, 1.0, 0.0)) -> None:
        """Move the surface of a robot's ``link``, or of another body (``link`` = ""), from now on, as that of a track;
        a speed of zero stops it.

        A positive ``speed`` [m/s] drives the body as a wheel that turns about ``axis``, a vector in the frame of the
        link, forward for the default if x points forward and y to the left. Raises `InputError`, as for a link that
        cannot touch the ground.
        """
        body = self.body(name)
        if not body.simulated:
            raise InputError("tracked", f"{name!r} is not simulated here; only the surface of a simulated body moves")
        index = body.link(link)
        turn = self.client.getDynamicsInfo(body.uid, index)[4] if body.is_robot else (0.0, 0.0, 0.0, 1.0)
        belt = Belt(axis, speed)
        self.ground.drive(body.uid, index, rotate(conjugate(turn), belt.axis), belt.speed)

    def carry(self, deck: str, carrier: Carrier | None) -> None:
        """Let a body carry a deck, whenever both are there; None = nobody, and the deck stays where it is. The body may
        be simulated or tracked; see `Ground.carry`. Raises `InputError` and changes nothing if the body has no such
        link, or the pose is none."""
        require_tile_name(deck)
        if carrier is not None:
            good = isinstance(carrier, Carrier) and isinstance(carrier.body, str) and isinstance(carrier.link, str)
            require(good, "deck", "the carrier", carrier, "Carrier(body, ...) with names, or None for nobody")
            pose_of(carrier.position, carrier.orientation)
            if carrier.link and carrier.body in self.bodies:
                self.bodies[carrier.body].link(carrier.link)
        if deck in self.terrain.decks:
            self.ground.carry(deck, None)
        self.carried.pop(deck, None)
        self._linkless.pop(deck, None)
        if carrier is not None:
            self.carried[deck] = carrier
            self.bind_decks()

    def bind_decks(self) -> None:
        """Bind the decks to the bodies of these names that are there now. A body that has no such link carries nothing,
        and the user is told once; a later one of this name may have it."""
        for name, carrier in self.carried.items():
            deck, body = self.terrain.decks.get(name), self.bodies.get(carrier.body)
            if deck is None or body is None or body.uid == deck.body or self._linkless.get(name) is body:
                continue
            self._bind(name, body, carrier)

    def _bind_anew(self) -> None:
        """Bind the decks that bodies of another client carried; those whose carriers are not here rest."""
        for name in [name for name, deck in self.terrain.decks.items() if deck.body >= 0]:
            carrier = self.carried.get(name)
            if carrier is not None and carrier.body in self.bodies:
                self._bind(name, self.bodies[carrier.body], carrier)
            else:
                self.ground.carry(name, None)

    def _release_decks(self, body: Body) -> None:
        """Let the decks rest that a body carries."""
        for name, deck in self.terrain.decks.items():
            if deck.body == body.uid:
                self.ground.carry(name, None)

    def _bind(self, name: str, body: Body, carrier: Carrier) -> None:
        try:
            link = body.link(carrier.link) if carrier.link else -1
        except InputError as error:
            self.say(f"nothing carries deck {name!r}: {error}")
            self._linkless[name] = body
            self.ground.carry(name, None)
            return
        centre = body.inertial if link < 0 else Transform(*self.client.getLinkState(body.uid, link)[2:4])
        place = centre.inverse().then(Transform(carrier.position, carrier.orientation))
        self.ground.carry(name, body.uid, link, *place)

    def joints(self, name: str) -> list[JointReading]:
        """Return the current readings of a robot's joints."""
        body = self.body(name)
        return read_joints(self.client, body.uid, body.joints, body.commands)

    def surfaces(self, name: str) -> list[SurfaceReading]:
        """Return the driven surfaces of a robot, as its URDF names them."""
        body = self.body(name)
        found = []
        for surface, drive in body.surfaces.items():
            follower = self.ground.followers.at(body.uid, body.link(drive.link))
            speed = 0.0 if follower is None else follower.belt.speed
            found.append(SurfaceReading(surface, drive.link, speed, drive.limit))
        return found

    def _belts(self, body: Body) -> dict[str, Belt]:
        """Return the moving surfaces of a body by link."""
        found = {link: self.ground.followers.at(body.uid, index) for index, link in body.links.items()}
        return {link: follower.belt for link, follower in found.items() if follower and follower.belt.speed}

    def _move_belts(self, body: Body, belts: dict[str, Belt]) -> None:
        """Move surfaces as `_belts` returned them. Raises `InputError` if a link is not there."""
        for link, belt in belts.items():
            self.ground.drive(body.uid, body.link(link), belt.axis, belt.speed)

    def body(self, name: str) -> Body:
        """Return a body; raises `InputError` if there is none of that name."""
        return named(name, self.bodies, "unknown_body", "body")

    def bodies_of(self, names: str | Iterable[str]) -> list[Body]:
        """Return the bodies of one name or several; raises `InputError` if there is none of one of them."""
        if isinstance(names, str) or not isinstance(names, Iterable):
            return [self.body(names)]
        return [self.body(name) for name in names]
