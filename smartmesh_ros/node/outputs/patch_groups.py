"""Patches in groups that are written at once, and what of them has changed since they were sent."""

from __future__ import annotations

from collections.abc import Hashable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.patches.batch import PatchBatch


class PatchGroup(NamedTuple):
    """Patches of a batch that show the same triangles (T, 3): rows ``members`` (n,) of the batch, their bodies (n,) and
    vertices (n, K, 3) [m]. ``whole``: whether these are all triangles of the batch."""

    batch: PatchBatch
    members: NDArray[np.int64]
    bodies: NDArray[np.int64]
    vertices_w: NDArray[np.float64]
    triangles: NDArray[np.int32]
    whole: bool


def by_triangles(batches: list[PatchBatch]) -> Iterator[PatchGroup]:
    """Patches grouped by the triangles they show: those that touch a hole are left out."""
    for batch in batches:
        vertices = batch.vertices_w
        if not batch.may_have_holes:
            yield PatchGroup(batch, np.arange(len(vertices)), batch.bodies, vertices, batch.triangles, True)
            continue
        ground = ~np.isnan(vertices[..., 2])
        for index in np.flatnonzero(~ground.all(axis=1)):
            solid = ground[index][batch.triangles].all(axis=1)
            if solid.any():
                one = np.array([index])
                yield PatchGroup(batch, one, batch.bodies[one], vertices[one], batch.triangles[solid], False)
        members = np.flatnonzero(ground.all(axis=1))
        if members.size:
            yield PatchGroup(batch, members, batch.bodies[members], vertices[members], batch.triangles, True)


class SentPatches:
    """The patches as they were last sent, to tell which have changed."""

    def __init__(self, count: int = 0) -> None:
        self._count = count
        self._kinds: dict[Hashable, tuple[int, NDArray[np.int64]]] = {}
        # Which of them each body's was, -1 = none; and whether it was there this time.
        self._kind = np.full(count, -1)
        self._there = np.zeros(count, bool)

    def end(self) -> None:
        """Ends a message: a body that was not in it comes back as new."""
        self._kind[~self._there] = -1
        self._there[:] = False

    def forget(self) -> None:
        """Takes every patch as changed the next time."""
        self._kind[:] = -1
        self._there[:] = False

    def changed(self, group: PatchGroup, kind: Hashable, *values: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Which of a group are not as they were sent last (n,); takes them as sent.

        ``kind``: what all of them have in common. ``values`` (n, ...): all that their messages say beside it.
        """
        self._there[group.bodies] = True
        count = len(group.bodies)
        if not group.whole:  # at a hole: rare, and of any shape
            self._kind[group.bodies] = -1
            return np.ones(count, bool)
        # Bit by bit, so that NaN equals itself.
        now = np.concatenate([part.reshape(count, -1) for part in values], axis=1, dtype=np.float64).view(np.int64)
        key = kind, now.shape[1], group.triangles.tobytes()
        if key not in self._kinds:
            self._kinds[key] = len(self._kinds), np.zeros((self._count, now.shape[1]), np.int64)
        number, sent = self._kinds[key]
        differs = (self._kind[group.bodies] != number) | (sent[group.bodies] != now).any(axis=1)
        bodies = group.bodies[differs]
        self._kind[bodies] = number
        sent[bodies] = now[differs]
        return np.asarray(differs)
