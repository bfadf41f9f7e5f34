"""MuJoCo drives a rover on served patches, over DDS."""

from __future__ import annotations

import math
from collections.abc import Callable
from time import monotonic
from typing import Any

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from smartmesh_msgs.msg import Heightmap
from smartmesh_msgs.srv import StepPhysics
from std_srvs.srv import SetBool

from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.tools.testing import TIMEOUT, Probe, domain, heightmap_message, probe
from studies.consumer.cases import COLLIDER, Case, TrueGround
from studies.consumer.served_ground import WHEELS, ServedGround

__all__ = ["domain", "probe"]

NEAR = 0.01  # [m]
RATE = 62.5  # of the node's steps [Hz]
# Minimum mean speed of the rover [m/s], which is driven at 0.6. Waves change it, depending on their phase at the start:
# 0.47 to 0.70 in 6 s.
SPEED = {"waves": 0.4, "elevation": 0.5}


class SteppedGround(ServedGround):
    """Patches of a paused node that is stepped for each part of the drive: the clock is simulated time, so that the
    machine may be as slow as it is."""

    def __init__(self, case: Case, truth: TrueGround) -> None:
        super().__init__()
        self._case, self._truth = case, truth
        self._step = self.client.node.create_client(StepPhysics, f"{COLLIDER}/step")
        self._maps = self.client.node.create_publisher(Heightmap, f"{COLLIDER}/heightmap", 10)
        self._wait_for(lambda: self._step.service_is_ready() and self._maps.get_subscription_count())
        self._time = self._next_map = 0.0

    def now(self) -> float:
        """Simulated time [s]."""
        return self._time

    def ready(self, rover: Any) -> bool:
        """Tells the node of the wheels; whether each has its patch."""
        self.client.track(rover.links(), self._time)
        return self.client.patches(self._time).keys() >= set(WHEELS)

    def spin(self, timeout: float) -> None:
        """Has the node simulate ``timeout`` [s], in whole steps, and takes its patches; publishes the map when due."""
        if timeout <= 0.0:
            return
        before, steps = self._stamp(), max(1, math.ceil(timeout * RATE - 1e-6))
        answer = self._step.call_async(StepPhysics.Request(steps=steps))
        self._wait_for(lambda: answer.done() and self._stamp() >= before + steps / RATE - 1e-6)
        assert answer.result().success, answer.result().message
        self._time = self._stamp()
        if self._time >= self._next_map:
            self._next_map = self._time + 1.0 / self._case.map_rate - 1e-6
            stamp = Time(sec=int(self._time), nanosec=round(self._time % 1.0 * 1e9))
            geometry, heights = self._truth.geometry, self._truth.heights(self._time)
            options = {"resolution": geometry.resolution, "origin": geometry.origin, "stamp": stamp}
            self._maps.publish(heightmap_message(heights, **options))

    def _wait_for(self, condition: Callable[[], Any]) -> None:
        end = monotonic() + TIMEOUT
        while not condition():
            assert monotonic() < end
            self.client.spin_once(0.02)

    def _stamp(self) -> float:
        """Stamp of the newest patches [s]; 0 before the first."""
        age = self.client.age(0.0)
        return 0.0 if math.isinf(age) else -age


@pytest.mark.parametrize(
    "case",
    [
        Case(source="patches", scene="waves", map_rate=20.0, seconds=10.0),
        Case(source="patches", scene="waves", map_rate=60.0, seconds=6.0),
        Case(source="patches", scene="elevation", seconds=10.0),
    ],
    ids=lambda case: f"{case.scene}-{case.map_rate:g}",
)
def test_wheels_keep_to_the_true_ground(probe: Probe, case: Case) -> None:
    pytest.importorskip("mujoco")
    from studies.consumer.drive import drive_on

    settings = {**case.parameters(), "physics.rate": RATE, "publish.clock": RATE, "bodies.timeout": 600.0}
    truth = TrueGround(case)
    with probe.running(parameters=settings):
        assert probe.call("pause", SetBool, data=True).success
        ground = SteppedGround(case, truth)
        try:
            drive = drive_on(case, truth, ground)
        finally:
            ground.close()
    assert drive.messages > 0
    assert drive.lost == 0
    assert float(np.mean(np.abs(drive.clearance) <= NEAR)) >= 0.99
    assert drive.way > SPEED[case.scene] * case.seconds


def test_a_case_runs_between_processes(domain: int) -> None:
    """In step with real time, which may leave a wheel without ground on a busy machine."""
    pytest.importorskip("mujoco")
    from studies.consumer.run import run_case

    drive = run_case(Case(source="patches", scene="waves", seconds=2.5))
    assert drive.messages > 0
    assert drive.way > 0.5
    assert len(drive.ages) == 1250
    assert drive.node > 0.0


@pytest.mark.parametrize("scene", ["waves", "elevation"])
def test_the_ground_around_points_is_part_of_the_whole(scene: str) -> None:
    truth = TrueGround(Case(source="map", scene=scene, start=5.0))
    points = np.array([[0.33, -1.27, 0.0], [0.9, -1.0, 0.0]])
    part = truth.around(points, 0.4, 7.5)
    origin = truth.geometry.origin
    whole = HeightMap(truth.heights(7.5), resolution=truth.geometry.resolution, origin=origin[:2])
    np.testing.assert_allclose(part.below(points), whole.at(points[:, :2], 0.0).heights, atol=1e-5)
