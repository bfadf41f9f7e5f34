"""The bodies of a world, by name."""

from __future__ import annotations

import logging
import os
from collections.abc import Callable, Iterable
from contextlib import suppress
from typing import Any

import pybullet as pb
from numpy.typing import ArrayLike

from smartmesh_ros.errors import InputError, as_float, require_body_name, require_flag
from smartmesh_ros.ground.bullet import undone
from smartmesh_ros.ground.followers import Followers
from smartmesh_ros.ground.limits import require_possible
from smartmesh_ros.ground.shapes import Shape, Solid, Sphere
from smartmesh_ros.ground.state import BodyState
from smartmesh_ros.ground.transform import fixed_to
from smartmesh_ros.terrain.surface_query import GroundSamples, checked_rays
from smartmesh_ros.world.bodies import Body
from smartmesh_ros.world.body_rays import RayHits, cast_rays
from smartmesh_ros.world.driving import Driving
from smartmesh_ros.world.link_frames import frame_state
from smartmesh_ros.world.robots.prepared import PreparedRobot, prepare_robot
from smartmesh_ros.world.standing import NO_TERRAIN, put_on_ground


class Population(Driving):
    """The bodies of a world, by name, on its ``ground`` at the world's ``time`` [s]: spawned and tracked bodies,
    robots, and remote bodies (``guests``). ``note`` tells the user what a robot's
    description was taken as, ``say`` what may be wrong."""

    guests: Any  # the `Guests`, which know this class
    note: Callable[[str], object] = logging.getLogger("smartmesh_ros").info

    def spawn(
        self,
        name: str,
        shape: Shape,
        mass: float,
        state: BodyState | None = None,
        *,
        on_ground: bool = False,
        clearance: float = 0.0,
        align: bool = False,
    ) -> None:
        """Add a simulated body; raises `InputError` and adds nothing if its name is taken or a value is impossible.

        ``on_ground``: the height is chosen so that the body's lowest point is ``clearance`` [m] above the ground, and
        the ground's velocity is added to the body's. ``align``: the body is tilted with the ground, too. A place where
        some part of the body is over no ground is refused.
        """
        self._require_free(name)
        start = self._start_of(name, state, on_ground, clearance, align)
        body = self._factory.simulated(name, shape, mass, start)
        self._add(self._put(body, on_ground=on_ground, clearance=clearance, align=align))

    def spawn_robot(
        self,
        name: str,
        urdf: str | os.PathLike[str] | PreparedRobot,
        state: BodyState | None = None,
        *,
        on_ground: bool = False,
        clearance: float = 0.0,
        align: bool = False,
    ) -> None:
        """Add a robot from a URDF file or text, with a patch for each link that has a collision shape; ``on_ground``,
        ``clearance`` and ``align`` as of `spawn`. ``state``: of the centre of mass of its root link, with the
        orientation of that link's frame. Raises `InputError` and adds nothing if the robot is refused.

        A robot that was prepared by `prepare_robot`, in another thread for example, is added in a few milliseconds.
        """
        self._require_free(name)
        body = self._factory.robot(name, prepare_robot(urdf), self._start_of(name, state, on_ground, clearance, align))
        self._add(self._put(body, on_ground=on_ground, clearance=clearance, align=align))

    def ground_at(self, points_w: ArrayLike) -> GroundSamples:
        """Return the ground under points (N, 2) [m] now: heights, normals, velocities and ages; see `Ground.at`."""
        return self.ground.at(points_w, self.time)

    def cast_rays(
        self, origins_w: ArrayLike, directions_w: ArrayLike, reach: float, *, through: str | Iterable[str] = ()
    ) -> RayHits:
        """Return what rays from ``origins_w`` (N, 3) [m] along ``directions_w`` (N, 3) meet now within ``reach`` [m]:
        ground or bodies, except those named in ``through``. Raises `InputError`."""
        names = [body.name for body in self.bodies_of(through)]
        rays = checked_rays(origins_w, directions_w, reach)
        return cast_rays(self.client, self.bodies, self.ground.rays, rays, self.time, names)

    def replace_robot(self, name: str, urdf: str | os.PathLike[str] | PreparedRobot) -> None:
        """Replace a robot by another at the current pose of its base link's frame; raises `InputError` and changes
        nothing if the URDF does not load."""
        old = self._own_body(name)
        new = self._factory.robot(name, prepare_robot(urdf), BodyState())
        new.initial = fixed_to(frame_state(old.initial, old.inertial), new.inertial)
        with undone(lambda: self.client.removeBody(new.uid)):
            self._factory.place(new, fixed_to(self.base_state(name), new.inertial))
        self._exchange(old, new)

    def track(self, name: str, shape: Solid | float, state: BodyState) -> None:
        """Add a tracked body, whose pose is dictated, or set its next pose. ``shape``: or the radius of a sphere [m].

        Between calls the body moves on with its velocity. Another shape replaces the body.
        """
        require_possible(name, state)
        body = self.bodies.get(name) if isinstance(name, str) else None
        solid = shape if isinstance(shape, Solid) else Sphere(shape)
        if body is None:
            self._require_free(name)
            self._add(self._factory.tracked(name, solid, state))
        elif body.tracked and body.shape != solid:
            self._exchange(body, self._factory.tracked(name, solid, state))
        elif not body.tracked:
            raise InputError("duplicate_id", f"{name!r} is a simulated body; a tracked body needs another name")
        else:
            self._factory.place(body, state)

    def remove(self, name: str) -> None:
        """Remove a body from the world; raises `InputError` if there is none of that name, or another node simulates
        it."""
        self._own_body(name)
        self._remove(name)

    def add_guest(self, name: str, owner: str, shape: Shape, mass: float) -> int:
        """Add a remote body, which ``owner`` simulates, and return its PyBullet body; `Guests` sets its state."""
        body = self._factory.simulated(name, shape, mass, BodyState())
        body.owner = owner
        self._add(body)
        return body.uid

    def remove_guest(self, name: str) -> None:
        """Remove a remote body from the world."""
        if name in self.bodies:
            self._remove(name)

    def move(self, name: str, state: BodyState) -> None:
        """Set the state of a simulated body, as `state` tells it; a robot's joints stay as they are. A robot whose base
        is fixed takes no velocity. Raises `InputError` if the body is not simulated, or the state is impossible."""
        body = self._own_body(name)
        require_possible(name, state)
        if body.tracked:
            raise InputError("tracked", f"the pose of {name!r} is dictated by its topic; only simulated bodies move")
        before = self._factory.state(body)
        with undone(lambda: self._factory.move(body, before)):
            self._factory.move(body, fixed_to(state, body.axes))
            self.ground.wake(body.uid)

    def wake(self, name: str | None = None) -> None:
        """Wake a body, or all (None), with what it touches; see `Ground.let_sleep`."""
        self.ground.wake(None if name is None else self.body(name).uid)

    def is_asleep(self, name: str) -> bool:
        """Return True if a body sleeps; raises `InputError` if there is none of that name."""
        return self.ground.is_asleep(self.body(name).uid)

    def state(self, name: str) -> BodyState:
        """Return the state of a body's centre of mass; of a robot, that of its root link, with the orientation of this
        link's frame."""
        body = self.body(name)
        return frame_state(self._factory.state(body), body.axes)

    def base_state(self, name: str) -> BodyState:
        """Return the state of the frame of a robot's base link; of another body, the state of its centre of mass."""
        body = self.body(name)
        return frame_state(self._factory.state(body), body.inertial)

    @property
    def dt(self) -> float:
        """Length of a step [s]."""
        return self._factory.config.dt

    @property
    def followers(self) -> Followers:
        """The attached bodies and links, by the slots of the batches."""
        return self.ground.followers

    def _start_of(
        self, name: str, state: BodyState | None, on_ground: bool, clearance: float, align: bool
    ) -> BodyState:
        """Return the state for a new body before it is put onto the ground. Raises `InputError`."""
        require_flag(on_ground, "parameter", "on_ground")
        require_flag(align, "parameter", "align")
        if (as_float(clearance) != 0.0 or align) and not on_ground:
            raise InputError("parameter", "clearance and align go with on_ground=True alone")
        state = BodyState() if state is None else state
        require_possible(name, state)
        if on_ground and self.terrain.empty:
            raise InputError("no_map", NO_TERRAIN)
        return state

    def _put(self, body: Body, *, on_ground: bool, clearance: float, align: bool) -> Body:
        """Put a body that PyBullet has onto the ground, by the options of `spawn`; removes it from PyBullet if that
        fails."""
        if on_ground:
            with undone(lambda: self.client.removeBody(body.uid)):
                under = self._factory.underside(body)
                start = put_on_ground(under, body.initial, self.ground_at, clearance=clearance, align=align)
                require_possible(body.name, start)
                self._factory.place(body, start)
                body.initial = start
        return body

    def _own_body(self, name: str) -> Body:
        """Return a body that this world simulates or tracks; raises `InputError` for a remote body."""
        body = self.body(name)
        if body.owner:
            raise InputError("guest", f"{name!r} is simulated by {body.owner}; ask that one")
        return body

    def _remove(self, name: str) -> None:
        """Remove a body; it stays if PyBullet fails."""
        body = self.body(name)
        self.client.removeBody(body.uid)
        self._forget(body)
        with suppress(pb.error):  # its piece of ground goes with the next look at the bodies
            self.ground.drop_gone()

    def _exchange(self, old: Body, new: Body) -> None:
        """Put a new body in the place of another; the old one stays if PyBullet fails."""
        with undone(lambda: self._take_out(new)):
            self._put_on_ground(new)
            self._remove(old.name)
            self._enter(new)  # it comes last, as one that was added

    def _forget(self, body: Body) -> None:
        """Forget a body that is gone, and what it did."""
        self._release_decks(body)
        self._efforts = {key: effort for key, effort in self._efforts.items() if key[0] != body.name}
        self._stiff.pop(body.name, None)
        self._set_ends({key: end for key, end in self._ends.items() if key[0] != body.name})
        del self._bodies[body.name]

    def _require_free(self, name: str) -> None:
        require_body_name(name)
        if owner := self.guests.owner_of(name):
            raise InputError("duplicate_id", f"{name!r} is simulated by {owner} already; choose another name")
        if name in self.bodies:
            raise InputError("duplicate_id", f"there is a body {name!r} already; remove it or choose another name")

    def _add(self, body: Body) -> None:
        with undone(lambda: self._take_out(body)):
            self._put_on_ground(body)
            self._enter(body)

    def _enter(self, body: Body) -> None:
        self._bodies[body.name] = body
        if body.stiff:
            self._stiff[body.name] = body
        for note in body.notes:
            self.note(f"robot {body.name!r}: {note}")
        for warning in body.warnings:
            self.say(f"robot {body.name!r}: {warning}")

    def _put_on_ground(self, body: Body) -> None:
        """Attach a body that PyBullet has to the ground."""
        for index, link in body.links.items():
            shape = body.shapes.get(index, body.shape)
            follower = self.ground.attach(body.uid, index, solid=not body.tracked, shape=shape)
            follower.name = f"{body.name}/{link}" if link else body.name
            self.ground.set_owner(follower.slot, own=body.simulated and not body.fixed, remote=bool(body.owner))

    def _take_out(self, body: Body) -> None:
        """Remove what `_put_on_ground` was given."""
        self.client.removeBody(body.uid)
        self.ground.drop_gone()
