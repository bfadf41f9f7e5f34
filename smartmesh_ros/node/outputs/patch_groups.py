"""Groups of patches that are serialised together, and detection of patches that changed since the last message."""

from __future__ import annotations

from collections.abc import Hashable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.patches.batch import PatchBatch


class PatchGroup(NamedTuple):
    """Patches of a batch with the same triangles (T, 3): rows ``members`` (n,) of the batch, their bodies (n,) and
    vertices (n, K, 3) [m]. ``whole``: the group has all triangles of the batch, none removed at a hole."""

    batch: PatchBatch
    members: NDArray[np.int64]
    bodies: NDArray[np.int64]
    vertices_w: NDArray[np.float64]
    triangles: NDArray[np.int32]
    whole: bool


def by_triangles(batches: list[PatchBatch]) -> Iterator[PatchGroup]:
    """Yield the patches grouped by their triangles; triangles that touch a hole are removed."""
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
    """The patches as last sent, to detect changes."""

    def __init__(self, count: int = 0) -> None:
        self._count = count
        self._kinds: dict[Hashable, tuple[int, NDArray[np.int64]]] = {}
        # For each body: number of its kind in the last message, -1 = none; and whether this message has its patch.
        self._kind = np.full(count, -1)
        self._present = np.zeros(count, bool)

    def end(self) -> None:
        """Ends a message. Bodies without a patch in it will count as changed when they return."""
        self._kind[~self._present] = -1
        self._present[:] = False

    def forget(self) -> None:
        """Marks every patch as changed for the next message."""
        self._kind[:] = -1
        self._present[:] = False

    def changed(self, group: PatchGroup, kind: Hashable, *values: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return which patches of a group (n,) differ from those last sent, and record the group as sent.

        ``kind``: key of the constant content of the group. ``values`` (n, ...): all other content of its patches.
        """
        self._present[group.bodies] = True
        count = len(group.bodies)
        if not group.whole:  # at a hole: rare, and each has its own triangles
            self._kind[group.bodies] = -1
            return np.ones(count, bool)
        # Compared as integers, so that NaN equals NaN.
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
