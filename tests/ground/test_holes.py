"""Holes of a field: nothing is held up over them, and their rims hold what stands on them."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from smartmesh_ros import BodyState, Box, Cylinder, HeightMap, PatchConfig, PhysicsConfig, Sphere, World, WorldConfig
from smartmesh_ros.ground.shapes import Shape
from smartmesh_ros.patches.config import PatchKind

LYING = (math.sin(math.pi / 4.0), 0.0, 0.0, math.cos(math.pi / 4.0))  # an axis along z is then along y
# Which samples at x, y [m] are no ground.
Hole = Callable[[np.ndarray, np.ndarray], np.ndarray]
KINDS: tuple[PatchKind, ...] = ("auto", "heightfield")


def half_plane(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """From x = 0 on."""
    return x > 0.01


def slot(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """1 m long from x = 0 on, 0.6 m wide about y = 0, but for a facet in each corner."""
    return (x > 0.01) & (x < 0.99) & (abs(y) < 0.29)


def pit(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """0.4 x 0.4 m about the origin."""
    return (abs(x) < 0.19) & (abs(y) < 0.19)


def trench(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """0.2 m wide about x = 0."""
    return abs(x) < 0.09


def height_after(kind: PatchKind, hole: Hole, shape: Shape, state: BodyState) -> float:
    """Height of a body's middle after 2 s on level ground with a hole [m]."""
    y, x = 0.1 * (np.mgrid[:61, :61] - 30.0)
    config = WorldConfig(patch=PatchConfig(kind=kind), physics=PhysicsConfig(guard=False))
    with World(HeightMap(np.where(hole(x, y), np.nan, 0.0), resolution=0.1, origin=(-3.0, -3.0)), config) as world:
        world.spawn("body", shape, 1.0, state)
        world.step(480)
        return world.state("body").position[2]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("hole", "width"), [(half_plane, 0.4), (slot, 0.36)])
def test_a_box_whose_middle_is_over_a_hole_tips_and_falls_in(kind: PatchKind, hole: Hole, width: float) -> None:
    """Also between two rims, where its field goes from one to the other."""
    assert height_after(kind, hole, Box(0.6, width, 0.3), BodyState((0.08, 0.0, 0.15))) < -1.0


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("hole", "width"), [(half_plane, 0.4), (slot, 0.36)])
def test_a_box_whose_middle_is_before_the_rim_stays(kind: PatchKind, hole: Hole, width: float) -> None:
    state = BodyState((-0.08, 0.0, 0.15))
    assert height_after(kind, hole, Box(0.6, width, 0.3), state) == pytest.approx(0.15, abs=2e-3)


@pytest.mark.parametrize("kind", KINDS)
def test_a_box_that_is_longer_than_a_trench_is_wide_lies_over_it(kind: PatchKind) -> None:
    state = BodyState((0.01, 0.0, 0.15))
    assert height_after(kind, trench, Box(0.6, 0.4, 0.3), state) == pytest.approx(0.15, abs=1e-3)


@pytest.mark.parametrize("kind", KINDS)
def test_a_ball_sinks_into_a_pit_until_its_rims_hold_it(kind: PatchKind) -> None:
    state = BodyState((0.01, 0.01, 0.3))
    rest = math.sqrt(0.3**2 - 0.2**2)
    assert height_after(kind, pit, Sphere(0.3), state) == pytest.approx(rest, abs=2e-3)


@pytest.mark.parametrize("kind", KINDS)
def test_a_wheel_sinks_into_a_trench_until_its_rims_hold_it(kind: PatchKind) -> None:
    state = BodyState((0.01, 0.013, 0.2), LYING)
    rest = math.sqrt(0.2**2 - 0.1**2)
    assert height_after(kind, trench, Cylinder(0.2, 0.3), state) == pytest.approx(rest, abs=2e-3)


@pytest.mark.parametrize("kind", KINDS)
def test_a_wheel_falls_in_when_its_middle_is_over_the_hole(kind: PatchKind) -> None:
    assert height_after(kind, half_plane, Cylinder(0.2, 0.3), BodyState((0.03, 0.013, 0.2), LYING)) < -1.0


@pytest.mark.parametrize("kind", KINDS)
def test_a_wheel_before_the_rim_stays(kind: PatchKind) -> None:
    state = BodyState((-0.15, 0.013, 0.2), LYING)
    assert height_after(kind, half_plane, Cylinder(0.2, 0.3), state) == pytest.approx(0.2, abs=2e-3)
