"""Tables of bodies, and soil, at the limits of what the core takes."""

from typing import Any

import numpy as np
import pytest

from smartmesh_ros import BodyState, Box, HeightMap, Soil, World
from smartmesh_ros.core import CORE
from smartmesh_ros.ground.shapes import DIMENSIONS
from smartmesh_ros.world.state_table import LIMITS
from tests.core.body_entries import BODIES, above_grid, bodies, faults, search_patches, soil
from tests.core.entries import REFUSED


def test_each_slot_that_is_searched_has_a_shape() -> None:
    given = bodies() | {"always": np.ones(BODIES, bool), "owners": np.arange(BODIES), "time": 0.0}
    for shapes in ([], given["shapes"][1:], [None] * BODIES, [1] * BODIES):
        with pytest.raises(REFUSED):
            search_patches(**given | {"shapes": shapes})


@pytest.mark.parametrize("kind", [0, len(DIMENSIONS), 255])
def test_bodies_of_no_known_kind_are_faulty(kind: int) -> None:
    given = faults()
    given["states"][:, 6], given["kinds"][3], given["dimensions"][...] = 1.0, kind, 1.0
    assert CORE.first_fault(**given) == (3, 5)


@pytest.mark.parametrize("counts", [np.zeros(4, np.int64), np.full(5, 2**62), np.full(5, -1), np.zeros(5), None])
def test_numbers_of_dimensions_lead_out_of_no_array(counts: Any) -> None:
    given = faults()
    given["states"][:, 6] = 1.0
    try:
        CORE.first_fault(**given | {"limits": (counts, *LIMITS[1:])})
    except REFUSED:
        assert counts is None or len(counts) == 4 or counts.dtype == np.float64


@pytest.mark.parametrize("at", [0, 3, 496, 500, 501, 2**63, 2**64 - 1])
@pytest.mark.parametrize("byte", [0, 1, 255])
def test_messages_that_end_too_soon_are_refused(at: int, byte: int) -> None:
    rows = np.zeros((30, 140), np.uint8)
    assert CORE.split_bodies(np.full(500, byte, np.uint8), at, rows) is None


def test_hulls_and_compounds_have_no_undersides_to_press_with() -> None:
    for shape in bodies()["shapes"][1:]:
        with pytest.raises(REFUSED):
            CORE.shape_above_grid(**above_grid() | {"shape": shape})


@pytest.mark.parametrize("spacing", [0.0, -1.0, np.nan, 1e-3])
def test_a_soil_needs_a_spacing_that_is_not_too_fine(spacing: float) -> None:
    with pytest.raises(REFUSED):
        CORE.Soil(**soil() | {"spacing": spacing})


def test_kinds_of_soils_that_are_not_there_count_as_the_last() -> None:
    with World(HeightMap(np.zeros((41, 41)), resolution=0.1)) as world:
        known = Soil(world.terrain, ["lunar", "clay"])
        world.ground.set_soil(known)
        world.terrain.tiles[""].soil = np.full((41, 41), 200)  # type: ignore[union-attr]
        world.spawn("box", Box(0.4, 0.4, 0.4), 100.0, BodyState((2.0, 2.0, 0.2)))
        world.step(240)
        assert 0.0 < world.ground.on_soil()["box"].sinkage < 1e-3
