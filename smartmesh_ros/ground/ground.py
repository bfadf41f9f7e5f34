"""The ground of the bodies of a PyBullet world: the whole product for a PyBullet user."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from smartmesh_ros.core import CORE
from smartmesh_ros.ground.bullet import BulletCalls, is_fixed
from smartmesh_ros.ground.config import require_time_step
from smartmesh_ros.ground.followers import Followers
from smartmesh_ros.ground.saved_bodies import SavedBodies
from smartmesh_ros.ground.shown_patches import ShownPatches
from smartmesh_ros.patches.shapes import BODY_COLUMNS
from smartmesh_ros.terrain.checked_heights import checked_time
from smartmesh_ros.terrain.grid import BoolArray, IntArray
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.surface_query import (
    GroundHits,
    GroundSamples,
    RayCaster,
    checked_points,
    checked_rays,
    ground_samples,
)
from smartmesh_ros.terrain.terrain import Terrain

# Time between two writes of what bodies pressed into the map of their soil [s].
PRINT_PERIOD = 1.0 / 60.0
# Largest horizontal speed that a rescued body keeps [m/s].
FASTEST_RESCUED = 5.0


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
        lifted = _put_back(self._client, self.followers, self.below(self.followers.guarded, time))
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
        none below it."""
        followers, tiles = self.followers, self.terrain.readers
        found: list[tuple[int, float, float]] = CORE.find_below(
            followers.shape_table.core, followers.states, slots, tiles, time
        )
        return found

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


def _put_back(client: Any, followers: Followers, below: list[tuple[int, float, float]]) -> list[int]:
    """Lift the bodies ``below`` the ground (see `Ground.below`) onto it, robots as a whole; returns their PyBullet
    bodies."""
    lifts: dict[int, tuple[float, float]] = {}
    for slot, lift, rate in below:
        body = followers[slot].body
        if body not in lifts or lift > lifts[body][0]:  # a robot by the largest lift of its links
            lifts[body] = (lift, rate)
    for body, (lift, rate) in lifts.items():
        _lift(client, body, lift, rate)
    return list(lifts)


def _lift(client: Any, body: int, lift: float, rate: float) -> None:
    """Lift a body by ``lift`` [m] and give it the ground's vertical velocity ``rate`` [m/s]."""
    position, orientation = client.getBasePositionAndOrientation(body)
    linear, angular = client.getBaseVelocity(body)
    along = np.array(linear[:2])
    speed = float(np.hypot(*along))
    along *= min(1.0, FASTEST_RESCUED / speed) if speed > 0.0 else 1.0
    client.resetBasePositionAndOrientation(body, (position[0], position[1], position[2] + lift), orientation)
    client.resetBaseVelocity(body, (along[0], along[1], rate), angular)


# A tile that is being corrected: its core's reader, and the instant up to which its corrections were shown before [s].
Correction = tuple[Any, float]


def show_corrections(terrain: Terrain, time: float) -> list[Correction]:
    """Blend corrections of the terrain in up to ``time`` [s]; returns the corrected tiles."""
    moves = []
    for mesh in terrain.tiles.values():
        if isinstance(mesh, HeightMap) and mesh.motion.corrects:
            if mesh.corrections.blending:
                moves.append((mesh.core_reader, mesh.corrections.shown))
            mesh.show(time)
    return moves


def move_with_corrections(
    client: Any, corrections: list[Correction], followers: Followers, standing: BoolArray, time: float
) -> None:
    """Move the bodies of a PyBullet client that stand on tiles that are corrected at ``time`` [s].

    A body that lay on the ground lies on it again, at the same velocity. A robot moves as a whole, by the ground under
    the links that stand on it. ``standing`` (S,): which followers touch the ground.
    """
    solid = followers.solid
    bodies = [followers[slot].body for slot in solid.tolist()]
    uids = list(dict.fromkeys(bodies))
    places = {uid: place for place, uid in enumerate(uids)}
    owners = np.array([places[body] for body in bodies], np.int64)
    poses = BulletCalls(client).poses(uids)
    for place in CORE.move_with_corrections(
        corrections, followers.shape_table.core, followers.states, solid, owners, standing, time, poses
    ):
        _put(client, uids[place], poses[place].tolist())


def _put(client: Any, uid: int, pose: list[float]) -> None:
    if is_fixed(client, uid):
        return
    linear, angular = client.getBaseVelocity(uid)
    client.resetBasePositionAndOrientation(uid, pose[:3], pose[3:])
    client.resetBaseVelocity(uid, linear, angular)
