"""Undersides of shapes against PyBullet's rays."""

import math

import numpy as np
import pybullet as pb
import pytest
from pybullet_utils.bullet_client import BulletClient

from smartmesh_ros.soil.feet import BOX, CAPSULE, CYLINDER, SPHERE, normal_at, reach, rotation_of, underside

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


@pytest.mark.parametrize("kind", SHAPES)
@pytest.mark.parametrize("spacing", [0.0, 0.02])
def test_normals_stand_on_the_underside_which_lies_within_reach(kind: int, spacing: float) -> None:
    rng = np.random.default_rng(kind)
    half = np.array(SHAPES[kind][1])
    for _ in range(10):
        turn, rotation = rng.standard_normal(4), np.empty((3, 3))
        rotation_of(turn / np.linalg.norm(turn), rotation)
        far = [reach(kind, half, rotation, axis, spacing) for axis in range(2)]
        xy = rng.uniform(-0.5, 0.5, (300, 2))
        found = np.array([underside(kind, half, rotation, x, y, spacing) for x, y in xy])
        assert (np.abs(xy[np.isfinite(found)]) <= far).all()
        errors = []
        for (x, y), z in zip(xy, found, strict=True):
            near = [underside(kind, half, rotation, x + dx, y + dy, spacing) for dx, dy in ((1e-7, 0.0), (0.0, 1e-7))]
            if np.isfinite([z, *near]).all():
                normal = normal_at(kind, half, rotation, x, y, z, spacing)
                assert np.linalg.norm(normal) == pytest.approx(1.0)
                errors += [abs(normal @ np.array(along)) for along in
                           ((1e-7, 0.0, near[0] - z), (0.0, 1e-7, near[1] - z))]  # fmt: skip
        assert len(errors) > 20
        assert np.median(errors) < 1e-12  # against 1e-7; edges between two faces are left out by the median
