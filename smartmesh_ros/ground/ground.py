"""The ground of the bodies of a PyBullet world: the whole product for a PyBullet user."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from smartmesh_ros.ground.body_shapes import require_body
from smartmesh_ros.ground.saved_bodies import SavedBodies
from smartmesh_ros.ground.shown_patches import ShownPatches
from smartmesh_ros.terrain.checked_heights import checked_time
from smartmesh_ros.terrain.deck import LEVEL
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

    Contacts come from the map itself, in each step of PyBullet, whoever calls it. ``client`` is a connected
    `pybullet_utils.bullet_client.BulletClient`, the module ``pybullet`` itself, or the number of a client; its server
    runs in this process, with a window or without. `attach` bodies, and call `step` in place of ``stepSimulation``.
    Bodies that are not attached do not collide with the terrain. Raises `InputError` for a client of a server
    elsewhere, and if the client has a ground already.

    ``followers``: the attached bodies by slot; ``patches``: the ground under them, for messages; ``contacts``: how they
    collide.
    """

    def step(self, time: float, dt: float) -> None:
        """Run one ``stepSimulation`` of ``dt`` [s] from ``time`` [s] on. Raises `InputError` if PyBullet has another
        time step. A time step that was set since the last step is noticed one step late: asking PyBullet costs 2.5 us.

        A ``stepSimulation`` of your own does the same, from where the last step ended: bodies move with corrections of
        maps and are lifted out of ground that covers them, sleeping ones wake, bodies at rest fall asleep. What is
        written and drawn (prints in the map of a soil, the ground that is shown) waits for a `step` or `update`.
        """
        self._begin(time, dt)
        with self.stopwatch.stage("step"):
            self._calls.step()

    def update(self, time: float, dt: float) -> None:
        """Do what `step` does before PyBullet's step of ``dt`` [s] from ``time`` [s] on, and no step: for a world that
        stands still while its ground does not."""
        self._begin(time, dt)
        self.contacts.core.update()

    def _begin(self, time: float, dt: float) -> None:
        """Set the time of the next step, and do what waits for a call."""
        time = checked_time(time)
        if self.soil is not None:
            self.check_soil()
        if self.contacts.begin(time, dt):
            self.drop_gone()
        if self.soil is not None and not 0.0 <= time - self._printed < PRINT_PERIOD:
            self._printed = time
            self.soil.show()
        if self._shown is not None:
            self._shown.refresh(time)

    def find_patches(self, time: float) -> ShownPatches:
        """Return the patches of the bodies as they are now, on the ground at ``time`` [s]."""
        self.patches.find(self.contacts.states_of(np.arange(self.followers.capacity)), checked_time(time))
        return self.patches

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
        not touch the deck itself. A body that physics moves takes the reaction of what is on the deck, in the same
        step. Raises `InputError` if there is no such deck, body or link.
        """
        it = self.terrain.deck(deck)
        if body is not None:
            require_body(self._client, body, link)
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
