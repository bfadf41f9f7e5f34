"""The ground of the bodies of a PyBullet world: the whole product for a PyBullet user."""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from smartmesh_ros.core import CORE
from smartmesh_ros.ground.attached_bodies import AttachedBodies
from smartmesh_ros.ground.body_shapes import require_body
from smartmesh_ros.ground.config import gravity_of
from smartmesh_ros.ground.moved_bodies import correcting, move_with_corrections, put_back, show_corrections
from smartmesh_ros.terrain.checked_heights import checked_time
from smartmesh_ros.terrain.deck import LEVEL
from smartmesh_ros.terrain.grid import IntArray
from smartmesh_ros.terrain.surface_query import (
    GroundHits,
    GroundSamples,
    RayCaster,
    checked_points,
    checked_rays,
    ground_samples,
)
from smartmesh_ros.terrain.terrain import Terrain

# Wait up to MAP_WAIT map intervals for the next map, if the refresh then comes within LONGEST_LIFE refresh intervals.
# Refreshing just before a map arrives would do the work twice.
MAP_WAIT, LONGEST_LIFE = 1.25, 1.5
# Shortest lifetime of patches if maps arrive faster [refresh intervals]. Ignored for the first FIRST_MAPS maps, because
# two maps are needed to estimate the ground's velocity.
SHORTEST_LIFE, FIRST_MAPS = 0.5, 4


class UpdateSchedule:
    """Decides before each step whether patches must be refreshed: with new maps, and no more often than a refresh is
    worth.

    Between refreshes PyBullet moves the colliders with the ground's velocity, and a support covers the predicted motion
    of its body. A support that is one step old is therefore nearly as good as a new one, but a refresh costs as much as
    a physics step.
    """

    def __init__(self) -> None:
        self._age = 0  # steps since the last refresh
        self._lifetime, self._lifetime_if_map = 0, 0  # steps until the next refresh; the same if a map arrives
        self._maps = 0  # successive refreshes that a map triggered
        self._revision, self._layout = -1, -1  # of the terrain at the last refresh

    def due(self, terrain: Terrain, *, behind_real_time: bool = False) -> bool:
        """Return True if the patches must be refreshed: they expired, or the terrain changed. If the world is
        ``behind_real_time``, new maps of the same tiles do not trigger a refresh."""
        self._age += 1
        if self._age >= self._lifetime or terrain.layout_revision != self._layout:
            return True
        return self._age >= self._lifetime_if_map and not behind_real_time and terrain.changed_since(self._revision)

    def begin(self, terrain: Terrain, time: float, dt: float, rate: float, *, behind_real_time: bool = False) -> int:
        """Note a refresh at ``time`` [s] and return its lifetime in steps of ``dt`` [s]: the interval of ``rate`` [Hz]
        (0 = one step), or the time until the next map if that is about as long. If the world is ``behind_real_time``,
        the lifetime is at least one interval."""
        self._maps = self._maps + 1 if terrain.changed_since(self._revision) else 0
        self._revision, self._layout = terrain.revision, terrain.layout_revision
        steps = max(round(1.0 / (rate * dt)), 1) if rate else 1
        self._lifetime_if_map = -int(-SHORTEST_LIFE * steps // 1) if self._maps >= FIRST_MAPS else 1
        if steps > 1:
            lifetimes = [mesh.lifetime for mesh in terrain.tiles.values() if mesh.lifetime > 0.0 and mesh.moving(time)]
            if lifetimes:
                wait = max(round(MAP_WAIT * min(lifetimes) / dt), steps if behind_real_time else self._lifetime_if_map)
                steps = wait if wait <= LONGEST_LIFE * steps else steps
        self._age, self._lifetime = 0, steps
        return steps


class Ground(AttachedBodies):
    """The deforming terrain as ground of the attached bodies of a PyBullet world.

    Contacts come from the map itself. Where that is impossible, because the client's server runs in another process,
    or ``config.kind`` asks for it, each body has a small collider of
    PyBullet's own instead; ``no_proxies`` tells why, empty if contacts can come from the map.

    ``client`` is a connected `pybullet_utils.bullet_client.BulletClient` or the module ``pybullet`` itself. `attach`
    bodies, and call `step` in place of ``stepSimulation``. If you call ``stepSimulation`` yourself, contacts come from
    the map all the same; bodies below the ground are then not put back. Call `update` when the terrain got or lost a
    tile, and before each step where there are colliders, or `update` before some steps and `go_on` before the others.
    Bodies that are not attached do not collide with the terrain.
    ``gravity`` [m/s^2]: tells how soon a falling body may touch the ground; `step` reads it from PyBullet.
    ``time`` [s]: of the last update. ``refreshes``, ``rescues``: refreshes so far, and bodies put back onto the ground.
    ``followers``: the attached bodies by slot; ``patches``: the ground under them; ``contacts``: how they collide.
    """

    def step(self, time: float, dt: float) -> None:
        """Run one ``stepSimulation`` of ``dt`` [s] from ``time`` [s] on, as `World` does.

        Puts bodies that are below the ground back onto it. Raises `InputError` if ``dt`` is not PyBullet's time step.
        """
        self.gravity = gravity_of(self._client, dt)
        if self.prepare(time, dt):
            self.rescue(time, dt)
        with self.stopwatch.stage("step"):
            self._client.stepSimulation()

    def prepare(self, time: float, dt: float, *, behind_real_time: bool = False) -> bool:
        """Do what the step of ``dt`` [s] from ``time`` [s] on needs; returns True if it was a `refresh`, which is done
        with new maps and at the rate of the patches. ``behind_real_time``: as in `UpdateSchedule.begin`."""
        if self._stale or self._schedule.due(self.terrain, behind_real_time=behind_real_time):
            self.refresh(time, dt, behind_real_time=behind_real_time)
            return True
        self.refreshes += self.go_on(time, dt)
        return False

    def refresh(self, time: float, dt: float, *, behind_real_time: bool = False) -> None:
        """`update` for as many steps of ``dt`` [s] from ``time`` [s] on as the schedule allows."""
        time = checked_time(time)
        self.refreshes += 1
        if self.soil is not None:
            self.soil.show()
        rate = self.config.rate
        steps = self._schedule.begin(self.terrain, time, dt, rate, behind_real_time=behind_real_time)
        self.update(time, dt, steps)

    def update(self, time: float, dt: float, steps: int = 1) -> None:
        """Read the bodies at ``time`` [s], and do what holds for the next ``steps`` steps of ``dt`` [s]: move bodies
        with corrections of the ground, wake and put to sleep, take the terrain's tiles, replace colliders."""
        time = checked_time(time)
        self.check_soil()
        if self.terrain.decks:
            self._require_map("deck", "there are decks")
        duration, contacts = dt * steps, self.contacts
        self._stale = True  # until the end: an update that failed is made again before the next step
        contacts.set_time(time, dt)
        self._drop_gone()
        with self.stopwatch.stage("bodies"):
            contacts.settle(self._may_sleep)
            corrections = show_corrections(self.terrain, time)
            if corrections and len(self.followers):
                contacts.read(self.followers.states, 0.0)
                move_with_corrections(self._client, corrections, self.followers, self.patches.supports, time)
            contacts.read(self.followers.states, dt)
        self._steps, self.time = steps, time
        fall = 0.5 * self.gravity * duration**2 if contacts.exact else math.inf
        self.patches.begin(time, duration, fall)
        if not contacts.exact:
            self._require_usable(self.config)
            contacts.refresh()
        self._draw(time)
        self._stale = False

    def go_on(self, time: float, dt: float) -> bool:
        """Go on from the last `update` for a further step of ``dt`` [s] from ``time`` [s] on. Returns True if it needed
        an `update`."""
        time = checked_time(time)
        if not (self._stale or self._must_update(time, dt)):
            self._draw(time)
            return False
        self.update(time, dt, self._steps)
        return True

    def _draw(self, time: float) -> None:
        if self._shown is not None:
            self._shown.refresh(time)

    def _must_update(self, time: float, dt: float) -> bool:
        followers, contacts = self.followers, self.contacts
        if not len(followers):
            return False
        if contacts.exact and any(correcting(mesh) for mesh in self.terrain.tiles.values()):
            return True  # bodies move with the ground in every step of a correction
        contacts.set_time(time, dt)
        contacts.note_sleep()
        if followers.has_remote:
            with self.stopwatch.stage("bodies"):
                contacts.read(np.empty_like(followers.states), dt)
        return False

    def stand_still(self, duration: float) -> None:
        """Note that time advanced by ``duration`` [s] without a step; the next step needs an `update`."""
        self.time += duration
        self._stale = True

    def rescue(self, time: float, dt: float) -> None:
        """Put bodies that are below the ground at ``time`` [s] back onto it: that were spawned or teleported there,
        covered by a map, or pushed there by another body. This is the last resort, and its ``rescues`` are counted."""
        lifted = put_back(self._client, self.followers, self.below(self.followers.guarded, time))
        self.rescues += len(lifted)
        for body in lifted:
            self.wake(body)
        if lifted:
            self.go_on(time, dt)

    def below(self, slots: IntArray, time: float) -> list[tuple[int, float, float]]:
        """Return those followers in ``slots`` (n,) whose middle is below the ground: the slot, the depth of its lowest
        point [m], and the ground's vertical velocity [m/s]. Ground of meshes above a middle counts only where there is
        none below it, that of decks as far as they are thick. Nobody is below a deck that he carries."""
        followers, terrain = self.followers, self.terrain
        found: list[tuple[int, float, float]] = []
        bodies = np.array([followers[slot].body for slot in slots.tolist()], np.int64) if terrain.decks else None
        carriers = [-1, *{deck.body for deck in terrain.decks.values() if deck.body >= 0}]
        for carrier in carriers:
            chosen = slots
            if bodies is not None:
                chosen = slots[bodies == carrier] if carrier >= 0 else slots[~np.isin(bodies, carriers)]
            tiles = terrain.readers_for(carrier) if carrier >= 0 else terrain.readers
            found += CORE.find_below(followers.shape_table.core, followers.states, chosen, tiles, time)
        return found

    def carry(
        self,
        deck: str,
        body: int | None,
        link: int = -1,
        position: ArrayLike = (0.0, 0.0, 0.0),
        orientation: ArrayLike = LEVEL,
    ) -> None:
        """Let a PyBullet ``body``, or its ``link``, carry a deck of the terrain from now on; None = nobody, and the
        deck stays where it is.

        ``position`` [m], ``orientation`` (x, y, z, w): of the deck's frame in that of the centre of mass. The body does
        not touch the deck itself. A body that physics moves takes the reaction of what is on the deck, at the end of
        each step, and stays awake with it. Raises `InputError` if there is no such deck, body or link, or contacts do
        not come from the map.
        """
        it = self.terrain.deck(deck)
        self._require_map("deck", "a body carries a deck")
        if body is not None:
            require_body(self._client, body, None if link < 0 else link)
        it.ride(-1 if body is None else body, link, position, orientation)
        self._stale = True

    def at(self, points_w: ArrayLike, time: float) -> GroundSamples:
        """Return the ground under points (N, 2) [m] at ``time`` [s], as bodies stand on it; see `ground_samples`. With
        points (N, 3), ground above a point does not count. Raises `InputError`."""
        return ground_samples(self.terrain, checked_points(points_w), time)

    def cast_rays(self, origins_w: ArrayLike, directions_w: ArrayLike, reach: float, time: float) -> GroundHits:
        """Return where rays from ``origins_w`` (N, 3) [m] along ``directions_w`` (N, 3) meet the ground at ``time``
        [s], within ``reach`` [m]. Raises `InputError`."""
        return self.rays.cast(checked_rays(origins_w, directions_w, reach), time)

    @cached_property
    def _schedule(self) -> UpdateSchedule:
        return UpdateSchedule()

    @cached_property
    def rays(self) -> RayCaster:
        """Casts rays onto this ground."""
        return RayCaster(self.terrain)
