"""Height scans are the ground at the points of their grid, in the layouts that policies were trained with. Around which
frames of bodies and robots: tests of the node's topics of scans."""

import math
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pytest

from smartmesh_ros import BodyState, Box, HeightMap, HeightScan, HeightScanner, MotionConfig, Sphere, Terrain, World
from smartmesh_ros.errors import InputError
from smartmesh_ros.ground.quaternions import product
from smartmesh_ros.terrain.height_scan import LAYOUTS
from smartmesh_ros.terrain.trimesh import TriangleMesh
from tests.bodies import about_y, about_z
from tests.core import mesh_parts
from tests.grounds import level

SIDE, RESOLUTION, LOW = 161, 0.05, -4.0


def wave(time: float, side: int = SIDE) -> np.ndarray:
    x = LOW + RESOLUTION * np.arange(side)
    return 0.2 * np.sin(1.7 * x[None] + 3.0 * time) * np.cos(1.1 * x[:, None] - time)


def moving(motion: MotionConfig | None = None, yaw: float = 0.0) -> HeightMap:
    made = HeightMap(wave(0.0), resolution=RESOLUTION, origin=(LOW, LOW), yaw=yaw, motion=motion)
    for k in range(1, 5):
        made.replace(wave(0.05 * k), time=0.05 * k)
    return made


def sliding() -> Terrain:
    made = Terrain()
    for k in range(4):
        origin = (LOW + 0.03 * k, LOW - 0.02 * k)
        made.put("", HeightMap(wave(0.0), resolution=RESOLUTION, origin=origin, yaw=0.01 * k, time=0.05 * k))
    return made


def holed() -> HeightMap:
    heights = wave(0.0)
    heights[60:75, 70:95] = np.nan
    return HeightMap(heights, resolution=RESOLUTION, origin=(LOW, LOW))


def tiles() -> Terrain:
    """A fine map, a coarse one that lies beside and under it, and one turned, with a gap of less than a cell."""
    made = Terrain()
    made.put("fine", HeightMap(wave(0.0, 81), resolution=RESOLUTION, origin=(-2.0, -2.0)))
    made.put("coarse", HeightMap(1.0 + wave(0.3, 41), resolution=0.1, origin=(-4.0, 0.5)))
    made.put("turned", HeightMap(2.0 + wave(0.3, 41), resolution=0.1, origin=(2.06, -2.0), yaw=0.1))
    return made


GROUNDS = {
    "moving and turned": lambda: moving(yaw=0.3),
    "sliding": sliding,
    "corrected": lambda: moving(MotionConfig(changes="correction")),
    "with holes": holed,
    "tiles": tiles,
    "mesh": lambda: TriangleMesh(*mesh_parts.sheet(8.0, 20, lambda x, y: 0.1 * np.sin(x * y))),
}


def turned(x: float, y: float, z: float, yaw: float, tilt: float = 0.0) -> BodyState:
    """A state turned by ``yaw`` after a ``tilt`` about y, which leaves the yaw as it is."""
    return BodyState((x, y, z), product(about_z(yaw), about_y(tilt)))


@pytest.mark.parametrize("ground", GROUNDS)
def test_a_scan_is_the_ground_at_its_points(ground: str) -> None:
    """Of bodies anywhere, also at and beyond the edge of the ground."""
    rng = np.random.default_rng(3)
    scan = HeightScan(size=(1.1, 0.7), spacing=0.09, offset=(0.2, -0.1, 0.0), order="yx")
    with World(GROUNDS[ground]()) as world:
        world.time = 0.22
        poses = np.column_stack([rng.uniform(-4.5, 4.5, (60, 2)), rng.uniform(0, 2, 60), rng.uniform(-4, 4, 60)])
        names = [f"body_{k}" for k in range(len(poses))]
        for name, pose in zip(names, poses.tolist(), strict=True):
            world.spawn(name, Sphere(0.1), 1.0, turned(*pose, tilt=rng.uniform(-0.6, 0.6)))
        found = world.height_scan(names, scan)
        cos, sin = np.cos(poses[:, 3:]), np.sin(poses[:, 3:])
        x, y = scan.points_b.T
        points = np.stack([poses[:, :1] + x * cos - y * sin, poses[:, 1:2] + x * sin + y * cos], axis=-1)
        wanted = world.ground_at(points.reshape(-1, 2)).z.reshape(found.shape)
        np.testing.assert_allclose(found, wanted, atol=1e-9)
        assert 0 < np.isnan(found).sum() < found.size
        one = world.height_scan(names[7], scan)
        np.testing.assert_array_equal(one, found[7:8])


def above(z: float, hits: np.ndarray, most: float = 1.0) -> np.ndarray:
    """``mdp.height_scan`` of Isaac Lab; a ray that hits nothing has an infinite hit."""
    return np.asarray(np.clip(z - np.where(np.isnan(hits), np.inf, hits) - 0.5, -1.0, most))


def legged_gym(z: float, heights: np.ndarray) -> np.ndarray:
    """``compute_observations`` with obs_scales.height_measurements = 5."""
    return np.asarray(np.clip(z - 0.5 - heights, -1, 1.0) * 5.0)


# The order of the points, as of ``meshgrid``, and the values by the heights of body and ground. The order is that of
# ``grid_pattern`` of isaaclab/sensors/ray_caster/patterns/patterns.py, and of ``_init_height_points`` of
# legged_gym/envs/base/legged_robot.py.
TRAINED: dict[str, tuple[Any, Callable[[float, np.ndarray], np.ndarray]]] = {
    "isaac_lab": ("xy", above),
    "unitree_rl_lab": ("xy", partial(above, most=5.0)),
    "unitree_rl_mjlab": ("xy", lambda z, hits: np.where(np.isnan(hits), 5.0, z - hits) / 5.0),
    "legged_gym": ("ij", legged_gym),
    "unitree_rl_gym": ("ij", legged_gym),
}


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("z", [0.4, 0.7, 2.0])
def test_layouts_are_those_of_the_training(layout: str, z: float) -> None:
    scan, (order, values) = HeightScan.of(layout), TRAINED[layout]
    grid = np.meshgrid(np.linspace(-0.8, 0.8, 17), np.linspace(-0.5, 0.5, 11), indexing=order)
    points = np.stack([axis.ravel() for axis in grid], axis=-1)
    np.testing.assert_allclose(scan.points_b, points, atol=1e-12)
    with World(holed()) as world:
        for name, (x, y) in (("inside", (2.0, 1.5)), ("at the hole", (0.0, -0.6))):
            world.spawn(name, Box(0.6, 0.3, 0.2), 10.0, turned(x, y, z, 0.0))
            hits = world.ground_at(points + [x, y]).z
            assert np.isnan(hits).any() == (name == "at the hole")
            np.testing.assert_allclose(world.height_scan(name, scan)[0], values(z, hits), atol=1e-9)


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize(("distribution", "deviation"), [("uniform", 0.02 / math.sqrt(3.0)), ("normal", 0.02)])
def test_noise_has_its_deviation_and_is_added_before_the_scale(
    world: World, layout: str, distribution: str, deviation: float
) -> None:
    plain = HeightScan.of(layout)
    noisy = HeightScan.of(layout, noise=0.02, distribution=distribution)
    names = [f"body_{k}" for k in range(50)]
    for name in names:
        world.spawn(name, Sphere(0.1), 1.0, BodyState((0.0, 0.0, 0.6)))
    true, first = world.height_scan(names, plain), world.height_scan(names, noisy)
    errors = (first - true) / noisy.scale
    assert errors.std() == pytest.approx(deviation, rel=0.03)
    assert abs(errors.mean()) < 0.001
    if distribution == "uniform":
        assert np.abs(errors).max() <= 0.02 + 1e-12
    # The same at the same instant, and new at another instant or with another seed.
    np.testing.assert_array_equal(world.height_scan(names, noisy), first)
    other = world.height_scan(names, HeightScan.of(layout, noise=0.02, distribution=distribution, seed=1))
    world.skip(1)
    later = world.height_scan(names, noisy)
    for values in (other, later):
        again = (values - true) / noisy.scale
        assert abs(np.corrcoef(again.ravel(), errors.ravel())[0, 1]) < 0.05


@pytest.mark.parametrize("steps", [0, 1, 12])
def test_a_delayed_scan_shows_the_ground_and_the_pose_of_then(steps: int) -> None:
    scan = HeightScan.of("isaac_lab", noise=0.01)
    with World(moving()) as world:
        world.time = 0.2
        state = turned(0.0, 0.0, 0.6, 0.3)
        world.spawn("robot", Sphere(0.1), 1.0, BodyState(state.position, state.orientation, (0.5, 0.2, 0.0)))
        delayed = HeightScanner(world, "robot", HeightScan.of("isaac_lab", noise=0.01, delay=steps * world.dt))
        seen = []
        for number in range(40):
            seen.append(world.height_scan("robot", scan))
            np.testing.assert_array_equal(delayed.read(), seen[max(number - steps, 0)])
            world.step()
        world.reset_time()  # what was measured before is of another time
        np.testing.assert_array_equal(delayed.read(), world.height_scan("robot", scan))


def test_what_cannot_be_scanned_is_refused_and_without_bodies_or_ground_there_is_nothing(world: World) -> None:
    """Poses may be any numbers."""
    world.spawn("robot", Sphere(0.1), 1.0)
    with pytest.raises(InputError, match="there is no body 'rover'"):
        world.height_scan(["robot", "rover"], HeightScan())
    with pytest.raises(InputError, match="HeightScanner"):
        world.height_scan("robot", HeightScan(delay=0.02))
    ground, scan = level(), HeightScan(size=(0.2, 0.2))
    assert scan.read(ground, [(0, 0, 1, 0)], 0.0).tolist() == [[0.0] * 9]
    assert np.isnan(scan.read(ground, [(np.nan, 2, 1, 0), (2, 2, 1, np.inf), (1e300, -1e300, 0, 0)], 0.0)).all()
    assert world.height_scan([], HeightScan()).shape == (0, 187)
    with World() as bare:
        bare.spawn("robot", Sphere(0.1), 1.0)
        assert np.isnan(bare.height_scan("robot", HeightScan(size=(0.0, 0.0)))).tolist() == [[True]]
