"""Undersides of shapes against PyBullet's rays."""

import math
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pybullet as pb
import pytest

from smartmesh_ros.core import CORE
from smartmesh_ros.core.body_shape import BodyShape
from tests.bodies import random_turn

SHAPES: dict[str, tuple[dict[str, Any], Callable[..., BodyShape]]] = {
    "box": ({"shapeType": pb.GEOM_BOX, "halfExtents": [0.3, 0.2, 0.1]}, partial(BodyShape.box, (0.6, 0.4, 0.2))),
    "ball": ({"shapeType": pb.GEOM_SPHERE, "radius": 0.25}, lambda orientation: BodyShape.ball(0.25)),
    "cylinder": ({"shapeType": pb.GEOM_CYLINDER, "radius": 0.2, "height": 0.3}, partial(BodyShape.cylinder, 0.2, 0.3)),
    "capsule": ({"shapeType": pb.GEOM_CAPSULE, "radius": 0.1, "height": 0.3}, partial(BodyShape.capsule, 0.1, 0.3)),
}


@pytest.mark.parametrize("kind", SHAPES)
def test_undersides_are_where_rays_from_below_meet_the_shape_and_normals_stand_on_them(client: Any, kind: str) -> None:
    rng = np.random.default_rng(list(SHAPES).index(kind) + 1)
    arguments, made = SHAPES[kind]
    body = client.createMultiBody(1.0, client.createCollisionShape(**arguments))
    slopes: dict[float, list[float]] = {0.0: [], 0.02: []}
    for spacing in [0.0] * 10 + [0.02] * 10:
        turn, xy = random_turn(rng), rng.uniform(-0.4, 0.4, (200, 2))
        shape = made(orientation=turn)
        table, *far = CORE.shape_above_grid(shape, xy, spacing)
        found, normals = table[:, 0], table[:, 1:4]
        assert (np.abs(xy[np.isfinite(found)]) <= far).all()
        for step in ((1e-7, 0.0), (0.0, 1e-7)):
            near = CORE.shape_above_grid(shape, xy + step, spacing)[0][:, 0]
            there = np.isfinite(found) & np.isfinite(near)
            assert np.linalg.norm(normals[there], axis=1) == pytest.approx(1.0)
            along = np.column_stack([np.broadcast_to(step, (there.sum(), 2)), near[there] - found[there]])
            slopes[spacing] += np.abs((normals[there] * along).sum(axis=1)).tolist()
        if spacing:  # rays know of no spacing of samples
            continue
        client.resetBasePositionAndOrientation(body, (0, 0, 0), turn.tolist())
        starts, ends = np.column_stack([xy, np.full(200, -5.0)]), np.column_stack([xy, np.full(200, 5.0)])
        hits = client.rayTestBatch(starts.tolist(), ends.tolist())
        met = np.array([hit[3][2] if hit[0] == body else math.inf for hit in hits])
        both = np.isfinite(found) & np.isfinite(met)
        assert (np.isfinite(found) == np.isfinite(met)).mean() > 0.97  # rays along an edge may go either way
        assert both.sum() > 10
        assert np.median(np.abs(found[both] - met[both])) < 1e-3
        assert np.abs(found[both] - met[both]).max() < 2e-2  # PyBullet rounds edges by its margin
    for errors in slopes.values():
        assert len(errors) > 200
        assert np.median(errors) < 1e-12  # against 1e-7; edges between two faces are left out by the median


@pytest.mark.parametrize("lean", [0.3, 0.72, 0.87, 0.92, 1.2])
def test_how_far_a_leaning_cylinder_is_turned_about_its_own_axis_changes_nothing(lean: float) -> None:
    xy = np.stack(np.meshgrid(*[np.linspace(-0.3, 0.3, 31)] * 2), axis=-1).reshape(-1, 2)
    found = []
    for spin in (0.0, 0.4, 0.25 * math.pi):
        turn = pb.multiplyTransforms(
            (0, 0, 0), pb.getQuaternionFromEuler((lean, 0, 0)), (0, 0, 0), pb.getQuaternionFromEuler((0, 0, spin))
        )[1]
        table = CORE.shape_above_grid(BodyShape.cylinder(0.15, 0.2, orientation=turn), xy, 0.02)[0]
        found.append(table[np.isfinite(table[:, 0])][:, [0, 4]])  # heights and shares
    for other in found[1:]:
        assert other == pytest.approx(found[0], abs=1e-5)
