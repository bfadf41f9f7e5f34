"""MuJoCo in a process of its own drives a rover on served patches, in step with real time, over DDS."""

import math

import numpy as np
import pytest

from smartmesh_ros.client import Patch
from smartmesh_ros.studies.consumer.cases import Case, TrueGround
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.trimesh import grid_triangles
from smartmesh_ros.testing import domain

__all__ = ["domain"]

NEAR = 0.01  # [m]
# The drive is in step with real time: a machine with other work may stall for once.
ATTEMPTS = 3


@pytest.mark.parametrize(
    "case",
    [
        Case(source="patches", scene="waves", map_rate=20.0),
        Case(source="patches", scene="waves", map_rate=60.0),
        Case(source="patches", scene="elevation"),
    ],
    ids=lambda case: f"{case.scene}-{case.map_rate:g}",
)
def test_wheels_keep_to_the_true_ground(domain: int, case: Case) -> None:
    pytest.importorskip("mujoco")
    from smartmesh_ros.studies.consumer.run import run_case

    found = []
    for _ in range(ATTEMPTS):
        drive = run_case(case)
        assert drive.messages > 0
        near = float(np.mean(np.abs(drive.clearance) <= NEAR))
        found.append({"lost": drive.lost, "near": near, "way": drive.way, "age": max(drive.ages), "late": drive.late})
        if drive.lost == 0 and near >= 0.99 and drive.way > 5.0:
            return
    pytest.fail(f"no attempt went well: {found}")


def test_a_field_in_mujoco_is_the_surface_of_its_patch() -> None:
    """Rays cast down on it hit the patch's triangles, wherever the patch lies and however it is turned."""
    mujoco = pytest.importorskip("mujoco")
    from smartmesh_ros.studies.consumer.rover import Rover
    from smartmesh_ros.studies.consumer.served_ground import ServedGround, write_field

    rows, columns, step, yaw = 6, 9, 0.1, 0.4
    heights = np.random.default_rng(2).normal(0.0, 0.1, (rows, columns)).astype(np.float32)
    r, c = np.mgrid[:rows, :columns]
    cos, sin = math.cos(yaw), math.sin(yaw)
    x, y = 3.0 + step * (c * cos - r * sin), -2.0 + step * (c * sin + r * cos)
    patch = Patch(
        name="wheel", kind="heightfield", tile="", row=0, column=0, stride=1, deviation=0.0, linear_w=np.zeros(3),
        angular_w=np.zeros(3), vertices_w=np.stack([x, y, heights], axis=-1).reshape(-1, 3),
        triangles=grid_triangles(rows, columns).astype(np.uint32),
    )  # fmt: skip
    assert patch.shape == (rows, columns)
    rover = Rover(ServedGround.fields())
    write_field(rover.model, rover.data, 0, patch)
    mujoco.mj_forward(rover.model, rover.data)
    [geom] = np.flatnonzero(rover.model.geom_bodyid == rover.model.body("ground_front_left").id)
    flat = HeightMap(heights, resolution=step)
    for own_x, own_y in np.random.default_rng(3).uniform([0.01, 0.01], [0.79, 0.49], (50, 2)):
        at = np.array([3.0 + own_x * cos - own_y * sin, -2.0 + own_x * sin + own_y * cos, 5.0])
        distance = mujoco.mj_rayHfield(rover.model, rover.data, int(geom), at, np.array([0.0, 0.0, -1.0]), np.zeros(3))
        expected = flat.at([[own_x, own_y]], 0.0).heights[0]
        assert at[2] - distance == pytest.approx(expected, abs=2e-5)


@pytest.mark.parametrize("scene", ["waves", "elevation"])
def test_the_ground_around_points_is_part_of_the_whole(scene: str) -> None:
    truth = TrueGround(Case(source="map", scene=scene, start=5.0))
    points = np.array([[0.33, -1.27, 0.0], [0.9, -1.0, 0.0]])
    part = truth.around(points, 0.4, 7.5)
    origin = truth.geometry.origin
    whole = HeightMap(truth.heights(7.5), resolution=truth.geometry.resolution, origin=origin[:2])
    np.testing.assert_allclose(part.below(points), whole.at(points[:, :2], 0.0).heights, atol=1e-5)
