"""Shallow folds of the ground, in one piece and between two, which bodies pass without entering them and rest on."""

from typing import Any

import numpy as np
import pytest

from smartmesh_ros import BodyState, Box, Capsule, Cylinder, Sphere, Terrain
from tests.bodies import LYING, about_z
from tests.ground.pieces import Piece, a_deck, a_map, a_mesh, pieces
from tests.grounds import world_of

ROUND: dict[str, Any] = {  # with their axes along y
    "ball": Sphere(0.1), "marble": Sphere(0.01), "capsule": Capsule(radius=0.1, height=0.2),
    "wheel": Cylinder(radius=0.1, height=0.2),
}  # fmt: skip
PAIRS: list[tuple[Piece, ...]] = [(a_map, a_deck), (a_mesh, a_mesh), (a_mesh, a_map)]


def deepest(terrain: Terrain, body: str, start: float, speed: float) -> float:
    """Depth of the deepest contact of a body that rolls from x = ``start`` over a fold at x = 0 [m]."""
    shape, found = ROUND[body], 0.0
    with world_of(terrain, sleep=False) as world:
        spin = (0.0, speed / shape.radius, 0.0)
        world.spawn("body", shape, 1.0, BodyState((start, 0.033, shape.radius), LYING, (speed, 0.0, 0.0), spin))
        for _ in range(round(240 * 2.0 * abs(start) / speed)):
            world.step()
            found = max([found, *(contact.depth for contact in world.contacts())])
    return found


@pytest.mark.parametrize(
    ("body", "parts"),
    [
        *[(body, (piece,)) for body in ROUND for piece in (a_map, a_mesh, a_deck)],
        *[(body, parts) for body in ("ball", "marble") for parts in PAIRS],
    ],
)
def test_what_rolls_into_a_fold_does_not_enter_it(body: str, parts: tuple[Piece, ...]) -> None:
    """Gravity bends the way of a body below the facet that it rolls on, and the spin of a wheel moves no point of it
    off the ground. Entering the next facet for a step would be 0.4 mm deep at 3 m/s and 0.04 rad. What touches at
    several places prefers those of the step before by a thousandth of its radius."""
    preference = 1e-3 * ROUND[body].bounding_radius if body in ("capsule", "wheel") else 0.0
    for slope, speed in [(0.04, 1.0), (0.04, 3.0), (0.1, 3.0)]:
        terrain = pieces(lambda x, y, slope=slope: slope * np.maximum(x, 0.0), *parts)
        for phase in range(3):
            start = -0.25 + phase / 3 * speed / 240
            assert deepest(terrain, body, start, speed) < 3e-5 + preference, (slope, speed, phase)


@pytest.mark.parametrize(("slope", "cell"), [(0.01, 0.1), (0.04, 0.02)])
@pytest.mark.parametrize("parts", [(a_map,), *PAIRS])
def test_a_marble_touches_the_ground_in_each_step_around_a_near_flat_fold(
    parts: tuple[Piece, ...], slope: float, cell: float
) -> None:
    """A step without a contact is a free fall of 0.17 mm; the fold itself is entered by less than 0.05 mm."""
    terrain = pieces(lambda x, y: slope * np.maximum(x, 0.0), *parts, cell=cell)
    for phase in range(5):
        assert deepest(terrain, "marble", -0.05 + phase / 5 * 0.3 / 240, 0.3) < 6e-5, phase


@pytest.mark.parametrize("piece", [a_map, a_mesh, a_deck])
def test_a_wheel_that_just_touches_the_ground_stays_on_it(piece: Piece) -> None:
    assert deepest(pieces(lambda x, y: 0.0 * x, piece), "wheel", -0.25, 0.3) < 2e-5


def mean_speed_at_rest(seed: int, *parts: Piece) -> float:
    """Mean speed of a box near a ridge of about a degree, two seconds after it was put there [m/s]."""
    rng = np.random.default_rng(seed)
    slope, along, fold = np.tan(np.deg2rad(rng.uniform((-1.0, -1.0, 0.2), (1.0, 1.0, 1.2)))).tolist()
    size, yaw = rng.uniform(0.1, 0.5, 3).tolist(), rng.uniform(-3.0, 3.0)
    at = (rng.uniform(-0.5, 0.5) * size[0], rng.uniform(-0.2, 0.2), 0.5 * size[2] + 0.04)
    terrain = pieces(lambda x, y: slope * x + along * y - fold * np.maximum(x, 0.0), *parts)
    speeds = []
    with world_of(terrain, sleep=False, friction=0.6) as world:
        world.spawn("box", Box(*size), 5.0, BodyState(at, about_z(yaw)))
        world.step(480)
        for _ in range(120):
            world.step()
            state = world.state("box")
            speeds.append(np.linalg.norm(state.linear) + 0.5 * max(size) * np.linalg.norm(state.angular))
    return float(np.mean(speeds))


@pytest.mark.parametrize("parts", [(a_map,), *PAIRS])
def test_boxes_on_near_flat_ridges_come_to_rest(parts: tuple[Piece, ...]) -> None:
    """A ridge between two pieces bears a box also while it rocks beyond the slope of a facet."""
    for seed in range(1, 13):
        assert mean_speed_at_rest(seed, *parts) < 2e-3, seed
