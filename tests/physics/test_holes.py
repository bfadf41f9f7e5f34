"""Holes of a field: nothing is held up over them, and their rims hold what stands on them."""

import math

import numpy as np
import pytest

from smartmesh_ros import BodyState, Box, Cylinder, HeightMap, PatchConfig, PhysicsConfig, World, WorldConfig
from smartmesh_ros.patches.config import PatchKind
from smartmesh_ros.physics.shapes import Shape

LYING = (math.sin(math.pi / 4.0), 0.0, 0.0, math.cos(math.pi / 4.0))  # an axis along z is then along y


def world_with_hole(kind: PatchKind) -> World:
    """Level ground with a hole from x = 0 on."""
    heights = np.zeros((61, 61))
    heights[:, 31:] = np.nan
    config = WorldConfig(patch=PatchConfig(kind=kind), physics=PhysicsConfig(guard=False))
    return World(HeightMap(heights, resolution=0.1, origin=(-3.0, -3.0)), config)


def height_after(kind: PatchKind, shape: Shape, state: BodyState, seconds: float = 2.0) -> float:
    with world_with_hole(kind) as world:
        world.spawn("body", shape, 1.0, state)
        world.step(round(240 * seconds))
        return world.state("body").position[2]


@pytest.mark.parametrize("kind", ["auto", "heightfield"])
def test_a_box_whose_middle_is_over_a_hole_tips_and_falls_in(kind: PatchKind) -> None:
    assert height_after(kind, Box(0.6, 0.4, 0.3), BodyState((0.08, 0.013, 0.15))) < -1.0


@pytest.mark.parametrize("kind", ["auto", "heightfield"])
def test_a_box_whose_middle_is_over_the_rim_stays(kind: PatchKind) -> None:
    assert height_after(kind, Box(0.6, 0.4, 0.3), BodyState((-0.08, 0.013, 0.15))) == pytest.approx(0.15, abs=2e-3)


@pytest.mark.parametrize("kind", ["auto", "heightfield"])
def test_a_wheel_rolls_over_the_rim_and_falls_in(kind: PatchKind) -> None:
    rolling = BodyState((-0.5, 0.013, 0.2), LYING, (1.0, 0.0, 0.0), (0.0, 5.0, 0.0))
    assert height_after(kind, Cylinder(0.2, 0.3), rolling) < -1.0


@pytest.mark.parametrize("kind", ["auto", "heightfield"])
def test_a_wheel_at_the_rim_falls_in_when_its_middle_is_over_the_hole(kind: PatchKind) -> None:
    assert height_after(kind, Cylinder(0.2, 0.3), BodyState((0.03, 0.013, 0.2), LYING)) < -1.0


@pytest.mark.parametrize("kind", ["auto", "heightfield"])
def test_a_wheel_before_the_rim_stays(kind: PatchKind) -> None:
    assert height_after(kind, Cylinder(0.2, 0.3), BodyState((-0.15, 0.013, 0.2), LYING)) == pytest.approx(0.2, abs=2e-3)
