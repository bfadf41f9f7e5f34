"""MuJoCo in a process of its own drives a rover on served patches, in step with real time, over DDS."""

import numpy as np
import pytest

from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.testing import domain
from studies.consumer.cases import Case, TrueGround

__all__ = ["domain"]

NEAR = 0.01  # [m]
# The drive is in step with real time: a machine with other work may stall. Drives that were later than this [s] say
# nothing of the ground.
ATTEMPTS, LATE = 3, 0.1


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
    from studies.consumer.run import run_case

    found, in_step = [], False
    for _ in range(ATTEMPTS):
        drive = run_case(case)
        assert drive.messages > 0
        near = float(np.mean(np.abs(drive.clearance) <= NEAR))
        found.append({"lost": drive.lost, "near": near, "way": drive.way, "age": max(drive.ages), "late": drive.late})
        if drive.lost == 0 and near >= 0.99 and drive.way > 5.0:
            return
        in_step |= drive.late < LATE
    if not in_step:
        pytest.skip(f"other work kept this machine from driving in step with real time: {found}")
    pytest.fail(f"no attempt went well: {found}")


@pytest.mark.parametrize("scene", ["waves", "elevation"])
def test_the_ground_around_points_is_part_of_the_whole(scene: str) -> None:
    truth = TrueGround(Case(source="map", scene=scene, start=5.0))
    points = np.array([[0.33, -1.27, 0.0], [0.9, -1.0, 0.0]])
    part = truth.around(points, 0.4, 7.5)
    origin = truth.geometry.origin
    whole = HeightMap(truth.heights(7.5), resolution=truth.geometry.resolution, origin=origin[:2])
    np.testing.assert_allclose(part.below(points), whole.at(points[:, :2], 0.0).heights, atol=1e-5)
