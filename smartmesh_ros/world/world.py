"""A physics world on deforming terrain."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Self

import numpy as np
import pybullet as pb
from pybullet_utils.bullet_client import BulletClient

from smartmesh_ros.errors import InputError
from smartmesh_ros.ground.bullet import BulletCalls, undone
from smartmesh_ros.ground.config import set_up
from smartmesh_ros.ground.ground import Ground
from smartmesh_ros.ground.shapes import Hull
from smartmesh_ros.ground.shown_patches import ShownPatches
from smartmesh_ros.stopwatch import Stopwatch
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.terrain.height_scan import HeightScan, yaws_of
from smartmesh_ros.terrain.terrain import MainMesh, Terrain
from smartmesh_ros.world.bodies import Surface
from smartmesh_ros.world.carrying import Carrier, Carrying
from smartmesh_ros.world.contacts import GroundContact, GroundWrench, ground_contacts, wrenches_of_step
from smartmesh_ros.world.falling import Falls
from smartmesh_ros.world.guests import Guests
from smartmesh_ros.world.link_frames import frame_pose
from smartmesh_ros.world.population import Population
from smartmesh_ros.world.robots.prepared import PreparedRobot, prepare_robot
from smartmesh_ros.world.settings import WorldConfig
from smartmesh_ros.world.snapshot import Snapshot, body_snapshot
from smartmesh_ros.world.watching import StepWatcher

__all__ = ["World", "WorldConfig"]


class World(Population, Carrying):
    """Bodies on a terrain, stepped at a fixed rate. Close it, or use it as a context manager.

    ``time`` [s] starts at zero and advances by one step at a time; maps are stamped with it. ``guests``: remote bodies,
    simulated by other nodes. ``watchers``: take part in each step.
    """

    def __init__(
        self,
        terrain: MainMesh | Terrain | None = None,
        config: WorldConfig | None = None,
        stopwatch: Stopwatch | None = None,
    ) -> None:
        self.config = config or WorldConfig()
        self.terrain = Terrain() if terrain is None else Terrain.of(terrain)
        self.stopwatch = stopwatch or Stopwatch()
        self.watchers: list[StepWatcher] = []
        self._rescues = 0  # of the grounds before `restore`
        self.carried: dict[str, Carrier] = {}
        self.lost: dict[str, str] = {}  # why bodies were removed, by name; readers may clear it
        self._start()

    def _start(self) -> None:
        """Initialise without bodies, at time zero."""
        self.time = 0.0
        client: Any = BulletClient(pb.DIRECT)
        set_up(client, self.config.physics)
        ground = self._new_ground(client)
        self._begin(client, ground, self.config.physics)
        self.guests = Guests(self, self.config.guests)
        self.falls = Falls(ground.followers, self.terrain, self.config.falls)
        self._let_sleep()

    def _new_ground(self, client: Any) -> Ground:
        return Ground(client, self.terrain, self.stopwatch)

    def __getstate__(self) -> dict[str, Any]:
        """Return what a copy of the world, or one in another process, is made of: its terrain, its settings and a
        snapshot. Raises `InputError` if there is soil."""
        if self.ground.soil is not None:
            raise InputError("soil", "a world with soil cannot be copied; take it off by ground.set_soil(None) before")
        kept = {name: getattr(self, name) for name in ("terrain", "config", "carried")}
        return kept | {"snapshot": self.snapshot()}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Make a world that evolves as one restored from the snapshot."""
        World.__init__(self, state["terrain"], state["config"])
        self.carried = state["carried"]
        with undone(self.close):
            self.restore(state["snapshot"])

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def configure(self, config: WorldConfig) -> None:
        """Replace the settings; new friction and restitution apply to later bodies only."""
        self.ground.wake()  # PyBullet changes the gravity of awake bodies only
        before = self.config
        with undone(lambda: set_up(self.client, before.physics)):
            set_up(self.client, config.physics)
        self.config = config
        if (config.physics.sleep, config.sleep) != (before.physics.sleep, before.sleep):
            self._let_sleep()
        self._factory.config = config.physics
        if config.physics.dt != before.physics.dt:
            for body in self.bodies.values():
                self._factory.damp(body)
        self.guests.config, self.falls.config = config.guests, config.falls

    @property
    def dt(self) -> float:
        """Length of a step [s]."""
        return self.config.physics.dt

    def close(self) -> None:
        """Disconnect from PyBullet."""
        if self.client.isConnected():
            self.client.disconnect()

    @property
    def rescues(self) -> int:
        """Number of bodies put back onto the ground so far."""
        return self._rescues + self.ground.rescues

    def update(self) -> None:
        """Do what the next step needs beside contacts, see `Ground.update`, and remove bodies that are lost. `step`
        does it; call it while no steps are taken."""
        if self.carried:
            self.bind_decks()
        self.ground.update(self.time, self.dt)
        self._drop_lost()

    def step(self, count: int = 1, prepared: Callable[[], None] = lambda: None) -> None:
        """Run physics steps. ``prepared`` is called before each, after `update`."""
        for _ in range(count):
            with self.stopwatch.stage("total"):
                self.guests.advance()
                self.update()
            prepared()
            with self.stopwatch.stage("total"), self.stopwatch.stage("step"):
                for watcher in self.watchers:
                    watcher.before_step()
                self._drive_all()
                self.client.stepSimulation()
                self.time += self.config.physics.dt
                for watcher in self.watchers:
                    watcher.after_step()
            self.guests.note_contacts()
            self.stopwatch.lap()

    def skip(self, steps: int) -> None:
        """Advance the time by some steps without simulating them: the ground moves on, and bodies stay in place."""
        if steps > 0:
            duration = steps * self.config.physics.dt
            self.time += duration

    def reset(self) -> None:
        """Put every simulated body back to its initial state and the time to zero; the terrain stays."""
        self.reset_time()
        self.reset_bodies()

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
            raise pb.error(f"{len(failed)} bodies are not back, but the others are; reset again: {'; '.join(failed)}")

    def snapshot(self) -> Snapshot:
        """Return the current bodies as data."""
        return Snapshot(
            time=self.time,
            bodies=tuple(
                body_snapshot(self.client, body, self.state(name), self._belts(body), self._ends_of(name))
                for name, body in self.bodies.items()
                if not body.owner
            ),
        )

    def save(self) -> Snapshot:
        """Return a snapshot, and rebuild this world from it, so that it evolves exactly as any world restored from the
        snapshot."""
        snapshot = self.snapshot()
        self.restore(snapshot)
        return snapshot

    def restore(self, snapshot: Snapshot) -> None:
        """Replace the bodies by those of a snapshot, in a new PyBullet client; the terrain and its soil stay. Raises
        `InputError` and changes nothing if a robot of it is refused or lacks a joint or link."""
        robots = {body.name: prepare_robot(body.urdf) for body in snapshot.bodies if body.urdf is not None}
        self.ground.check_soil()
        before = dict(vars(self))
        with undone(lambda: vars(self).update(before)):
            self._rescues = self.rescues
            soil, drawn = self.ground.soil, self.ground.drawn
            self._start()
            self.ground.set_soil(soil)
            self._fill(snapshot, robots)
            if drawn:
                self.ground.show(drawn)
        if before["client"].isConnected():
            before["client"].disconnect()

    def _fill(self, snapshot: Snapshot, robots: dict[str, PreparedRobot]) -> None:
        """Add the bodies of a snapshot to a world without bodies, with its prepared robots."""
        self.time = snapshot.time
        for body in snapshot.bodies:
            surface = Surface(body.friction, body.restitution)
            if body.name in robots:
                self._add(self._factory.robot(body.name, robots[body.name], body.state, surface))
            elif body.tracked:
                self.track(body.name, body.shape or body.radius, body.state)
            elif body.shape is not None and not isinstance(body.shape, Hull):
                self._add(self._factory.simulated(body.name, body.shape, body.mass, body.state, surface))
            new = self.bodies[body.name]
            new.initial = body.initial
            for joint, (position, velocity) in body.joints.items():
                self.client.resetJointState(new.uid, self._joint(new, joint), position, velocity)
            for joint, command in body.commands.items():
                self.command(body.name, joint, command)
            self._move_belts(new, body.belts)
        self._set_ends({(body.name, joint): end for body in snapshot.bodies for joint, end in body.ends.items()})

    def patches(self) -> ShownPatches:
        """Return the patches of ground in reach of the bodies now, without those of remote bodies, which their owners
        publish."""
        return self.ground.find_patches(self.time)

    def contacts(self) -> list[GroundContact]:
        """Return the contacts with the ground in the last step; for tracked bodies, with the ground
        now."""
        found = ground_contacts(self.client, self.ground, self.time)
        return [contact for contact in found if not self._is_guest(contact.body)]

    def wrenches(self) -> list[GroundWrench]:
        """Return the wrench of the ground in the last step on each simulated body and link that can touch it."""
        found = wrenches_of_step(self.client, self.ground)
        return [wrench for wrench in found if not self._is_guest(wrench.body)]

    def height_scan(self, names: str | Sequence[str], scan: HeightScan) -> FloatArray:
        """Return the values (n, k) of a scan of the ground around n bodies now, of a robot around the frame of its base
        link. Raises `InputError` if there is no body of one of the names, or if the scan has a delay, for which
        `HeightScanner` keeps earlier scans."""
        if scan.delay:
            raise InputError("height_scan", "World.height_scan scans now; for a delay use a HeightScanner")
        bodies = [self._body(name) for name in ([names] if isinstance(names, str) else names)]
        poses_w = BulletCalls(self.client).poses([body.uid for body in bodies])
        for row, body in enumerate(bodies):
            if body.is_robot:
                poses_w[row] = frame_pose(poses_w[row], body.inertial)
        return scan.read(self.terrain, np.column_stack([poses_w[:, :3], yaws_of(poses_w[:, 3:])]), self.time)

    def below_ground(self) -> list[str]:
        """Return simulated bodies and links whose middle was under the ground at the last update."""
        followers = self.followers
        own = np.flatnonzero(followers.table["own"])
        return [followers[slot].name for slot, _, _ in self.ground.below(own, self.ground.time)]

    def _drop_lost(self) -> None:
        """Remove lost bodies, and tell of those that begin to fall."""
        lines, gone = self.falls.check(self.time)
        for line in lines:
            self.say(line)
        for name, why in gone.items():
            guest = self._is_guest(name)
            self._remove(name)
            if guest:
                self.guests.dropped(name)
            else:
                self.lost[name] = why

    def _let_sleep(self) -> None:
        self.ground.let_sleep((lambda _: True) if self.config.physics.sleep else None, self.config.sleep)
