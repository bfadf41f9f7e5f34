"""Bodies on, under and beside a table: meshes of several parts, and height maps and meshes together."""

import math
from typing import Any

import pytest

from smartmesh_ros import BodyState, Box, Terrain
from smartmesh_ros.ground.shapes import Capsule, Cylinder, Shape, Sphere
from smartmesh_ros.terrain.trimesh import TriangleMesh
from tests.core import mesh_parts
from tests.grounds import level, terrain_of, world_of

LYING = (math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))  # with its axis along y
SHAPES: list[tuple[Shape, tuple[float, ...], float]] = [
    (Sphere(0.2), (0.0, 0.0, 0.0, 1.0), 0.2),
    (Box(0.4, 0.3, 0.2), (0.0, 0.0, math.sin(0.3), math.cos(0.3)), 0.1),
    (Cylinder(radius=0.1, height=0.3), (0.0, 0.0, 0.0, 1.0), 0.15),
    (Cylinder(radius=0.1, height=0.3), LYING, 0.1),
    (Capsule(radius=0.1, height=0.3), LYING, 0.1),
]


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
