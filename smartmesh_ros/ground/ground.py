"""Colliders that follow bodies: the whole product for a PyBullet user."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from smartmesh_ros.core import CORE
from smartmesh_ros.ground.body_shapes import links_with_shape, shape_of
from smartmesh_ros.ground.bullet_sleep import is_fixed
from smartmesh_ros.ground.colliders.driver import Colliders
from smartmesh_ros.ground.colliders.whole_mesh import WholeMesh
from smartmesh_ros.ground.correction_transport import Correction, CorrectionTransport
from smartmesh_ros.ground.follower_reader import FollowerReader
from smartmesh_ros.ground.followers import Follower, Followers
from smartmesh_ros.ground.proxies import Proxies, missing_for
from smartmesh_ros.ground.selector import Selector
from smartmesh_ros.ground.shapes import Shape
from smartmesh_ros.ground.sleep_config import SleepConfig
from smartmesh_ros.ground.sleeping import Sleeping
from smartmesh_ros.ground.stepper import Stepper, physics_of
from smartmesh_ros.ground.usable import require_usable
from smartmesh_ros.patches.batch import PatchBatch
from smartmesh_ros.patches.config import ANYWHERE, PatchConfig, is_whole
from smartmesh_ros.patches.shapes import BodyShape
from smartmesh_ros.report.methods import require_search_on
from smartmesh_ros.stopwatch import Stopwatch
from smartmesh_ros.terrain.grid import FloatArray, IntArray
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.ray_cast import GroundHits, RayCaster, checked_rays
from smartmesh_ros.terrain.surface_query import GroundSamples, checked_points, ground_samples
from smartmesh_ros.terrain.terrain import MainMesh, Terrain
from smartmesh_ros.terrain.trimesh import TriangleMesh

# Largest gap at which a body at rest touches its ground [m].
TOUCHING = 1e-3
log = logging.getLogger("smartmesh_ros")


class SleepContacts(NamedTuple):
    """Contact points of a body with its ``collider``, a PyBullet body, as PyBullet reported them before the body fell
    asleep."""

    collider: int | None
    points: list[Any]


class Ground:
    """The deforming terrain as ground of the attached bodies of a PyBullet world.

    Contacts come from the map itself. Where that is impossible, because the client is not a DIRECT one, the C++ core
    was not built, or ``config.kind`` asks for it, each body has a small collider of PyBullet's own instead.

    ``client`` is a connected `pybullet_utils.bullet_client.BulletClient` or the module ``pybullet`` itself. `attach`
    bodies, and call `step` in place of ``stepSimulation``. If you call ``stepSimulation`` yourself, contacts come from
    the map all the same; bodies below the ground are then not put back. Call `update` when the terrain got or lost a
    tile, and before each step where there are colliders, or `update` before some steps and `go_on` before the others.
    Bodies that are not attached do not collide with the terrain.
    ``gravity`` [m/s^2]: tells how soon a falling body may touch the ground; `step` reads it from PyBullet.
    """

    def __init__(
        self,
        client: Any,
        terrain: MainMesh | Terrain,
        config: PatchConfig | None = None,
        stopwatch: Stopwatch | None = None,
        *,
        gravity: float = 9.81,
    ) -> None:
        self.config = config or PatchConfig()
        self.terrain = Terrain.of(terrain)
        self.no_proxies = missing_for(client)  # why contacts cannot come from the map, empty if they can
        if self.no_proxies and self.config.kind == "auto":
            log.warning("bodies stand on colliders of PyBullet's own, not on the map itself: %s", self.no_proxies)
        self._require_usable(self.config)
        self.stopwatch = stopwatch or Stopwatch()
        self.followers = Followers()
        self.colliders = Colliders(client, self.followers)
        self.gravity = gravity
        self.stale = True  # the next step needs an update, even if the last one has not expired
        self.time = 0.0  # of the last update [s]
        self._client = client
        self._reader = FollowerReader(client, self.followers)
        self._selector = Selector(self.terrain, self.config, self.stopwatch)
        self._transport = CorrectionTransport(client)
        self._whole = WholeMesh(client, self.terrain)
        self._steps = 1  # lifetime of the last update [steps]
        self._duration = 0.0  # the same [s]
        self._expected_moves: list[tuple[list[int], FloatArray]] = []
        self._sleeping: Sleeping | None = None
        self._tracked_chosen = False  # patches of followers that are not solid are those of the last update
        self._proxies: Proxies | None = None  # None while patches are colliders of PyBullet's own
        self._chosen = True  # the supports are those of the last update

    @property
    def supports(self) -> Any:
        """Supports by slot as of the last update: records of ``SUPPORT`` (S,)."""
        self._choose()
        return self._selector.supports

    @property
    def exact(self) -> bool:
        """True if contacts come from the map itself, by ground proxies."""
        return self._proxies is not None

    def states_of(self, slots: IntArray) -> FloatArray | None:
        """Return the states (n, 13) of attached bodies and links now: position [m], orientation (x, y, z, w), linear
        [m/s] and angular velocity [rad/s] of their centres of mass; NaN for those that are gone. None if contacts are
        not `exact`: PyBullet's calls then read bodies one by one."""
        return None if self._proxies is None else self._proxies.states_of(slots)

    @property
    def batches(self) -> list[PatchBatch]:
        """Patches as of the last update; their bodies are slots of `followers`. Call `choose_tracked` before, if bodies
        were attached with ``solid=False``."""
        self._choose()
        return self._selector.batches()

    def choose_tracked(self) -> None:
        """Compute the patches of the bodies that were attached with ``solid=False``, as of the last update. They are
        not part of `update`, because nothing collides with them."""
        self._choose()
        if not self._tracked_chosen:
            self._tracked_chosen = True
            self._select(self.followers.tracked)

    def at(self, points_w: ArrayLike, time: float) -> GroundSamples:
        """Return the ground under points (N, 2) [m] at ``time`` [s], as bodies stand on it; see `ground_samples`. With
        points (N, 3), ground above a point does not count. Raises `InputError`."""
        return ground_samples(self.terrain, checked_points(points_w), time)

    def cast_rays(self, origins_w: ArrayLike, directions_w: ArrayLike, reach: float, time: float) -> GroundHits:
        """Return where rays from ``origins_w`` (N, 3) [m] along ``directions_w`` (N, 3) meet the ground at ``time``
        [s], within ``reach`` [m]. Raises `InputError`."""
        return self.rays.cast(checked_rays(origins_w, directions_w, reach), time)

    @cached_property
    def rays(self) -> RayCaster:
        """Casts rays onto this ground."""
        return RayCaster(self.terrain)

    def will_move(self, slots: list[int], moved_w: FloatArray) -> None:
        """Set the motion of attached bodies (n,) in the next step (n, 3) [m] if it differs from their motion in the
        last one."""
        self._expected_moves.append((slots, moved_w))

    def placed(self, body: int | None = None) -> None:
        """Note that a body (None = every body) was teleported, so that this jump does not count as its motion."""
        self.wake(body)
        self.stale = True

    @property
    def replacements(self) -> int:
        """Number of colliders whose surface was changed so far."""
        return self.colliders.replacements + self.colliders.built

    @property
    def leaked(self) -> int:
        """Number of colliders that were rebuilt so far; PyBullet leaks a few KiB for each."""
        return self.colliders.built

    def let_sleep(self, may_sleep: Callable[[int], bool] | None, config: SleepConfig | None = None) -> None:
        """Put bodies at rest to sleep from now on, without colliders, if ``may_sleep`` returns True for the PyBullet
        body; None = wake all, and let none sleep. Whoever pushes a body by other means than PyBullet's contacts must
        `wake` it before."""
        if self._sleeping is not None:
            self._sleeping.wake_all()
            self._sleeping, self.stale = None, True
        if may_sleep is not None:
            self._sleeping = Sleeping(
                self._client, self.followers, self.terrain, config or SleepConfig(), may_sleep=may_sleep,
                release=self._release_for_sleep,
            )  # fmt: skip
            self._sleeping.reserve(self.followers.capacity)
            for follower in self.followers:
                self._sleeping.add(follower.slot)

    def wake(self, body: int | None = None) -> None:
        """Wake a body, or all (None), with what it may touch."""
        if self._sleeping is not None:
            if body is None:
                self._sleeping.wake_all()
            else:
                self._sleeping.wake(np.array(self.followers.of(body), np.int64))
            self.stale = True

    def keep_awake(self, slots: IntArray) -> None:
        """Wake followers, and let them sleep only after a while without another call."""
        if self._sleeping is not None:
            self._sleeping.wake(slots)

    @property
    def contacts_asleep(self) -> dict[int, SleepContacts]:
        """By slot: the contacts of sleeping bodies with their colliders, in the last step before they fell asleep."""
        return {} if self._sleeping is None else self._sleeping.contacts

    def attach(
        self,
        body: int,
        link: int | None = None,
        *,
        radius: float | None = None,
        solid: bool = True,
        shape: Shape | BodyShape | None = None,
    ) -> Follower:
        """Put a patch under each link of ``body`` that has a collision shape, or under one ``link`` (-1 = the base).

        Shapes are read from PyBullet, unless the base's or link's is given: as a ``shape`` about the centre of mass (or
        one that was read before), or as the ``radius`` [m] of a bounding sphere. ``solid=False`` computes patches
        without colliders. Returns the follower of the link, or of the first one; ``followers.of(body)`` lists all.
        Raises `InputError`, and attaches nothing, if a link has no shape or is attached already.
        """
        if link is not None or radius is not None or shape is not None:
            links = [-1 if link is None else link]
        else:
            links = links_with_shape(self._client, body)
        records = [shape_of(self._client, body, each, shape, radius) for each in links]
        made = [Follower(body, each, record, solid) for each, record in zip(links, records, strict=True)]
        self.followers.require_new(body, links)
        own = solid and not is_fixed(self._client, body)
        if self._proxies is None:
            self._use_proxies(self.time, float(self._client.getPhysicsEngineParameters()["fixedTimeStep"]))
        for follower in made:
            self.followers.add(follower, own=own)
            self._reserve()
            if self._proxies is not None:
                self._proxies.attach(follower)
            if self._sleeping is not None:
                self._sleeping.add(follower.slot)
        if self._proxies is not None:
            self._proxies.use(self.terrain)
        self.stale = True
        return made[0]

    def _reserve(self) -> None:
        """Make room for all slots in the tables."""
        slots = self.followers.capacity
        self._selector.reserve(slots)
        if self._sleeping is not None:
            self._sleeping.reserve(slots)

    def detach(self, body: int) -> None:
        """Remove the patches of ``body`` and its links. Call it before the body is removed from PyBullet."""
        for slot in list(self.followers.of(body)):
            if self._sleeping is not None:
                self._sleeping.remove(slot)
            if self._proxies is not None:
                self._proxies.detach(slot)
            self.colliders.release(self.followers[slot])
            self._selector.remove(slot)
            self.followers.remove(slot)
        self.stale = True

    def configure(self, config: PatchConfig, *, gravity: float | None = None) -> None:
        """Replace the settings of patches, and ``gravity`` [m/s^2] unless it is None, from the next update on. Bodies
        may rest on patches meanwhile. Raises `InputError` and changes nothing if the terrain does not allow the
        settings."""
        self._require_usable(config)
        self.wake()
        self.stale = True
        self.config = config
        self._selector.configure(config)
        if gravity is not None:
            self.gravity = gravity

    def step(self, time: float, dt: float) -> None:
        """Run one ``stepSimulation`` of ``dt`` [s] from ``time`` [s] on, as `World` does.

        Refreshes the patches when they are due, and puts bodies that are below the ground back onto it. Raises
        `InputError` if ``dt`` is not PyBullet's time step.
        """
        physics = physics_of(self._client, dt)
        self.gravity = math.hypot(*physics.gravity)
        self.stepper.prepare(time, physics)
        with self.stopwatch.stage("step"):
            self._client.stepSimulation()

    @property
    def rescues(self) -> int:
        """Number of bodies that `step` found below the ground and put back onto it so far."""
        return self.stepper.counts.rescues

    def update(self, time: float, dt: float, steps: int = 1) -> None:
        """Refresh every patch at ``time`` [s], for the next ``steps`` steps of ``dt`` [s]."""
        followers, sleeping = self.followers, self._sleeping
        self._use_proxies(time, dt)
        with self.stopwatch.stage("bodies"):
            corrections = self._show_corrections(time)
            if sleeping is not None:
                sleeping.gravity = self.gravity
                sleeping.wake_on_changed_ground(time, dt * steps)
                sleeping.wake_moved(dt * steps)
            self._move_with_corrections(corrections, time)
            self._read_states(dt)
            if sleeping is not None and followers.awake.size:
                sleeping.note_motion(time)
                if sleeping.wake_reached(time, 0.0):
                    sleeping.note_motion(time)
                sleeping.put_to_sleep(time, dt, steps)
        self.stale, self._steps, self.time, self._duration = False, steps, time, dt * steps
        self._chosen = self._tracked_chosen = False
        if self._proxies is not None:
            self._proxies.use(self.terrain)
            if sleeping is not None:
                self._proxies.hold(sleeping.stopping)
        elif followers.awake.size:
            self._require_usable(self.config)
            self._choose()
            with self.stopwatch.stage("collider"):
                self._apply(time)

    def go_on(self, time: float, dt: float) -> bool:
        """Let the patches of the last `update` move on for a further step of ``dt`` [s]. Wakes sleeping bodies that
        something may touch in this step. Returns True if it needed an `update`."""
        if self.stale:
            self.update(time, dt, self._steps)
            return True
        if not self.followers.awake.size:
            return False
        return self._wake_on_the_way(time, dt)

    def _wake_on_the_way(self, time: float, dt: float) -> bool:
        """Wake sleeping bodies that something may touch in the step from ``time`` [s] on; returns True if there were
        any."""
        if self._proxies is not None:
            if any(isinstance(mesh, HeightMap) and mesh.correcting for mesh in self.terrain.tiles.values()):
                self.update(time, dt, self._steps)  # bodies move with the ground in every step of a correction
                return True
            self._proxies.set_time(time, dt)
        sleepers = self._sleeping if self.followers.asleep.size else None
        if sleepers is None and not self.followers.has_remote:
            return False
        with self.stopwatch.stage("bodies"):
            self._read_positions()
            woken = sleepers is not None and sleepers.wake_reached(time, time - self.time)
        if woken:
            self.update(time, dt, self._steps)
        return woken

    def below(self, slots: IntArray, time: float) -> list[tuple[int, float, float]]:
        """Return those followers in ``slots`` (n,) whose middle is below the ground: the slot, the depth of its lowest
        point [m], and the ground's vertical velocity [m/s]. Ground of meshes above a middle counts only where there is
        none below it."""
        followers, tiles = self.followers, self.terrain.readers
        found: list[tuple[int, float, float]] = CORE.find_below(
            followers.shape_table.core, followers.states, slots, tiles, time
        )
        return found

    def _wants_proxies(self, config: PatchConfig) -> bool:
        return not self.no_proxies and config.kind == "auto"

    def require_usable(self, mesh: MainMesh, config: PatchConfig | None = None) -> None:
        """Raise `InputError` if a mesh cannot be ground with these settings, or the present ones (None). Contacts come
        from every mesh; only the search for a patch that is shown may not work on it."""
        config = config or self.config
        if not self._wants_proxies(config):
            require_usable(config, mesh)
        elif isinstance(mesh, TriangleMesh) and config.search not in ANYWHERE:
            require_search_on(config.search, mesh.shape)

    def _require_usable(self, config: PatchConfig) -> None:
        for mesh in self.terrain.tiles.values():
            self.require_usable(mesh, config)

    def _use_proxies(self, time: float, dt: float) -> None:
        """Switch between ground proxies and colliders of PyBullet's own as the settings and the terrain ask for."""
        wanted = self._wants_proxies(self.config)
        if wanted and self._proxies is None:
            for follower in self.followers:
                self.colliders.release(follower)
            self._whole.release()
            self._proxies = Proxies(self._client, self.followers, time=time, dt=dt)
            for follower in self.followers:
                self._proxies.attach(follower)
        elif not wanted and self._proxies is not None:
            self._proxies.close()
            self._proxies = None
            for follower in self.followers:
                follower.collider = None
        if self._proxies is not None:
            self._proxies.set_time(time, dt)
            self._proxies.carry_velocity(on=self.config.carry_velocity)

    def _choose(self) -> None:
        """Choose the ground under the bodies, if that was not done since the last update. Contacts from the map do not
        need it; messages do."""
        if self._chosen:
            return
        self._chosen = True
        solid, supports = self.followers.solid, self._selector.supports
        self._select(solid)
        if self._proxies is not None:  # show the ground that a body can touch
            states, radii = self.followers.states[solid], self.followers.radii[solid]
            found = supports[solid]
            ground = np.stack([found["slide_x"], found["slide_y"], found["rise"]], axis=1)
            speeds = np.linalg.norm(states[:, 7:10] - ground, axis=1) + radii * np.linalg.norm(states[:, 10:], axis=1)
            moved = speeds * self._duration + 0.5 * self.gravity * self._duration**2
            self._selector.let_go(solid, moved + TOUCHING)

    def _select(self, slots: IntArray) -> None:
        """Select the patches of followers as of the last update."""
        followers = self.followers
        self._selector.update(slots, followers.shape_table, followers.states, self.time, self._duration)

    def stand_still(self, duration: float) -> None:
        """Note that time advanced by ``duration`` [s] without a step; the next step needs an `update`."""
        if self._sleeping is not None:
            if duration < 0.0:  # the clock was set back
                self._sleeping.wake_all()
            self._sleeping.keep_awake()
        self.time += duration
        self.stale = True

    def close(self) -> None:
        """Remove all colliders."""
        for follower in list(self.followers):
            self.detach(follower.body)
        self._whole.release()
        if self._proxies is not None:
            self._proxies.close()

    @cached_property
    def stepper(self) -> Stepper:
        """The stepper of `step`; a `World` calls it with its own settings."""
        return Stepper(self._client, self)

    def _release_for_sleep(self, slots: IntArray) -> dict[int, SleepContacts]:
        """Take their colliders from followers that fall asleep, and return the contacts of these by slot."""
        active = [slot for slot in slots.tolist() if self.followers[slot].collider is not None]
        released = {self.followers[slot].collider: slot for slot in active}
        points: dict[int, list[Any]] = {slot: [] for slot in active}
        # All points are read, because PyBullet swaps the bodies of a point to fit a filter, but not its friction.
        for point in self._client.getContactPoints():
            slot = released.get(point[1], released.get(point[2]))
            if slot is not None:
                points[slot].append(point)
        contacts = {slot: SleepContacts(self.followers[slot].collider, points[slot]) for slot in active}
        if self._proxies is None:
            for slot in active:
                self.colliders.release(self.followers[slot])
        return contacts

    def _show_corrections(self, time: float) -> list[Correction]:
        """Blend corrections of the ground in up to ``time`` [s]; returns the corrected tiles."""
        moves = []
        for name, mesh in self.terrain.tiles.items():
            if isinstance(mesh, HeightMap) and mesh.motion.corrects:
                correcting, before = mesh.correcting, mesh.shown
                mesh.show(time)
                if correcting:
                    moves.append(Correction(self.terrain.numbers[name], mesh, before))
        return moves

    def _move_with_corrections(self, moves: list[Correction], time: float) -> None:
        """Move the bodies on or near the corrected ground with it."""
        if moves and len(self.followers):
            self._read_states(0.0)
            self._transport.move_bodies(moves, self.followers, self.supports, time)

    def _apply(self, time: float) -> None:
        """Set the colliders to the current supports."""
        if is_whole(self.config.kind):
            self._whole.update(self.config.kind, time)
        else:
            self._whole.release()
        self.colliders.apply(self._selector.batches(), self.supports, carry=self.config.carry_velocity)

    def _read_states(self, dt: float) -> None:
        if self._proxies is not None:
            self._proxies.read_states(dt)
        else:
            self._reader.read_states(dt)
        self._expected_moves.clear()

    def _read_positions(self) -> None:
        if self._proxies is not None:
            self._proxies.read_positions()
        else:
            self._reader.read_positions()
        for slots, moved_w in self._expected_moves:
            self.followers.moved_w[slots] = moved_w
        self._expected_moves.clear()
