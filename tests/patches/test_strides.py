"""The cheapest patch that is near enough, by its definition."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from smartmesh_ros.patches.grid_window import SIZES, Window
from smartmesh_ros.patches.strides import HYSTERESIS, RINGS, cheapest_extents, stride_deviation

TOLERANCE = 0.01


def window_of(rings: int, count: int, seed: int, roughness: float) -> Window:
    """Waves of several lengths, and noise of so many millimetres."""
    rng, side = np.random.default_rng(seed), 2 * rings + 1
    rows, columns = np.indices((side, side)) - rings
    heights = np.empty((1, count, side, side))
    for body in range(count):
        along = rng.uniform(-0.2, 0.2, 2)
        heights[0, body] = 0.1 * np.sin(along[0] * rows + along[1] * columns + rng.uniform(0.0, 6.0))
        heights[0, body] += rng.normal(scale=1e-3 * roughness, size=(side, side))
    return Window(heights=heights, rings=rings, resolution=0.1, holes=False)


@pytest.mark.parametrize("rings", SIZES[2:].tolist())
@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 1000), roughness=st.floats(0.0, 5.0))
def test_who_has_nothing_gets_the_fewest_samples_that_are_near_enough(rings: int, seed: int, roughness: float) -> None:
    window, nothing, bodies = window_of(rings, 8, seed, roughness), np.zeros(8, np.int64), np.arange(8)
    need = np.random.default_rng(seed).integers(1, rings + 1, 8)
    found = cheapest_extents(window, bodies, need, TOLERANCE, nothing, nothing)
    for body in range(8):
        steps = {count: -(-int(need[body]) // count) for count in RINGS}
        deviations = {
            count: float(stride_deviation(window, bodies[body : body + 1], count, step)[0])
            for count, step in steps.items() if count * step <= rings
        }  # fmt: skip
        good = [count for count, deviation in deviations.items() if deviation <= TOLERANCE]
        rings_found = int(found.rings[body])
        assert rings_found == (good[0] if good else max(deviations))
        assert found.stride[body] == steps[rings_found]
        assert found.deviation[body] == deviations[rings_found]


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 1000))
def test_who_has_a_patch_that_is_near_enough_keeps_it_or_gets_a_cheaper_one(seed: int) -> None:
    window, nothing, bodies = window_of(24, 8, seed, 0.0), np.zeros(8, np.int64), np.arange(8)
    need = np.random.default_rng(seed).integers(1, 25, 8)
    first = cheapest_extents(window, bodies, need, TOLERANCE, nothing, nothing)
    again = cheapest_extents(window, bodies, need, TOLERANCE, first.rings, first.stride)
    for one, other in zip(first, again, strict=True):
        np.testing.assert_array_equal(one, other)
    finest = need.copy()
    last = cheapest_extents(window, bodies, need, TOLERANCE, finest, np.ones_like(need))
    assert (last.deviation <= TOLERANCE).all() or (last.deviation >= first.deviation).any()
    cheaper = last.rings < finest
    assert (last.deviation[cheaper] <= HYSTERESIS * TOLERANCE).all()
    assert (last.rings * last.stride >= need).all()
