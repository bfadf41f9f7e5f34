"""Shapes read from PyBullet hold what PyBullet collides; colliders are planned where the supports say."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pybullet as pb
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pybullet_utils.bullet_client import BulletClient

from smartmesh_ros import Box, Capsule, Cylinder, Sphere
from smartmesh_ros.patches.supports import Support, no_supports
from smartmesh_ros.physics.body_shapes import ball, is_ball, read_shape, shape_record
from smartmesh_ros.physics.colliders.plane import box_size, plan_plane
from smartmesh_ros.physics.colliders.table import COLLIDER, COLLIDERS, MISFIT, NOTHING, POSE, VELOCITY, Limits

SHAPES = (Sphere(0.2), Box(0.2, 0.4, 0.6), Cylinder(0.1, 0.5), Capsule(0.1, 0.5))


@pytest.fixture
def client() -> Iterator[Any]:
    made = BulletClient(pb.DIRECT)
    yield made
    made.disconnect()


@pytest.mark.parametrize("shape", SHAPES)
def test_a_shape_given_is_the_shape_read(client: Any, shape: Any) -> None:
    body = client.createMultiBody(1.0, client.createCollisionShape(**shape.bullet()))
    given_, read = shape_record(shape), read_shape(client, body)
    for name in ("kind", "half_x", "half_y", "half_z", "offset", "radius"):
        np.testing.assert_allclose(read[name], given_[name], atol=1e-9)
    assert read["radius"] == pytest.approx(shape.bounding_radius)
    assert is_ball(read) == isinstance(shape, Sphere)


def test_several_shapes_are_a_box_around_all(client: Any) -> None:
    rng = np.random.default_rng(0)
    for _ in range(20):
        places, turns = rng.normal(scale=0.3, size=(3, 3)), rng.normal(size=(3, 4))
        turns /= np.linalg.norm(turns, axis=1)[:, None]
        form = client.createCollisionShapeArray(
            shapeTypes=[pb.GEOM_BOX, pb.GEOM_SPHERE, pb.GEOM_CYLINDER],
            halfExtents=[[0.1, 0.2, 0.3], [0.0] * 3, [0.0] * 3],
            radii=[0.0, 0.15, 0.1],
            lengths=[0.0, 0.0, 0.4],
            collisionFramePositions=places.tolist(),
            collisionFrameOrientations=turns.tolist(),
        )
        body = client.createMultiBody(1.0, form)
        shape = read_shape(client, body)
        half = np.array([shape["half_x"], shape["half_y"], shape["half_z"]])
        low, high = (np.array(corner) for corner in client.getAABB(body))  # with PyBullet's margin
        assert (shape["offset"] - half <= low + 0.03).all()
        assert (shape["offset"] + half >= high - 0.03).all()
        assert shape["radius"] >= np.abs([low + 0.03, high - 0.03]).max()


def test_a_body_without_a_shape_has_no_size(client: Any) -> None:
    assert read_shape(client, client.createMultiBody(1.0))["radius"] == 0.0


@given(st.floats(1e-4, 1e3))
def test_boxes_are_large_enough_and_of_few_sizes(need: float) -> None:
    size = box_size(need)
    assert COLLIDERS.room * need <= size * (1.0 + 1e-6)
    assert size <= 1.5 * COLLIDERS.room * need
    assert box_size(need * 1.0001) in (size, pytest.approx(size * math.sqrt(2.0)))


def limits(*, carry: bool = True) -> Limits:
    return Limits(5e-5, carry, *(getattr(COLLIDERS, name) for name in Limits._fields[2:]))


def planned(
    normal: np.ndarray, foot: np.ndarray, rise: float, times: list[float], turn: float = 0.0
) -> list[tuple[int, np.ndarray]]:
    """What PyBullet is told at so many times for a plane that rises, and the pose that the box has then."""
    table = np.zeros(1, COLLIDER).view(np.recarray)
    table["extent"] = table["depth"] = 1.0
    support, shape = no_supports(1), np.array([ball(0.2)]).view(np.recarray)
    support["state"], support["rise"], support["margin"], support["turn_x"] = Support.PLANE, rise, 0.01, turn
    for name, value in zip(("facet_x", "facet_y", "facet_z"), normal, strict=True):
        support[name] = value
    pose, velocity, found = np.zeros(7), np.zeros(6), []
    for time in times:
        for name, value in zip(("foot_x", "foot_y", "foot_z"), foot + [0.0, 0.0, rise * time], strict=True):
            support[name] = value
        change = plan_plane(table[0], support[0], shape[0], time, limits(), pose, velocity)
        found.append((int(change), pose.copy()))
    return found


@given(st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0)), st.floats(-5.0, 5.0))
def test_the_top_of_a_box_is_the_plane_of_its_support(slope: tuple[float, float], z: float) -> None:
    normal = np.array([-slope[0], -slope[1], 1.0]) / math.sqrt(1.0 + slope[0] ** 2 + slope[1] ** 2)
    foot = np.array([0.3, -0.4, z])
    [(change, pose)] = planned(normal, foot, 0.0, [0.0])
    assert change == POSE
    turn = np.array(pb.getMatrixFromQuaternion(pose[3:])).reshape(3, 3)
    np.testing.assert_allclose(turn @ [0.0, 0.0, 1.0], normal, atol=1e-9)
    np.testing.assert_allclose(pose[:3] + turn @ [0.0, 0.0, 1.0], foot, atol=1e-9)


def test_steady_ground_is_told_once() -> None:
    up = np.array([0.0, 0.0, 1.0])
    times = [0.0, 0.01, 0.02, 0.03]
    assert [change for change, _ in planned(up, np.zeros(3), 0.0, times)] == [POSE, NOTHING, NOTHING, NOTHING]
    assert [change for change, _ in planned(up, np.zeros(3), 0.5, times)][:2] == [POSE | VELOCITY, NOTHING]


def test_a_box_that_is_too_small_is_a_misfit() -> None:
    table, support = np.zeros(1, COLLIDER).view(np.recarray), no_supports(1)
    table["extent"] = 0.1
    shape = np.array([ball(0.2)]).view(np.recarray)
    assert plan_plane(table[0], support[0], shape[0], 0.0, limits(), np.zeros(7), np.zeros(6)) == MISFIT
