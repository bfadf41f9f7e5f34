"""A physics world on deforming terrain."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Self

import numpy as np
import pybullet as pb
from pybullet_utils.bullet_client import BulletClient

from smartmesh_ros.errors import InputError, as_float, checked_count, require
from smartmesh_ros.ground.bullet import BulletCalls, NoClient, undone
from smartmesh_ros.ground.config import set_up
from smartmesh_ros.ground.followers import Follower
from smartmesh_ros.ground.ground import Ground
from smartmesh_ros.ground.shown_patches import ShownPatches
from smartmesh_ros.stopwatch import Stopwatch
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.terrain.height_scan import HeightScan, require_scan, yaws_of
from smartmesh_ros.terrain.terrain import MainMesh, Terrain
from smartmesh_ros.world.bodies import Body, BodyFactory
from smartmesh_ros.world.contacts import GroundContact, GroundWrench, ground_contacts, wrenches_of_step
from smartmesh_ros.world.driving import Carrier
from smartmesh_ros.world.falling import Falls
from smartmesh_ros.world.guests import Guests
from smartmesh_ros.world.link_frames import frame_pose
from smartmesh_ros.world.saved_world import SavedWorld, StepWatcher
from smartmesh_ros.world.settings import WorldConfig

__all__ = ["ROUNDING", "World", "WorldConfig"]

# Share of a step by which what has a rate may be early, because simulated times are sums of rounded steps.
ROUNDING = 1e-3


class World(SavedWorld):
    """Bodies on a terrain, stepped at a fixed rate. Close it, or use it as a context manager.

    ``time`` [s] starts at zero and advances by one step at a time; maps are stamped with it. ``guests``: remote bodies,
    simulated by other nodes. ``watchers``: take part in each step. ``seed``: of the noise of height scans, beside
    their own.
    """

    guests: Guests

    def __init__(
        self,
        terrain: MainMesh | Terrain | None = None,
        config: WorldConfig | None = None,
        stopwatch: Stopwatch | None = None,
    ) -> None:
        self.config = WorldConfig() if config is None else config
        _require_settings(self.config)
        self._terrain = Terrain() if terrain is None else Terrain.of(terrain)
        self.stopwatch = Stopwatch.of(stopwatch)
        self.watchers: list[StepWatcher] = []
        self._rescues = 0  # of the grounds before `restore`
        self.carried: dict[str, Carrier] = {}
        self.lost: dict[str, str] = {}  # why bodies were removed, by name; readers may clear it
        self.seed = 0
        self._first: Terrain | None = None
        self._start()

    def _start(self) -> None:
        """Initialise without bodies, at time zero."""
        self.time = 0.0
        client: Any = BulletClient(pb.DIRECT)
        set_up(client, self.config.physics)
        ground = self._new_ground(client)
        self._begin(client, ground, self.config.physics)
        ground.note_gone = self._note_gone
        self.guests = Guests(self, self.config.guests)
        self.falls = Falls(ground, self.config.falls)
        self._let_sleep()

    def _new_ground(self, client: Any) -> Ground:
        return Ground(client, self.terrain, self.stopwatch)

    def __getstate__(self) -> dict[str, Any]:
        """Return what a copy of the world, or one in another process, is made of: its whole state."""
        return {"state": self._saved()}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Make a world that evolves as one restored from the state."""
        World.__init__(self)
        with undone(self.close):
            self.restore(state["state"])

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def configure(self, config: WorldConfig) -> None:
        """Replace the settings; new friction and restitution apply to later bodies only."""
        _require_settings(config)
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

    def close(self) -> None:
        """Disconnect from PyBullet. What needs a client raises `InputError` from now on."""
        if isinstance(self.client, NoClient):
            return
        if self.client.isConnected():
            self.client.disconnect()
        nobody: Any = NoClient("this world is closed; make another")
        self.client = self.ground = self.falls = self.guests = nobody
        self._factory = BodyFactory(nobody, self.config.physics)

    def update(self) -> None:
        """Do what a step does before physics, see `Ground.update`. Call it while no steps are taken."""
        if self.carried:
            self.bind_decks()
        self.ground.update(self.time, self.dt)
        self._drop_lost()

    def step(self, count: int = 1) -> None:
        """Run physics steps. Raises `InputError` if their number is none."""
        for _ in range(checked_count(count, "steps", "the number of steps")):
            with self.stopwatch.stage("total"):
                self._step()
            self.stopwatch.lap()

    def _step(self) -> None:
        self._note_first_terrain()
        self.guests.advance()
        if self.carried:
            self.bind_decks()
        self._drop_lost()
        for watcher in self.watchers:
            watcher.before_step()
        self._drive_all()
        self.ground.step(self.time, self.dt)
        self.time += self.dt
        for watcher in self.watchers:
            watcher.after_step()
        self.guests.note_contacts()

    def skip(self, steps: int) -> None:
        """Advance the time by some steps without simulating them: the ground moves on, and bodies stay in place. Raises
        `InputError` as `step` does."""
        self.time += checked_count(steps, "steps", "the number of steps") * self.dt

    def periods(self, rate: float) -> int:
        """Return the number of periods of a ``rate`` [Hz] since time zero that are over. Raises `InputError`."""
        require(math.isfinite(as_float(rate)), "parameter", "the rate", rate, "finite [Hz]")
        return math.floor((self.time + ROUNDING * self.dt) * rate)

    def patches(self) -> ShownPatches:
        """Return the patches of ground in reach of the bodies now, without those of remote bodies, which their owners
        publish."""
        return self.ground.find_patches(self.time)

    def contacts(self) -> list[GroundContact]:
        """Return the contacts with the ground in the last step; for tracked bodies, with the ground
        now."""
        return ground_contacts(self.client, self.ground)

    def wrenches(self) -> list[GroundWrench]:
        """Return the wrench of the ground in the last step on each simulated body and link that can touch it."""
        return wrenches_of_step(self.client, self.ground, self.dt)

    def height_scan(self, names: str | Sequence[str], scan: HeightScan) -> FloatArray:
        """Return the values (n, k) of a scan of the ground around n bodies now, of a robot around the frame of its base
        link. Raises `InputError` if there is no body of one of the names, or if the scan has a delay, for which
        `HeightScanner` keeps earlier scans."""
        require_scan(scan)
        if scan.delay:
            raise InputError("height_scan", "World.height_scan scans now; for a delay use a HeightScanner")
        bodies = self.bodies_of(names)
        poses_w = BulletCalls(self.client).poses([body.uid for body in bodies])
        for row, body in enumerate(bodies):
            if body.is_robot:
                poses_w[row] = frame_pose(poses_w[row], body.inertial)
        scan = replace(scan, seed=scan.seed + (self.seed << 64)) if self.seed else scan
        return scan.read(self.terrain, np.column_stack([poses_w[:, :3], yaws_of(poses_w[:, 3:])]), self.time)

    def below_ground(self) -> list[str]:
        """Return simulated bodies and links whose middle is under the ground now."""
        return [self.followers[slot].name for slot in self.ground.contacts.core.find_below()]

    def _drop_lost(self) -> None:
        """Remove lost bodies, and tell of those that begin to fall."""
        line, gone = self.falls.check(self.time)
        if line:
            self.say(line)
        for name, why in gone.items():
            body = self.body(name)
            self._remove(name)
            self._note_lost(body, why)

    def _note_gone(self, follower: Follower) -> None:
        """Forget the body of a follower, which was removed through ``client``."""
        body = self._bodies.get(follower.name.partition("/")[0])
        if body is not None and body.uid == follower.body:
            self._forget(body)
            self._note_lost(body, "was removed through PyBullet")

    def _note_lost(self, body: Body, why: str) -> None:
        if body.owner:
            self.guests.dropped(body.name)
        else:
            self.lost[body.name] = why

    def _let_sleep(self) -> None:
        self.ground.let_sleep(self.config.sleep if self.config.physics.sleep else None)


def _require_settings(config: object) -> None:
    require(isinstance(config, WorldConfig), "parameter", "settings", config, "WorldConfig(physics=..., ...)")
