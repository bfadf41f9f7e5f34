"""Several maps make one terrain: patches cross from tile to tile without a step or a hole."""

import math
import resource
from itertools import pairwise

import numpy as np
import pytest

from smartmesh_ros import BodyState, Box, GridGeometry, HeightMap, Sphere, Terrain, World
from smartmesh_ros.core import CORE
from smartmesh_ros.core.body_shape import BodyShape
from smartmesh_ros.terrain.grid import FloatArray
from tests.ground.test_shown_patches import balls_on
from tests.grounds import patch_of, terrain_of, world_of


def surface(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """A plane, which triangles of any grid represent exactly."""
    return 0.2 * x - 0.1 * y + 0.5


def tile(x0: float, y0: float, rows: int, columns: int, resolution: float, yaw: float = 0.0) -> HeightMap:
    geometry = GridGeometry(rows=rows, columns=columns, resolution=resolution, origin=(x0, y0, 0.0), yaw=yaw)
    place = geometry.to_world(*np.indices((rows, columns)))
    return HeightMap(surface(place[..., 0], place[..., 1]), geometry=geometry)


ADJACENT = {
    "sharing an edge": lambda: terrain_of(west=tile(-10, -5, 51, 51, 0.2), east=tile(0, -5, 51, 51, 0.2)),
    "a cell apart": lambda: terrain_of(west=tile(-10.2, -5, 51, 51, 0.2), east=tile(0, -5, 51, 51, 0.2)),
    "overlapping": lambda: terrain_of(west=tile(-9, -5, 51, 51, 0.2), east=tile(0, -5, 51, 51, 0.2)),
    "finer": lambda: terrain_of(west=tile(-10, -5, 51, 51, 0.2), east=tile(0, -5, 101, 101, 0.1)),
    "a coarse cell apart": lambda: terrain_of(west=tile(-10, -5, 51, 51, 0.2), east=tile(0.5, -5, 21, 21, 0.5)),
    "turned": lambda: terrain_of(west=tile(-10, -5, 51, 51, 0.2), east=tile(-0.5, -6, 61, 61, 0.2, yaw=0.1)),
}


@pytest.mark.parametrize("name", ADJACENT)
@pytest.mark.parametrize("radius", [0.15, 0.5])
def test_patches_that_cross_a_border_have_no_step_and_no_hole(name: str, radius: float) -> None:
    x, y = np.linspace(-2.0, 2.0, 81), np.full(81, 0.03)
    positions = np.column_stack([x, y, surface(x, y) + 0.9 * radius])
    table = balls_on(ADJACENT[name](), [radius] * 81).at(positions)
    for index, body in enumerate(table.slots.tolist()):
        points = patch_of(table, index)[0]
        assert not np.isnan(points).any()
        np.testing.assert_allclose(points[:, 2], surface(points[:, 0], points[:, 1]), atol=1e-4)
        # It reaches as far over the border as within the tile.
        for axis in (0, 1):
            assert points[:, axis].min() <= positions[body, axis] - 0.99 * radius
            assert points[:, axis].max() >= positions[body, axis] + 0.99 * radius
    assert table.slots.tolist() == list(range(81))
    assert set(table.tiles) == {"west", "east"}


@pytest.mark.parametrize("name", ADJACENT)
def test_boxes_slide_across_a_border_as_over_one_map(name: str) -> None:
    """Down a frictionless plane: the speed after a second is g sin(slope) t, border or not."""
    with world_of(ADJACENT[name](), friction=0.0) as world:
        for index, y in enumerate(np.linspace(-2.0, 2.0, 9).tolist()):
            start = BodyState((0.6 + 0.013 * index, y, 0.0))
            world.spawn(f"box_{index}", Box(0.3, 0.3, 0.2), 1.0, start, on_ground=True, align=True)
        world.step(240)
        states = [world.state(box) for box in world.bodies]
    slope = math.hypot(0.2, 0.1)
    expected = 9.81 * slope / math.sqrt(1.0 + slope**2)
    assert [math.hypot(*state.linear) for state in states] == pytest.approx([expected] * 9, rel=0.001)
    assert all(state.position[0] < 0.0 for state in states), "they have crossed the border"


@pytest.mark.parametrize("gap", [-0.4, 0.0, 0.2])
def test_tiles_side_by_side_end_where_one_map_does(gap: float) -> None:
    """A gap is between maps: beyond the outer edge of both, balls roll off."""
    beyond = np.linspace(-0.5, 0.5, 21)

    def rolled(terrain: Terrain) -> FloatArray:
        for y in (5.01, 5.1, 5.19):
            assert np.isnan(terrain.at(np.column_stack([beyond, np.full(21, y)]), time=0.0).heights).all()
        with World(terrain) as world:
            for k, x in enumerate(beyond):
                world.spawn(f"{k}", Sphere(0.15), 1.0, BodyState((x, 5.01, 0.16 + surface(x, 5.0))))
            world.step(60)
            return np.array([world.state(f"{k}").position for k in range(21)])

    two = terrain_of(west=tile(-10, -5, 51, 51, 0.2), east=tile(gap, -5, 51, 51, 0.2))
    one = terrain_of(whole=tile(-10, -5, 51, 101, 0.2))
    np.testing.assert_allclose(rolled(two), rolled(one), atol=1e-6)


def test_a_tile_that_comes_is_replaced_or_goes_is_what_its_bodies_stand_on() -> None:
    terrain = terrain_of(west=tile(-10, -5, 51, 51, 0.2))
    with World(terrain) as world:
        for name, x in (("west", -3.0), ("east", 3.0)):
            world.spawn(name, Sphere(0.2), 1.0, BodyState((x, 0.0, 0.7 + 0.2 * x)))
        for change, tiles in (
            (lambda: None, ["west"]),
            (lambda: terrain.put("east", tile(0, -5, 51, 51, 0.2)), ["west", "east"]),
            (lambda: terrain.put("east", tile(0, -5, 101, 101, 0.1)), ["west", "east"]),
            (lambda: terrain.remove("west"), ["east"]),
        ):
            change()
            assert world.patches().table().tiles == tiles


def test_a_body_stays_with_its_tile_where_tiles_overlap() -> None:
    terrain = ADJACENT["overlapping"]()
    bodies, tiles = balls_on(terrain, [0.2]), []
    for x in (*np.linspace(-2.0, 2.0, 41), *np.linspace(2.0, -2.0, 41)):
        tiles += bodies.at(np.array([[x, 0.0, 0.5 + 0.2 * x]])).tiles
    assert [tiles[0], tiles[40], tiles[-1]] == ["west", "east", "west"]
    assert sum(a != b for a, b in pairwise(tiles)) == 2


def test_features_at_a_seam_keep_their_names_while_the_body_moves() -> None:
    """So that a contact is found again, and starts with its impulse of the last step."""
    grids = [tile(x, -0.5, 11, 11, 0.1).core_reader for x in (-1.0, 0.0)]
    names = set()
    for x in np.linspace(-0.3, 0.3, 25):
        # A ball above a sample of the seam, in a window that is the larger the faster the ball goes along it.
        pose = np.vstack([np.eye(3), [0.0, 0.0, float(surface(np.float64(0.0), np.float64(0.0))) + 0.19]])
        motion = np.array([[60.0 * x, 0.0, 0.0], [0.0, 0.0, 0.0]])
        found = CORE.find_contacts(BodyShape.ball(0.2), grids, pose, motion, 0.01, 0.02)
        names |= {(round(float(row[0]), 6), round(float(row[1]), 6), row[8]) for row in found}
    assert names and len(names) == len({place[:2] for place in names})


def test_a_fast_body_over_two_fine_tiles_reads_only_what_is_there() -> None:
    """Without a limit 41 m x 41 m at 1 cm would be 17 million samples, or half a gigabyte."""
    terrain = terrain_of(west=tile(-0.5, -0.5, 51, 51, 0.01), east=tile(0.0, -0.5, 51, 51, 0.01))
    with World(terrain) as world:
        world.spawn("fast", Sphere(0.2), 1.0, BodyState((0.0, 0.0, 5.0), linear=(7000.0, 7000.0, -2000.0)))
        before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        world.step(2)
        assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 100_000  # [KiB]
