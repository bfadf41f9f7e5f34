"""Heightfield patches of several sizes as one table, so that one pass serves them all."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.patches.batch import GridBatch
from smartmesh_ros.patches.template import patch_template
from smartmesh_ros.terrain.grid import BoolArray, FloatArray, IntArray
from smartmesh_ros.terrain.heightmap import HeightMap, Samples

T = TypeVar("T", bound=np.generic)

# Larger patches [samples on a side] are not filled up to those of others: that would cost more than a pass of its own.
LARGEST_JOINED = 9
# A body so far from the plane under it touches nothing of its patch [m].
APART = 0.01


class Layout(NamedTuple):
    """Templates of s sizes, filled up to the K samples of the largest with their first: ``sizes`` (s,) [samples on a
    side], ``rows``, ``columns`` (s, K) and ``fit`` (s, K, 3), zero where filled up, as in `PatchTemplate`."""

    sizes: IntArray
    rows: FloatArray
    columns: FloatArray
    fit: FloatArray


@lru_cache
def layout_of(sizes: tuple[int, ...]) -> Layout:
    """The layout of patches of such sizes."""
    most = max(sizes) ** 2
    places, fit = np.zeros((2, len(sizes), most)), np.zeros((len(sizes), most, 3))
    layout = Layout(np.array(sizes), places[0], places[1], fit)
    for index, size in enumerate(sizes):
        template, count = patch_template(size // 2), size * size
        for values, known in ((layout.rows, template.rows), (layout.columns, template.columns)):
            values[index, :count], values[index, count:] = known, known[0]
        layout.fit[index, :count] = template.fit
    return layout


class Fields(NamedTuple):
    """Heightfield patches of m bodies on one map from ``batches`` of different sizes, joined: shapes as in `GridBatch`.

    ``which`` (m,): the patch's size among those of the ``layout``, which is its batch; ``row_in`` (m,): its row there.
    """

    heightmap: HeightMap
    batches: list[GridBatch]
    layout: Layout
    which: IntArray
    row_in: IntArray
    bodies: IntArray
    rows: IntArray
    columns: IntArray
    spacing: FloatArray
    centres_w: FloatArray
    linear_w: FloatArray
    angular_w: FloatArray
    since: FloatArray
    points_w: FloatArray | None
    normals_w: FloatArray | None

    @classmethod
    def of(cls, batches: list[GridBatch]) -> Fields:
        """The patches of batches of one map, each of another size."""
        counts = [len(batch.bodies) for batch in batches]
        return cls(
            batches[0].heightmap, batches, layout_of(tuple(batch.template.size for batch in batches)),
            np.repeat(np.arange(len(batches)), counts), np.concatenate([np.arange(count) for count in counts]),
            _joined([batch.bodies for batch in batches]), _joined([batch.rows for batch in batches]),
            _joined([batch.columns for batch in batches]), _joined([batch.spacing for batch in batches]),
            _joined([batch.centres_w for batch in batches]), _joined([batch.linear_w for batch in batches]),
            _joined([batch.angular_w for batch in batches]), _joined([batch.since for batch in batches]),
            _joined_if_known([batch.points_w for batch in batches]),
            _joined_if_known([batch.normals_w for batch in batches]),
        )  # fmt: skip

    def of_rows(self, rows: IntArray) -> Fields:
        """Those in ``rows``."""
        points_w = None if self.points_w is None else self.points_w[rows]
        normals_w = None if self.normals_w is None else self.normals_w[rows]
        return Fields(
            self.heightmap, self.batches, self.layout, self.which[rows], self.row_in[rows], self.bodies[rows],
            self.rows[rows], self.columns[rows], self.spacing[rows], self.centres_w[rows], self.linear_w[rows],
            self.angular_w[rows], self.since[rows], points_w, normals_w,
        )  # fmt: skip

    def read(self, *, velocities: bool) -> Samples:
        """The samples (m, K), NaN over holes; velocities only where they are asked for."""
        if not self.mixed:
            whole = len(self.row_in) == len(self.batches[0].bodies)
            ground = self.batches[0].read(slice(None) if whole else self.row_in, velocities=velocities)
            return Samples(ground.heights, ground.velocities if velocities else None)
        heights = np.empty((len(self.bodies), self.layout.rows.shape[1]))
        speeds = np.zeros_like(heights) if velocities else None
        for which, batch in enumerate(self.batches):
            rows = np.flatnonzero(self.which == which)
            if not rows.size:
                continue
            ground = batch.read(self.row_in[rows], velocities=velocities)
            _fill(heights, rows, ground.heights)
            if speeds is not None and ground.velocities is not None:
                _fill(speeds, rows, ground.velocities)
        return Samples(heights, speeds)

    def touching(self, positions_w: FloatArray, radii: FloatArray) -> BoolArray:
        """Which bodies (m,) are so near to the ground that they may have contacts with it; positions (N, 3) [m] and
        radii (N,) [m] of all followers."""
        if self.points_w is None or self.normals_w is None:
            return np.ones(len(self.bodies), bool)
        distance = np.einsum("ij,ij->i", positions_w[self.bodies] - self.points_w, self.normals_w)
        return np.asarray(distance <= radii[self.bodies] + APART)

    @property
    def holes(self) -> bool:
        """Whether any sample may be NaN."""
        return any(batch.may_have_holes for batch in self.batches)

    @property
    def mixed(self) -> bool:
        """Whether there may be patches of several sizes."""
        return len(self.batches) > 1

    def spread(self, values: FloatArray) -> FloatArray:
        """Values of the layout's sizes (s, ...) for each patch: (m, ...), or (1, ...) for all alike."""
        return values[self.which] if self.mixed else values


def _fill(table: FloatArray, rows: IntArray, values: FloatArray) -> None:
    """Writes values (k, c) into ``rows`` (k,) of a table (m, K), filled up with the first of each."""
    count = values.shape[1]
    table[rows, :count], table[rows, count:] = values, values[:, :1]


def base_over_holes(centres_w: FloatArray, heights_w: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Bases of patches with holes, at the mean of their heights where the centre is one, and which have any ground."""
    holes = np.isnan(heights_w)
    grounded = np.asarray(~holes.all(axis=1))
    hollow = grounded & np.isnan(centres_w[:, 2])
    base = centres_w.copy()
    base[hollow, 2] = np.nanmean(heights_w[hollow], axis=1)
    return base, grounded


def groups(batches: list[GridBatch]) -> list[list[GridBatch]]:
    """Batches that go well together, in their order: small ones of one map and of different sizes."""
    found: list[list[GridBatch]] = []
    for batch in batches:
        for group in found:
            sizes = {other.template.size for other in group}
            if (
                group[0].heightmap is batch.heightmap
                and (group[0].points_w is None) == (batch.points_w is None)
                and max(*sizes, batch.template.size) <= LARGEST_JOINED
                and batch.template.size not in sizes
            ):
                group.append(batch)
                break
        else:
            found.append([batch])
    return found


def _joined(parts: list[NDArray[T]]) -> NDArray[T]:
    return parts[0] if len(parts) == 1 else np.concatenate(parts)


def _joined_if_known(parts: list[FloatArray | None]) -> FloatArray | None:
    known = [part for part in parts if part is not None]
    return _joined(known) if len(known) == len(parts) else None
