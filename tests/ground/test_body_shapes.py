"""Shapes read from PyBullet hold what PyBullet collides."""

from pathlib import Path
from typing import Any

import numpy as np
import pybullet as pb
import pybullet_data
import pytest

from smartmesh_ros import Box, Capsule, Cylinder, Sphere
from smartmesh_ros.ground.body_shapes import read_shapes
from tests.bodies import ground_of, height, lowest_of, put, random_turn, run
from tests.grounds import level
from tests.urdfs import box, link, robot

SHAPES = (Sphere(0.2), Box(0.2, 0.4, 0.6), Cylinder(radius=0.1, height=0.5), Capsule(radius=0.1, height=0.5))
# By which Bullet rounds the boxes and cylinders of links, and the least margin that can be set, of several shapes [m].
ROUNDING, LEAST_MARGIN = 1e-3, 1e-5
FLOOR = Box(100.0, 100.0, 100.0)  # whose top is at zero
# A link of several shapes, each at a place of its own and turned.
SEVERAL = link(
    "base", box((0.2, 0.4, 0.6)), at="0.3 -0.1 0.2", rpy="0.3 -0.8 1.9",
    more='<collision><origin xyz="-0.2 0.4 0"/><geometry><sphere radius="0.15"/></geometry></collision>'
    '<collision><origin xyz="0 -0.3 0.2" rpy="1.1 0.4 0"/><geometry><cylinder radius="0.1" length="0.4"/></geometry>'
    '</collision><collision><origin xyz="0.1 0.3 0.2" rpy="1.1 0.4 0"/><geometry><capsule radius="0.1" length="0.9"/>'
    "</geometry></collision>",
)  # fmt: skip


@pytest.mark.parametrize("maximal", [False, True])
@pytest.mark.parametrize("shape", SHAPES)
def test_a_shape_given_is_the_shape_read(client: Any, shape: Any, maximal: bool) -> None:
    """Also where PyBullet does not report it."""
    body = put(client, shape, (0.0, 0.0, 0.0), useMaximalCoordinates=maximal)
    given_, read = shape.body_shape, read_shapes(client, body)[-1]
    for name in ("kind", "half", "rounding", "offset", "radius"):
        np.testing.assert_allclose(getattr(read, name), getattr(given_, name), atol=1e-9)
    assert read.radius == pytest.approx(shape.bounding_radius)


@pytest.mark.parametrize("flags", [0, pb.URDF_USE_IMPLICIT_CYLINDER])
@pytest.mark.parametrize("urdf", ["husky/husky", "laikago/laikago", "mini_cheetah/mini_cheetah", "a1/a1", "r2d2", ""])
def test_links_reach_as_far_as_they_do_in_bullet(client: Any, tmp_path: Path, urdf: str, flags: int) -> None:
    """Wheels, hulls in frames of their own, meshes of many parts, and several shapes."""
    rng, floor = np.random.default_rng(1), put(client, FLOOR, (0.0, 0.0, -50.0), 0.0)
    (tmp_path / "several.urdf").write_text(robot(SEVERAL))
    file = f"{pybullet_data.getDataPath()}/{urdf}.urdf" if urdf else str(tmp_path / "several.urdf")
    loaded = client.loadURDF(file, flags=flags)
    links = {index for index in range(-1, client.getNumJoints(loaded)) if client.getCollisionShapeData(loaded, index)}
    for index in links:
        client.changeDynamics(loaded, index, collisionMargin=LEAST_MARGIN)
    shapes = read_shapes(client, loaded)
    assert shapes.keys() == links
    for _ in range(6 if urdf else 60):
        client.resetBasePositionAndOrientation(loaded, (0.0, 0.0, 3.0), random_turn(rng))
        for index, shape in shapes.items():
            found = (
                client.getBasePositionAndOrientation(loaded) if index < 0 else client.getLinkState(loaded, index, 0, 1)
            )
            lowest = min(float(point[8]) for point in client.getClosestPoints(loaded, floor, 50.0, index, -1))
            exact = ROUNDING if urdf else LEAST_MARGIN
            assert lowest_of(shape, np.array(found[0]), np.array(found[1])) == pytest.approx(lowest, abs=exact)


def test_a_margin_that_changes_after_the_first_contact_counts(client: Any) -> None:
    corners = np.array(np.meshgrid([-0.2, 0.2], [-0.2, 0.2], [-0.2, 0.2])).reshape(3, 8).T
    form = client.createCollisionShape(pb.GEOM_MESH, vertices=corners.tolist())
    body, heights = client.createMultiBody(1.0, form, basePosition=[0.0, 0.0, 0.22]), []
    ground = ground_of(client, level(), body)
    for margin in (0.001, 0.05):
        client.changeDynamics(body, -1, collisionMargin=margin)
        run(ground)
        heights.append(height(client, body))
    assert heights[1] - heights[0] == pytest.approx(0.049, abs=1e-3)
