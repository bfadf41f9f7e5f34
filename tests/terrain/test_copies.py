"""A copy of a map, and one from another process, is the same ground, goes on as the map would, and shares nothing."""

import copy
import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from smartmesh_ros import HeightMap, Material, MotionConfig, Terrain
from smartmesh_ros.terrain.material import NAMES
from smartmesh_ros.terrain.surface_query import checked_points, ground_samples
from smartmesh_ros.terrain.trimesh import TriangleMesh
from tests.examples import examples
from tests.terrain.surfaces import mesh_of

ROWS, COLUMNS = 9, 12
COPIES: dict[str, Callable[[Any], Any]] = {
    "deepcopy": copy.deepcopy, "copy": copy.copy, "pickle": lambda ground: pickle.loads(pickle.dumps(ground)),
}  # fmt: skip
MOTIONS = [
    MotionConfig(), MotionConfig(mode="interpolate"), MotionConfig(noise=0.01), MotionConfig(changes="correction"),
    MotionConfig(changes="correction", noise=0.01), MotionConfig(smoothing=1.0),
]  # fmt: skip
CHANGES = ["whole", "region", "press", "show", "friction", "material", "soil", "slide", "scroll"]


def heights_of(seed: int) -> np.ndarray:
    heights = np.random.default_rng(seed).normal(0.0, 0.1, (ROWS, COLUMNS))
    heights[0, seed % COLUMNS] = np.nan
    return heights


def change(ground: Terrain, what: str, time: float) -> None:
    tile, seed = ground.tile(""), round(1e3 * time)
    if isinstance(tile, TriangleMesh):
        moved = np.arange(tile.size if what == "whole" else 30)
        tile.move(tile.vertices[moved] + (0.002, 0.0, 1e-3 * (seed % 7)), time=time, indices=moved)
        tile.core_reader.shown = time  # as steps do
    elif what == "whole":
        tile.replace(heights_of(seed), time=time)
    elif what == "region":
        tile.update_region(2, 3, heights_of(seed)[:4, :5], time=time)
    elif what == "press":
        tile.press(np.array([[1, 1], [4, 6]]), np.array([-0.2, -0.3], np.float32))
    elif what == "show":
        tile.show(time)
    elif what == "friction":
        tile.friction = np.full((ROWS, COLUMNS), 0.01 * (seed % 90))
    elif what == "material":
        part = Material(stiffness=1e3 * (1 + seed % 7), rolling=np.full((4, 5), 0.01 * (seed % 9)))
        tile.update_region(2, 3, heights_of(seed)[:4, :5], time=time, material=part)
    elif what == "soil":
        tile.soil = np.random.default_rng(seed).integers(0, 9, (ROWS, COLUMNS))
    else:
        moved = tile.geometry.origin[0] + (0.013 if what == "slide" else 0.2)
        new = HeightMap(heights_of(seed), resolution=0.1, origin=(moved, 0.0), time=time, motion=tile.motion)
        ground.put("", new)


def seen(ground: Terrain, time: float) -> list[np.ndarray]:
    points = np.stack(np.meshgrid(np.linspace(-0.2, 2.0, 25), np.linspace(-0.1, 0.9, 12)), axis=-1).reshape(-1, 2)
    tile, samples = ground.tile(""), [*ground_samples(ground, checked_points(points), time)]
    if isinstance(tile, HeightMap):
        samples += [np.array(tile.material.layers.get(name, 0.0)) for name in NAMES]
    return samples


def ground_of(kind: str, motion: MotionConfig) -> HeightMap | TriangleMesh:
    if kind == "map":
        return HeightMap(heights_of(0), resolution=0.1, motion=motion)
    return mesh_of(HeightMap(np.nan_to_num(heights_of(0)), resolution=0.1), motion=motion)


@pytest.mark.parametrize("how", COPIES)
@examples(30)
@given(
    kind=st.sampled_from(["map", "map", "mesh"]),
    motion=st.sampled_from(MOTIONS),
    before=st.lists(st.sampled_from(CHANGES), max_size=6),
    after=st.lists(st.sampled_from(["whole", "region", "press", "show"]), max_size=3),
)
def test_a_copied_terrain_is_the_same_and_goes_on_as_its_original(
    how: str, kind: str, motion: MotionConfig, before: list[str], after: list[str]
) -> None:
    ground = Terrain(ground_of(kind, motion))
    for step, what in enumerate(before, 1):
        change(ground, what, 0.05 * step)
    other = Terrain(COPIES[how](ground.tile(""))) if how == "copy" else COPIES[how](ground)
    assert other.revision != ground.revision, "whoever watched the original would take it for unchanged"
    now = 0.05 * len(before) + 0.02
    mine, its = seen(ground, now), seen(other, now)
    change(other, "whole", now + 0.03)
    change(other, "press", now + 0.03)
    for own, before_, found in zip(seen(ground, now), mine, its, strict=True):
        np.testing.assert_array_equal(own, before_, "the original has not changed")
        np.testing.assert_array_equal(own, found)
    other = COPIES["pickle"](ground)
    for step, what in enumerate(after, 1):
        for each in (ground, other):
            change(each, what, now + 0.05 * step)
    for own, found in zip(seen(ground, now + 0.2), seen(other, now + 0.2), strict=True):
        np.testing.assert_array_equal(own, found)


def test_a_map_that_never_moved_takes_its_bytes_once_in_a_pickle() -> None:
    heights = np.zeros((300, 400), np.float32)
    assert len(pickle.dumps(HeightMap(heights, resolution=0.1))) < 2.2 * heights.nbytes
