"""The whole state of a world, saved and restored; and the start of its episodes."""

from __future__ import annotations

import copy
import os
from collections.abc import Callable
from contextlib import nullcontext
from typing import Any, Protocol

import pybullet as pb

from smartmesh_ros.errors import checked_count, counted
from smartmesh_ros.ground.bullet import undone
from smartmesh_ros.ground.shapes import Hull
from smartmesh_ros.terrain import state_file
from smartmesh_ros.terrain.terrain import Terrain
from smartmesh_ros.world.bodies import Body, BodyMaterial
from smartmesh_ros.world.falling import Falls
from smartmesh_ros.world.joints import JointCommand
from smartmesh_ros.world.population import Population
from smartmesh_ros.world.robots.prepared import PreparedRobot, prepare_robot
from smartmesh_ros.world.settings import WorldConfig
from smartmesh_ros.world.snapshot import KIND, BodySnapshot, Snapshot, WorldState, checked_extra

Source = bytes | str | os.PathLike[str]


class StepWatcher(Protocol):
    """What takes part in the steps of a world, such as a sensor."""

    def before_step(self) -> None:
        """Do what is to be done right before the physics of a step."""

    def after_step(self) -> None:
        """Do what is to be done right after it, at the world's new time."""

    def start_over(self) -> None:
        """Forget commands and what was measured: an episode begins at the world's time."""


class SavedWorld(Population):
    """The state of a world; see `World`."""

    config: WorldConfig
    falls: Falls
    seed: int
    watchers: list[StepWatcher]
    _rescues: int
    _first: Terrain | None
    _start: Callable[[], None]
    close: Callable[[], None]

    @property
    def rescues(self) -> int:
        """Number of bodies put back onto the ground so far."""
        return self._rescues + self.ground.rescues

    def snapshot(self) -> Snapshot:
        """Return the current bodies as data."""
        return Snapshot(time=self.time, bodies=tuple(map(self._snapshot_of, self._own_bodies())))

    def _snapshot_of(self, body: Body) -> BodySnapshot:
        return BodySnapshot(
            name=body.name, state=self._factory.state(body), initial=body.initial, radius=body.radius, mass=body.mass,
            shape=body.shape, tracked=body.tracked, urdf=body.urdf, friction=body.friction,
            restitution=body.restitution, commands=dict(body.commands), belts=self._belts(body),
            joints={name: self.client.getJointState(body.uid, index)[:2] for name, index in body.joints.items()},
            ends={joint: end for (name, joint), end in self._ends.items() if name == body.name},
        )  # fmt: skip

    def state_bytes(self) -> bytes:
        """Return the whole state, as `save` does, and go on as before."""
        return self._whole(self.snapshot())

    def _saved(self, extra: dict[str, Any] | None = None) -> bytes:
        """Return the whole state as other worlds take it over."""
        return self._whole(self.snapshot().rounded(), extra)

    def _whole(self, snapshot: Snapshot, extra: dict[str, Any] | None = None) -> bytes:
        """Return the whole state, with a snapshot of its bodies."""
        state = WorldState(
            **self.ground.laid(),
            snapshot=snapshot,
            carried=self.carried,
            config=self.config,
            seed=self.seed,
            first=self._first,
            memory=self.ground.contacts.memory(self._own_slots()),
            falls=self.falls.checked,
            extra=extra or {},
        )
        return state_file.to_bytes(KIND, state)

    def save(self, file: str | os.PathLike[str] | None = None, *, extra: dict[str, Any] | None = None) -> bytes:
        """Return the whole state, and write it to a ``file`` unless it is None.

        It has bodies, robots by their description as it was given, joints, commands, moving surfaces, the terrain with
        its motion, corrections, materials and decks, the soil, the settings and the time. Not in it are remote bodies,
        which their owners send again, and what was set through ``client``. This world is rebuilt from the state, so
        that it goes on to the last bit as any that is restored from it: both start without the impulses of the contacts
        before, and what slept wakes, and sleeps again after a few steps. ``extra``: a dict of numbers, texts, arrays,
        lists, tuples and dicts, which the state has, too. Raises `InputError`, and writes nothing, if ``extra`` is
        none, or the file cannot be written.
        """
        data = self._saved(checked_extra(extra))
        if file is not None:
            state_file.write(data, file)
        self.restore(data)
        return data

    def restore(self, state: WorldState | Snapshot | Source) -> None:
        """Put this world into a ``state`` that was saved by any world, bytes or a file; or, of a `Snapshot`, its bodies
        alone, while terrain, soil and settings stay.

        PyBullet's client is a new one. Tiles and soil that are there take the restored ground in place. Raises
        `InputError` and changes nothing if the state is none, was damaged or saved by another version, if a robot of it
        is refused or lacks a joint or link.
        """
        if not isinstance(state, WorldState | Snapshot):
            state = WorldState.from_bytes(state_file.read(state))
        snapshot = state if isinstance(state, Snapshot) else state.snapshot
        robots = {body.name: prepare_robot(body.urdf) for body in snapshot.bodies if body.urdf is not None}
        before, drawn = dict(vars(self)), self.ground.drawn
        self.ground.check_soil()
        laid: Any = nullcontext(self.ground.soil)
        if isinstance(state, WorldState):
            laid = self.ground.other_terrain(state.terrain, state.soil, state.tile)
        with state_file.foreign_refused(), laid as soil, undone(lambda: self._back_to(before)):
            self._rescues = self.rescues
            if isinstance(state, WorldState):
                self.config, self.seed, self._first = state.config, int(state.seed), state.first
                self.carried = dict(state.carried)
            self._start()
            self.ground.set_soil(soil)
            self._fill(snapshot, robots)
            if isinstance(state, WorldState):
                self.ground.contacts.recall(self._own_slots(), state.memory)
                self.falls.checked = float(state.falls)
            if drawn:
                self.ground.show(drawn)
            self._bind_anew()
        if before["client"].isConnected():
            before["client"].disconnect()

    def reset(self, seed: int | None = None) -> None:
        """Put every simulated body back to its initial state and the time to zero. The terrain stays, and so do
        commands of joints.

        With a ``seed``, zero or more, an episode begins: the terrain is that of the world's first step on it, soil is
        untouched there, joints and surfaces have no commands, and height scans have their noise by the seed. Episodes
        with the same bodies, seed and commands are then equal to the last bit; of the first one only if it began with
        such a reset, too.
        """
        if seed is not None:
            seed = checked_count(seed, "seed", "the seed")
        self.reset_time()
        if seed is not None:
            self._begin_episode(seed)
        self.reset_bodies()
        if seed is not None:
            for body in self._stiff.values():
                self._factory.damp(body)
            self.ground.forget()

    def clear(self) -> None:
        """Remove all bodies and set the time to zero. Episodes begin with the terrain of the next step."""
        for body in self._own_bodies():
            self._remove(body.name)
        self.reset_time()
        self._first = None

    def reset_time(self) -> None:
        """Set the time to zero. Bodies and terrain stay; remote bodies are removed until their next states arrive."""
        self.guests.clear()
        self.terrain.shift_time(-self.time)
        self._set_ends({key: end - self.time for key, end in self._ends.items()})
        self.time = 0.0

    def reset_bodies(self) -> None:
        """Put every simulated body back to its initial state. Commands of joints stay in force. Raises PyBullet's
        error, with the names of the bodies for which it failed; the others are back."""
        failed = []
        for body in (body for body in self.bodies.values() if body.simulated):
            try:
                self._factory.place(body, body.initial)
            except pb.error as error:
                failed.append(f"{body.name!r}: {error}")
        self.ground.wake()
        if failed:
            raise pb.error(f"{counted(len(failed))} not back, but all others; reset again: {'; '.join(failed)}")

    def _note_first_terrain(self) -> None:
        """Keep the terrain of the first step on it, for episodes, as if this were at time zero."""
        if self._first is None and not self.terrain.empty:
            self._first = copy.deepcopy(self.terrain)
            self._first.shift_time(-self.time)

    def _begin_episode(self, seed: int) -> None:
        """Let terrain, commands and chance be as at the start."""
        self.seed, self._undamped = seed, 0
        for body in self.bodies.values():
            for joint in body.commands:
                self._command(body, joint, JointCommand())
            body.commands.clear()
            for link in self._belts(body):
                self.drive_surface(body.name, link, 0.0)
        self._set_ends({})
        for watcher in self.watchers:
            watcher.start_over()
        self._note_first_terrain()
        if self._first is None:
            return
        tile = self.ground.tile_of_soil
        self.terrain.become(copy.deepcopy(self._first))
        if (soil := self.ground.soil) is not None and self.terrain.tiles.get(tile) is soil.map:
            soil.become(self.terrain, {**soil.state(), "memory": None}, tile)
            self.ground.set_soil(soil)
        else:
            self.ground.set_soil(None)

    def _own_bodies(self) -> list[Body]:
        """The bodies of this world, without remote ones."""
        return [body for body in self.bodies.values() if not body.owner]

    def _own_slots(self) -> list[int]:
        """The slots of these bodies and their links, in order."""
        links = ((body, link) for body in self._own_bodies() for link in body.links)
        found = (self.followers.at(body.uid, link) for body, link in links)
        return [follower.slot for follower in found if follower is not None]

    def _back_to(self, before: dict[str, Any]) -> None:
        """Be again what the world was ``before``."""
        if self.client is not before["client"]:
            self.close()
        vars(self).update(before)

    def _fill(self, snapshot: Snapshot, robots: dict[str, PreparedRobot]) -> None:
        """Add the bodies of a snapshot to a world without bodies, with its prepared robots."""
        self.time = float(snapshot.time)
        for body in snapshot.bodies:
            material = BodyMaterial(body.friction, body.restitution)
            if body.name in robots:
                robot = self._factory.robot(body.name, robots[body.name], body.state, material)
                self._factory.move(robot, body.state)
                self._add(robot)
            elif body.tracked:
                self.track(body.name, body.shape or body.radius, body.state)
            elif body.shape is not None and not isinstance(body.shape, Hull):
                self._add(self._factory.simulated(body.name, body.shape, body.mass, body.state, material))
            new = self.bodies[body.name]
            new.initial = body.initial
            for joint, (position, velocity) in body.joints.items():
                self.client.resetJointState(new.uid, new.joint(joint), position, velocity)
            for joint, command in body.commands.items():
                self.command(body.name, joint, command)
            self._move_belts(new, body.belts)
        self._set_ends({(body.name, joint): end for body in snapshot.bodies for joint, end in body.ends.items()})
