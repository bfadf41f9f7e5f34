"""The ground of the bodies of a PyBullet world: the whole product for a PyBullet user."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from smartmesh_ros.core import CORE
from smartmesh_ros.ground.body_shapes import require_body
from smartmesh_ros.ground.config import require_time_step
from smartmesh_ros.ground.moved_bodies import move_with_corrections, put_back, show_corrections
from smartmesh_ros.ground.saved_bodies import SavedBodies
from smartmesh_ros.ground.shown_patches import ShownPatches
from smartmesh_ros.patches.shapes import BODY_COLUMNS
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

# Time between two writes of what bodies pressed into the map of their soil [s].
PRINT_PERIOD = 1.0 / 60.0


class Ground(SavedBodies):
    """The deforming terrain as ground of the attached bodies of a PyBullet world.

    Contacts come from the map itself, in each step of PyBullet. ``client`` is a connected
    `pybullet_utils.bullet_client.BulletClient`, the module ``pybullet`` itself, or the number of a client; its server
    runs in this process, with a window or without. `attach` bodies, and call `step` in place of ``stepSimulation``.
    Bodies that are not attached do not collide with the terrain. Raises `InputError` for a client of a server
    elsewhere, and if the client has a ground already.

    ``time`` [s]: of the last update. ``rescues``: how often bodies were put back onto the ground. ``followers``: the
    attached bodies by slot; ``patches``: the ground under them, for messages; ``contacts``: how they collide.
    """

    def step(self, time: float, dt: float) -> None:
        """`update` for one ``stepSimulation`` of ``dt`` [s] from ``time`` [s] on, and run it. Raises `InputError` if
        ``dt`` is not PyBullet's time step."""
        require_time_step(self._client, dt)
        self.update(time, dt)
        with self.stopwatch.stage("step"):
            self._client.stepSimulation()

    def update(self, time: float, dt: float) -> None:
        """Do what the next step of ``dt`` [s] from ``time`` [s] on needs beside contacts, if you call
        ``stepSimulation`` yourself: take tiles that came or went, move bodies with corrections of maps, put bodies that
        are below the ground back onto it, let bodies fall asleep, write what they pressed into the map of their soil,
        and draw what is shown."""
        time = checked_time(time)
        self.check_soil()
        contacts, followers = self.contacts, self.followers
        contacts.set_time(time, dt)
        self._drop_gone()
        self.time = time
        with self.stopwatch.stage("bodies"):
            contacts.settle(self._may_sleep)
            corrections = show_corrections(self.terrain, time)
            if corrections and len(followers):
                contacts.read(followers.states)
                move_with_corrections(self._client, corrections, followers, contacts.touching(), time)
            contacts.read(followers.states)
            self.rescue(time)
        if self.soil is not None and not 0.0 <= time - self._printed < PRINT_PERIOD:
            self._printed = time
            self.soil.show()
        if self._shown is not None:
            self._shown.refresh(time)

    def rescue(self, time: float) -> None:
        """Put bodies that are below the ground at ``time`` [s] back onto it: that were spawned or teleported there,
        covered by a map, or pushed there by another body. This is the last resort, and its ``rescues`` are counted."""
        lifted = put_back(self._client, self.followers, self.below(self.followers.guarded, time))
        self.rescues += len(lifted)
        for body in lifted:
            self.wake(body)
        if lifted:
            self.contacts.read(self.followers.states)

    def find_patches(self, time: float) -> ShownPatches:
        """Return the patches of the bodies as they are now, on the ground at ``time`` [s]."""
        slots = np.flatnonzero(self.followers.table["alive"])
        states = np.full((self.followers.capacity, BODY_COLUMNS), np.nan)
        states[slots] = self.contacts.states_of(slots)
        self.patches.find(states, time)
        return self.patches

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
        each step, and stays awake with it. Raises `InputError` if there is no such deck, body or link.
        """
        it = self.terrain.deck(deck)
        if body is not None:
            require_body(self._client, body, None if link < 0 else link)
        it.ride(-1 if body is None else body, link, position, orientation)

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
