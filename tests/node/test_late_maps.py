"""Maps whose stamps are old on arrival: by a slow link or pipeline, or because two clocks differ."""

import math
import time
from collections import deque
from functools import partial
from typing import Any, get_args

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from numpy.typing import NDArray
from smartmesh_msgs.srv import QueryGround

from smartmesh_ros.node.timing.pacing import Pacer
from smartmesh_ros.node.timing.stamps import StampClock
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.motion import MotionConfig, MotionMode
from smartmesh_ros.terrain.trimesh import TriangleMesh
from smartmesh_ros.tools.testing import Probe

PERIOD = 1 / 240
SPEED = 0.1
CORNERS = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
SQUARE = np.array([[0, 1, 2], [0, 2, 3]])
POINT = np.zeros((1, 2))


class Source:
    """Maps of ground that rises, stamped when they are sent, which arrive in order ``late(k)`` [s] after that."""

    def __init__(self, rate: float, late: NDArray[np.float64], behind: float = 0.0) -> None:
        sent = np.arange(len(late)) / rate
        self.arrivals = np.maximum.accumulate(sent + late)
        self.stamps = sent + 100.0 - behind
        self.heights = SPEED * sent


def velocities(source: Source, ground: HeightMap | TriangleMesh, seconds: float) -> NDArray[np.float64]:
    """Velocities [m/s] of ground that takes the source's maps, at each step from two seconds on."""
    now = [100.0]
    pacer, clock = Pacer(PERIOD, "catch_up", lambda: now[0]), StampClock()
    simulated, taken, found = 0.0, 0, []
    horizon = ground.motion.max_interval
    while now[0] < 100.0 + seconds:
        while taken < len(source.arrivals) and source.arrivals[taken] + 100.0 <= now[0] + pacer.remaining():
            now[0] = max(now[0], source.arrivals[taken] + 100.0)
            placed = clock.place(source.stamps[taken], now[0], partial(time_at, pacer, simulated), 0.0, horizon)
            take(ground, source.heights[taken], placed.time)
            clock.accept(placed)
            ground.delay = clock.delay
            taken += 1
        now[0] += max(pacer.remaining(), 0.0)
        pacer.advance()
        if now[0] > 102.0:
            found.append(velocity(ground, simulated))
        simulated += PERIOD
    return np.array(found)


def time_at(pacer: Pacer, next_step: float, age: float) -> float:
    return pacer.simulated_at(age, next_step)


def take(ground: HeightMap | TriangleMesh, height: float, time: float) -> None:
    if isinstance(ground, HeightMap):
        ground.replace(np.full((3, 3), height), time=time)
    else:
        ground.move(np.column_stack([CORNERS, np.full(4, height)]), time=time)


def velocity(ground: HeightMap | TriangleMesh, time: float) -> float:
    if isinstance(ground, HeightMap):
        return float(ground.at(POINT, time).velocities[0])
    return float(ground.sample(np.array([0]), time).velocities[0, 2])


def heightmap(mode: MotionMode = "extrapolate") -> HeightMap:
    return HeightMap(np.zeros((3, 3)), resolution=1.0, origin=(-1.0, -1.0), time=-100.0, motion=MotionConfig(mode=mode))


LATE = [0.0, 0.02, 0.1, 0.15, 0.3, 0.5, 0.7, 0.95, 1.0, 1.05, 3.0]


def mesh() -> TriangleMesh:
    return TriangleMesh(np.column_stack([CORNERS, np.zeros(4)]), SQUARE, time=-100.0)


@pytest.mark.parametrize("ground", [*(partial(heightmap, mode) for mode in get_args(MotionMode)), mesh])
@pytest.mark.parametrize("rate", [5.3, 19.7, 57.0])
@pytest.mark.parametrize("late", LATE)
def test_ground_has_its_velocity_however_late_its_maps_are(late: float, rate: float, ground: Any) -> None:
    found = velocities(Source(rate, np.full(int(8 * rate), late)), ground(), 7.5)
    assert np.abs(found[found.size // 3 :] - SPEED).max() < 0.02 * SPEED


@pytest.mark.parametrize("behind", [0.0, 1e6, -5.0])
@pytest.mark.parametrize("rate", [10.0, 20.0])
@pytest.mark.parametrize(("late", "jitter"), [(0.1, 0.1), (0.25, 0.1), (0.3, 0.1), (0.7, 0.2), (1.0, 0.2), (2.0, 0.2)])
def test_jitter_around_a_steady_delay_does_not_end_the_motion(
    late: float, jitter: float, rate: float, behind: float
) -> None:
    """On this node's clock as on another one."""
    delays = late + jitter * np.random.default_rng(1).uniform(-1.0, 1.0, int(30 * rate))
    found = velocities(Source(rate, delays, behind), heightmap(), 29.0)
    found = found[int(4.0 / PERIOD) :]
    assert np.mean(np.abs(found - SPEED) < 0.2 * SPEED) > 0.98
    assert found.min() > 0.0 and found.max() < 2.0 * SPEED


def test_a_node_shows_the_velocity_of_ground_whose_maps_are_late(shared: Probe) -> None:
    late, start, sent, last = 0.7, time.time(), 0, deque([math.nan], maxlen=20)

    def steady() -> bool:
        nonlocal sent
        while (now := time.time() - start) >= sent / 20.0:
            sent += 1
            instant = time.time() - late
            stamp = Time(sec=int(instant), nanosec=int(instant % 1 * 1e9))
            shared.publish_map(np.full((21, 21), SPEED * now), resolution=0.5, origin=(-5.0, -5.0, 0.0), stamp=stamp)
        answer = shared.call("query_ground", QueryGround, x=[0.0], y=[0.0])
        last.append(answer.velocities[2] if answer.success else math.nan)
        return len(last) == last.maxlen and np.abs(np.array(last) - SPEED).max() < 0.2 * SPEED

    shared.wait_for(steady)
    ages = shared.diagnostics("connections")
    assert float(ages["age of stamps on arrival, terrain [s]"]) == pytest.approx(late, abs=0.1)
