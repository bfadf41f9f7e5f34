"""Undersides of shapes against PyBullet's rays."""

import math

import numpy as np
import pybullet as pb
import pytest
from pybullet_utils.bullet_client import BulletClient

from smartmesh_ros.soil.feet import BOX, CAPSULE, CYLINDER, SPHERE, rotation_of, underside

SHAPES = {
    BOX: ({"shapeType": pb.GEOM_BOX, "halfExtents": [0.3, 0.2, 0.1]}, [0.3, 0.2, 0.1]),
    SPHERE: ({"shapeType": pb.GEOM_SPHERE, "radius": 0.25}, [0.25, 0.25, 0.0]),
    CYLINDER: ({"shapeType": pb.GEOM_CYLINDER, "radius": 0.2, "height": 0.3}, [0.2, 0.2, 0.15]),
    CAPSULE: ({"shapeType": pb.GEOM_CAPSULE, "radius": 0.1, "height": 0.3}, [0.1, 0.1, 0.15]),
}


@pytest.mark.parametrize("kind", SHAPES)
def test_undersides_are_where_rays_from_below_meet_the_shape(kind: int) -> None:
    client = BulletClient(pb.DIRECT)
    rng = np.random.default_rng(kind)
    arguments, half = SHAPES[kind]
    body = client.createMultiBody(1.0, client.createCollisionShape(**arguments))
    try:
        for _ in range(10):
            turn = rng.standard_normal(4)
            turn /= np.linalg.norm(turn)
            client.resetBasePositionAndOrientation(body, (0, 0, 0), turn.tolist())
            xy = rng.uniform(-0.4, 0.4, (200, 2))
            starts, ends = np.column_stack([xy, np.full(200, -5.0)]), np.column_stack([xy, np.full(200, 5.0)])
            hits = client.rayTestBatch(starts.tolist(), ends.tolist())
            rotation = np.empty((3, 3))
            rotation_of(turn, rotation)
            found = np.array([underside(kind, np.array(half), rotation, x, y, 0.0) for x, y in xy])
            met = np.array([hit[3][2] if hit[0] == body else math.inf for hit in hits])
            both = np.isfinite(found) & np.isfinite(met)
            assert (np.isfinite(found) == np.isfinite(met)).mean() > 0.97  # rays along an edge may go either way
            assert both.sum() > 10
            assert np.median(np.abs(found[both] - met[both])) < 1e-3
            assert np.abs(found[both] - met[both]).max() < 2e-2  # PyBullet rounds edges by its margin
    finally:
        client.disconnect()
