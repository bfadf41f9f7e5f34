"""The ground in reach of each attached body, as messages show it to viewers and other simulators."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.core import CORE
from smartmesh_ros.ground.bullet import NoClient
from smartmesh_ros.ground.followers import Followers
from smartmesh_ros.stopwatch import Stopwatch
from smartmesh_ros.terrain.deck import name_of_tile
from smartmesh_ros.terrain.grid import FloatArray, IntArray
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.terrain import Terrain
from smartmesh_ros.terrain.tiles import Tiles

# Time in which a body may come to ground that its patch has [s]: that between two messages at 60 Hz.
AHEAD = 1.0 / 60.0
# Largest distance from the body that a patch has for its speed [m], because a teleported body has no real speed.
FARTHEST = 50.0 * AHEAD


@dataclass(frozen=True, kw_only=True, eq=False)
class PatchTable:
    """Patches of n bodies.

    ``slots``, ``tiles`` (n,): of the bodies, and the names of the tiles, those of decks as ``deck`` or ``deck/tile``.
    ``is_mesh`` (n,): of a general mesh, or of a deck, whose samples are no grid in the world. ``rows``, ``columns``
    (n,): the sample in the middle; on a general mesh row 0 and the vertex in the middle. ``stride`` (n,):
    samples of the map from one point to the next. ``counts``, ``triangle_counts`` (n,): numbers of points and
    triangles. ``revisions`` (n,): change with the patches. ``motion`` (n, 6): velocity [m/s] and angular velocity
    [rad/s] of the ground in the middle. ``points_w`` (N, 3) [m]: of all patches, one after the other; z is NaN in
    holes. ``triangles`` (T, 3): corners among the points of each patch, without those at holes.
    """

    slots: IntArray
    tiles: list[str]
    is_mesh: NDArray[np.bool_]
    rows: IntArray
    columns: IntArray
    stride: IntArray
    counts: IntArray
    triangle_counts: IntArray
    revisions: IntArray
    motion: FloatArray
    points_w: FloatArray
    triangles: NDArray[np.int32]

    def __len__(self) -> int:
        return len(self.slots)


class ShownPatches:
    """The patches of all followers but remote ones, whose owners show them."""

    def __init__(self, terrain: Terrain, followers: Followers, stopwatch: Stopwatch) -> None:
        self.slots: IntArray = np.empty(0, np.int64)  # of the bodies that have a patch
        self._terrain, self._followers, self._stopwatch = terrain, followers, stopwatch
        self._core = CORE.Patches(terrain.core)

    def __reduce__(self) -> tuple[type[NoClient], tuple[str]]:
        """Return what takes the place of a copy, as for the ground itself."""
        return NoClient, ("these patches are a copy, and PyBullet's world cannot be copied: copy patches.table()",)

    def find(self, states: FloatArray, time: float) -> None:
        """Find the patches of bodies with ``states`` (S, 13) at ``time`` [s]. Cells are found by grid traversal, and
        their samples taken from a cache while neither body nor ground changed."""
        there = np.asarray(np.isfinite(states).all(axis=1))
        there[[follower.slot for follower in self._followers if follower.remote]] = False
        slots = np.flatnonzero(there)
        found = [self._followers[slot] for slot in slots.tolist()]
        bodies = np.full(len(states), -1, np.int64)  # that may carry decks, which they do not touch
        if self._terrain.decks:
            bodies[slots] = [follower.body for follower in found]
        tracked = np.zeros(len(states), bool)
        tracked[[follower.slot for follower in found if not follower.solid]] = True
        with self._stopwatch.stage("search"):
            self._core.search([it.shape for it in found], states, slots, tracked, bodies, time, AHEAD, FARTHEST)
        with self._stopwatch.stage("collect"):
            self.slots = self._core.collect(slots, time)

    def markers(
        self, slots: IntArray, ids: IntArray, gone: IntArray, stamp: tuple[int, int], frame: str, namespace: str,
        colour: tuple[float, float, float, float], lift: float, *, clear: bool = False,
    ) -> bytes:  # fmt: skip
        """Return the bytes of a MarkerArray: the triangles in reach of the bodies in ``slots`` (n,) under their ``ids``
        (n,), ``lift`` [m] above the ground, and the end of markers with the ids ``gone`` (m,). ``clear``: all other
        markers of the namespace end."""
        made: bytes = self._core.markers(slots, ids, gone, clear, stamp, frame, namespace, colour, lift)
        return made

    def marker_revisions(self) -> IntArray:
        """Return numbers (n,) that change with the markers of `slots`."""
        return np.asarray(self._core.marker_revisions(self.slots))

    def table(self) -> PatchTable:
        """Return the patches of `slots`."""
        numbers, motion = self._core.describe(self.slots)
        points, triangles = self._core.geometry(self.slots)
        is_mesh, tiles, rows, columns, stride, counts, triangle_counts, revisions, decks, of_mesh = numbers.T
        known = [_names("", self._terrain), *(_names(name, deck) for name, deck in self._terrain.decks.items())]
        names = [known[deck + 1][mesh][tile] for deck, mesh, tile in zip(decks, of_mesh, tiles, strict=True)]
        return PatchTable(
            slots=self.slots, tiles=names, is_mesh=is_mesh.astype(bool), rows=rows, columns=columns, stride=stride,
            counts=counts, triangle_counts=triangle_counts, revisions=revisions, motion=motion, points_w=points,
            triangles=triangles,
        )  # fmt: skip


def _names(deck: str, of: Tiles) -> tuple[list[str], list[str]]:
    """Return the names of the height maps and of the meshes of a terrain, deck "", or of a deck."""
    found: tuple[list[str], list[str]] = ([], [])
    for name, mesh in of.tiles.items():
        found[not isinstance(mesh, HeightMap)].append(name_of_tile(deck, name))
    return found
