"""Heightfield patches of several sizes as one table, so that one pass serves them all."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from smartmesh_ros.patches.batch import GridBatch
from smartmesh_ros.patches.template import patch_template
from smartmesh_ros.terrain.grid import BoolArray, FloatArray, IntArray
from smartmesh_ros.terrain.heightmap import HeightMap

# Larger patches [samples on a side] are not filled up to those of others: that would cost more than a pass of its own.
LARGEST_JOINED = 9


class Layout(NamedTuple):
    """Templates of s sizes, filled up with zeros to the K samples of the largest: ``sizes`` (s,) [samples on a side],
    ``rows``, ``columns`` (s, K) and ``fit`` (s, K, 3) as in `PatchTemplate`; which samples are ``unused`` (s, K)."""

    sizes: IntArray
    rows: FloatArray
    columns: FloatArray
    fit: FloatArray
    unused: BoolArray


@lru_cache
def layout_of(sizes: tuple[int, ...]) -> Layout:
    """The layout of patches of such sizes."""
    most = max(sizes) ** 2
    layout = Layout(
        np.array(sizes),
        np.zeros((len(sizes), most)),
        np.zeros((len(sizes), most)),
        np.zeros((len(sizes), most, 3)),
        np.ones((len(sizes), most), bool),
    )
    for index, size in enumerate(sizes):
        template, count = patch_template(size // 2), size * size
        layout.rows[index, :count], layout.columns[index, :count] = template.rows, template.columns
        layout.fit[index, :count] = template.fit
        layout.unused[index, :count] = False
    return layout


class Fields(NamedTuple):
    """Heightfield patches of m bodies on one map, as in `GridBatch`; ``which`` (m,): the patch's size among those of
    the ``layout``. ``heights_w`` (m, K) [m] are NaN where a patch has no sample, and over ``holes``."""

    heightmap: HeightMap
    layout: Layout
    which: IntArray
    bodies: IntArray
    spacing: FloatArray
    centres_w: FloatArray
    linear_w: FloatArray
    angular_w: FloatArray
    heights_w: FloatArray
    points_w: FloatArray | None
    normals_w: FloatArray | None
    holes: bool

    @classmethod
    def of(cls, batches: list[GridBatch]) -> Fields:
        """The patches of batches of one map, each of another size."""
        first, layout = batches[0], layout_of(tuple(batch.template.size for batch in batches))
        if len(batches) == 1:
            return cls(
                first.heightmap, layout, np.zeros(len(first.bodies), np.int64), first.bodies, first.spacing,
                first.centres_w, first.linear_w, first.angular_w, first.heights_w, first.points_w, first.normals_w,
                first.holes,
            )  # fmt: skip
        which = np.repeat(np.arange(len(batches)), [len(batch.bodies) for batch in batches])
        heights_w = np.full((len(which), layout.rows.shape[1]), np.nan)
        start = 0
        for batch in batches:
            count, samples = batch.heights_w.shape
            heights_w[start : start + count, :samples] = batch.heights_w
            start += count
        return cls(
            first.heightmap, layout, which,
            np.concatenate([batch.bodies for batch in batches]),
            np.concatenate([batch.spacing for batch in batches]),
            np.concatenate([batch.centres_w for batch in batches]),
            np.concatenate([batch.linear_w for batch in batches]),
            np.concatenate([batch.angular_w for batch in batches]),
            heights_w,
            _joined([batch.points_w for batch in batches]),
            _joined([batch.normals_w for batch in batches]),
            any(batch.holes for batch in batches),
        )  # fmt: skip

    def of_rows(self, rows: IntArray) -> Fields:
        """Those in ``rows``."""
        points_w = None if self.points_w is None else self.points_w[rows]
        normals_w = None if self.normals_w is None else self.normals_w[rows]
        return Fields(
            self.heightmap, self.layout, self.which[rows], self.bodies[rows], self.spacing[rows], self.centres_w[rows],
            self.linear_w[rows], self.angular_w[rows], self.heights_w[rows], points_w, normals_w,
            self.holes,
        )  # fmt: skip

    @property
    def mixed(self) -> bool:
        """Whether there may be patches of several sizes."""
        return len(self.layout.sizes) > 1

    def spread(self, values: FloatArray) -> FloatArray:
        """Values of the layout's sizes (s, ...) for each patch: (m, ...), or (1, ...) for all alike."""
        return values[self.which] if self.mixed else values


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


def _joined(parts: list[FloatArray | None]) -> FloatArray | None:
    known = [part for part in parts if part is not None]
    return np.concatenate(known) if len(known) == len(parts) else None
