"""Bodies on, under and beside a table: meshes of several parts, and height maps and meshes together."""

from typing import Any

import numpy as np
import pytest

from smartmesh_ros import BodyState, Box, HeightMap, Terrain
from smartmesh_ros.ground.shapes import Shape
from smartmesh_ros.terrain.trimesh import TriangleMesh
from tests.core import mesh_parts
from tests.ground.test_from_map import SHAPES, world_of
from tests.grounds import level, terrain_of
from tests.urdfs import HUSKY


def table(thickness: float = 0.02) -> TriangleMesh:
    """A floor, and a table of 1 m x 1 m whose top is 0.6 m above the floor; of thickness 0 one sheet."""
    return TriangleMesh(*mesh_parts.joined(mesh_parts.sheet(6.0, 1), tabletop(thickness)))


def tabletop(thickness: float) -> mesh_parts.Parts:
    top = mesh_parts.box((-0.5, -0.5, 0.6 - thickness), (0.5, 0.5, 0.6))
    if thickness == 0.0:
        top = mesh_parts.sheet(1.0, 3)
        top[0][:, 2] = 0.6
    return top


def table_over_a_map() -> Terrain:
    return terrain_of(floor=level(61), table=TriangleMesh(*tabletop(0.02)))


@pytest.mark.parametrize("ground", [table(0.0), table(0.002), table(0.05), table_over_a_map()],
                         ids=["sheet", "2 mm", "5 cm", "over a map"])  # fmt: skip
@pytest.mark.parametrize(("shape", "turn", "height"), SHAPES)
def test_bodies_rest_on_a_table_and_under_it_as_the_ground_says(
    shape: Shape, turn: Any, height: float, ground: TriangleMesh | Terrain
) -> None:
    with world_of(ground) as world:
        places = {"on": (0.1, 0.05, 0.6), "under": (0.05, 0.1, 0.0), "beside": (1.5, 0.0, 0.0)}
        for name, (x, y, z) in places.items():
            world.spawn(name, shape, 1.0, BodyState((x, y, z + height + 0.02), turn))
        world.step(960)
        for name, (_, _, z) in places.items():
            centre = world.state(name).position
            below = float(world.ground.at([centre], world.time).z[0])
            assert below == pytest.approx(z, abs=1e-9)
            assert centre[2] - height == pytest.approx(below, abs=2e-5)
        assert world.rescues == 0


def test_what_sleeps_under_a_table_wakes_when_its_floor_falls() -> None:
    mesh = table()
    with world_of(mesh) as world:
        world.spawn("box", Box(0.4, 0.3, 0.2), 1.0, BodyState((0.0, 0.0, 0.1)))
        world.step(480)
        assert world.is_asleep("box")
        lowered = mesh.vertices - np.where(np.arange(mesh.size) < 4, 0.5, 0.0)[:, None] * [0.0, 0.0, 1.0]
        mesh.move(lowered, time=world.time + 100.0)
        world.step(480)
        assert world.state("box").position[2] == pytest.approx(-0.4, abs=1e-3)


def test_a_robot_drives_over_a_mesh_as_over_the_same_height_map() -> None:
    def height(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.asarray(0.03 * np.sin(3.0 * x) * np.cos(2.0 * y))

    x, y = np.meshgrid(*[np.linspace(-4.0, 4.0, 161)] * 2)
    heightmap = HeightMap(height(x, y), resolution=0.05, origin=(-4.0, -4.0))
    places = []
    for terrain in (heightmap, TriangleMesh(*mesh_parts.soup(mesh_parts.sheet(8.0, 160, height)))):
        with world_of(terrain) as world:
            world.spawn_robot("husky", HUSKY, BodyState((-1.0, 0.0, 0.25)))
            for wheel in world.bodies["husky"].joints:
                world.drive("husky", wheel, 4.0)
            world.step(720)
            places.append(world.state("husky").position)
    assert places[0][0] > 0.5
    assert places[0] == pytest.approx(places[1], abs=2e-3)
