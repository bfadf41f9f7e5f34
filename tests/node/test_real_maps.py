"""Maps as mappers publish them: corrections, messages that are late or overtake each other, rival publishers, a bag."""

from collections import deque
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticStatus
from grid_map_msgs.msg import GridMap
from nav_msgs.msg import Odometry
from rclpy.serialization import deserialize_message
from smartmesh_msgs.msg import Heightmap
from smartmesh_msgs.srv import StartEpisode
from std_srvs.srv import Trigger

from smartmesh_ros import BodyState, Box
from smartmesh_ros.io.rasters import RasterConfig
from smartmesh_ros.node.inputs.adapters import grid_map_raster
from smartmesh_ros.node.inputs.map_checks import MapChecks, Rivals
from smartmesh_ros.node.timing.pacing import DeadlinePolicy, stamp_of
from smartmesh_ros.terrain.grid import GridGeometry
from smartmesh_ros.terrain.motion import MotionMode
from smartmesh_ros.tools.testing import Probe, bags, heightmap_message
from tests.memory import allocated
from tests.node.shared import Logged, fed, seconds
from tests.terrain.test_noise_check import of_mapper

MAPPER = Path(__file__).parents[1] / "data" / "mapper"
GRID = GridGeometry(rows=21, columns=21, resolution=0.5)
LEVEL = np.zeros((21, 21), np.float32)


def told(rivals: Rivals, height: Callable[[int], float], grids: Sequence[GridGeometry] = (GRID,)) -> bool:
    for number in range(12):
        rivals.take(grids[number % len(grids)], LEVEL + np.float32(height(number)))
    return rivals.found


def test_maps_that_agree_go_on_or_come_alone_again_are_not_of_rivals() -> None:
    rivals, beside = Rivals(), GridGeometry(rows=21, columns=21, resolution=0.5, origin=(20.0, 0.0, 0.0))
    assert told(rivals, lambda number: 0.3 * (number % 3 == 0) + 0.001 * number)
    assert not told(rivals, lambda _: 0.0)
    assert not told(Rivals(), lambda number: 0.005 * (number % 2))
    assert not told(Rivals(), lambda number: 0.03 * number)
    assert not told(Rivals(), lambda number: 0.3 * (number > 5))
    assert not told(Rivals(), lambda number: number % 2, (GRID, beside)), "maps of different places do not disagree"


ADVICE = "set terrain.changes: correction"


@pytest.mark.parametrize("given", [False, True])
def test_maps_of_a_mapper_that_are_taken_for_motion_are_a_warning(logged: Logged, given: bool) -> None:
    """Unless their velocities say that the ground moves."""
    maps = [heights for _, _, heights in of_mapper(6.2, 10.0, noise=0.005, drift=0.01, closure=0.08)]
    with fed({}) as node:

        def give(number: int) -> tuple[bytes, str]:
            """Gives a map that holds from now on; level and words of the diagnostics a tenth of a second later."""
            velocities = np.zeros_like(maps[number]) if given else None
            message = heightmap_message(maps[number], tile="east", velocities=velocities)
            node.give("heightmap", message, steps=24)
            return node.node._outputs._diagnostics._terrain()[:2]

        assert [ADVICE in give(number)[1] for number in range(60)][50:] == [not given] * 10
        level, words = give(60)
        assert logged().count(ADVICE) == (not given)
        if given:
            return
        assert level == DiagnosticStatus.WARN and "tile 'east': " in words
        assert "jumps of still ground" in words and "noise of 5." in words
        assert not node.set("terrain.changes", "correction")
        assert give(61)[1] == "maps arrive"


def test_two_mappers_on_one_topic_are_named_in_the_diagnostics(shared: Probe) -> None:
    other = rclpy.create_node("second_mapper", context=shared.node.context)
    try:
        second = other.create_publisher(Heightmap, shared.topic("heightmap"), 10)
        shared.wait_for(second.get_subscription_count)

        def warned() -> bool:
            shared.publish_map(LEVEL)
            second.publish(heightmap_message(LEVEL + 0.3, stamp=shared.now()))
            message = shared.diagnostics("terrain")["message"]
            return "disagree" in message and "/second_mapper" in message

        shared.wait_for(warned)
    finally:
        other.destroy_node()


def test_tiles_that_come_and_go_leave_nothing_behind(monkeypatch: pytest.MonkeyPatch) -> None:
    """A ground that scrolls below a robot has ever new names of tiles; here as of two publishers."""
    monkeypatch.setattr(MapChecks, "_several", lambda _: True)
    with fed({"terrain.motion": "hold"}) as node:

        def scroll(tiles: range) -> int:
            for number in tiles:
                for heights in (LEVEL, np.zeros((0, 0))):
                    node.give("heightmap", heightmap_message(heights, tile=f"tile {number}", stamp=node.now()), steps=1)
            assert not node.world.terrain.tiles and not node.node.refusals.counts
            return allocated()

        sums = [scroll(range(first, first + 200)) for first in range(0, 800, 200)]
        assert min(np.diff(sums)) < 200 * 1024, "a thousand bytes of each; what happens once is no leak"


def test_the_shipped_bag_of_a_mapper_is_taken_and_after_a_reset_again(logged: Logged) -> None:
    """That its stamps are old is told once of the maps, and once of the odometry. Played again, they run backwards.
    Over DDS the page on testing plays a bag: test_tutorial.py."""
    records = list(bags.read(MAPPER))
    topics = {"/elevation_map": "grid_map", "/odom": "/odom"}
    data = {record.topic: record.data for record in records}
    last = grid_map_raster(deserialize_message(data["/elevation_map"], GridMap), RasterConfig())
    place = deserialize_message(data["/odom"], Odometry).pose.pose.position
    with fed({"terrain.input": "grid_map", "bodies.odometry": ["rover=/odom"], "bodies.timeout": 60.0}) as node:
        counts = node.node.refusals.counts
        assert node.node.settings.motion.changes == "correction", "grid maps correct the last one"
        for refused in (set(), {"grid_map: stamp_backwards", "/odom: stamp_backwards"}, set()):
            counts.clear()
            for record in records:
                node.give(topics[record.topic], record.data, steps=0)
            assert set(counts) == refused
            node.run(240)
            tile = node.world.terrain.tiles[""]
            assert tile.geometry == last.geometry
            np.testing.assert_allclose(tile.heights, last.heights, atol=1e-5)
            assert node.world.state("rover").position[:2] == pytest.approx((place.x, place.y), abs=0.5)
            assert logged().count("s old, so they count as those of another clock") == (0 if refused else 2)
            if refused:
                node.node.reset()


def test_that_latched_tiles_are_old_is_one_line_and_that_others_are_ahead_another(logged: Logged) -> None:
    with fed({}) as node:
        for number in range(6):
            stamp = stamp_of(seconds(node.now()) + (-100.0 if number % 3 else 100.0))
            node.give("heightmap", heightmap_message(LEVEL, tile=f"tile {number}", stamp=stamp), steps=1)
        said = logged()
        assert (said.count("s old, so they"), said.count("s ahead of this node's clock, so they")) == (1, 1)
        assert not node.node.refusals.counts


def test_older_stamps_are_taken_again_and_bodies_stay_where_they_are() -> None:
    """The clock of the source was set back by an hour, and for an episode by another. A map that was only overtaken is
    neither taken nor refused."""
    with fed({}) as node:
        start = seconds(node.now())
        for stamp in (start, start - 0.1):
            node.give("heightmap", heightmap_message(LEVEL, resolution=0.5, stamp=stamp_of(stamp)))
        assert not node.node.refusals.counts and node.node.session.counts.total() == 1
        node.world.spawn("box", Box(0.4, 0.4, 0.3), 1.0, BodyState((5.0, 5.0, 0.3)))
        node.run(240)
        place = node.world.state("box").position
        assert place[2] < 0.152
        message = heightmap_message(LEVEL, resolution=0.5, stamp=stamp_of(start - 3600.0))
        node.require_refused("heightmap", [("stamp_backwards", message)])
        assert node.call("reset_terrain_clock", Trigger.Request()).success
        for number in range(1, 4):
            message.header.stamp = stamp_of(start - 3600.0 + 0.1 * number)
            node.give("heightmap", message)
            assert node.world.terrain.tiles[""].version == 1 + number
        assert node.world.state("box").position == pytest.approx(place, abs=0.002)
        assert node.call("start_episode", StartEpisode.Request()).success
        message.header.stamp = stamp_of(start - 7200.0)
        node.give("heightmap", message)
        assert node.node.refusals.counts.total() == 1


SPEED = 0.1  # of ground that rises [m/s]
# Rates of maps [Hz] whose stamps are old on arrival [s]: by a slow link or pipeline, or because two clocks differ.
LATE: list[tuple[MotionMode, float, float, float, float]] = [
    *((mode, 5.3, 0.7, 0.0, 0.0) for mode in get_args(MotionMode)),
    ("extrapolate", 57.0, 0.0, 0.0, 0.0),
    ("extrapolate", 57.0, 3.0, 0.0, 0.0),
    ("extrapolate", 20.0, 0.3, 0.1, 0.0),
    ("extrapolate", 10.0, 2.0, 0.2, 0.0),
    ("extrapolate", 10.0, 2.0, 0.2, 900.0),
]


@pytest.mark.parametrize(("mode", "rate", "late", "jitter", "behind"), LATE)
def test_ground_has_its_velocity_however_late_its_maps_are(
    now: list[float], mode: str, rate: float, late: float, jitter: float, behind: float
) -> None:
    """Maps of ground that rises arrive in order, ``late`` [s] after their stamps, give or take some ``jitter``, which
    are of this node's clock or of one that is ``behind`` [s]."""
    span = late + 6.0 + 60.0 * jitter
    sent = 1000.0 + np.arange(0.0, span, 1.0 / rate)
    delays = late + jitter * np.random.default_rng(1).uniform(-1.0, 1.0, len(sent))
    coming = deque(zip(np.maximum.accumulate(sent + delays), sent, strict=True))
    with fed({"terrain.motion": mode}) as node:

        def rise() -> None:
            while coming and coming[0][0] <= now[0]:
                _, at = coming.popleft()
                heights = LEVEL + SPEED * (at - 1000.0)
                message = heightmap_message(heights, resolution=0.5, stamp=stamp_of(at - behind))
                node.give("heightmap", message, steps=0)

        def velocity() -> float:
            return float(node.world.terrain.at(np.full((1, 2), 5.0), node.world.time).velocities[0])

        found = np.array(node.play(now, span, 0.0, rise, velocity)[-720:])
        near = np.abs(found - SPEED) < (0.2 if jitter else 0.02) * SPEED
        assert near.mean() > 0.98
        assert found.min() > 0.0 and found.max() < 2.0 * SPEED


@pytest.mark.parametrize("policy", get_args(DeadlinePolicy))
@pytest.mark.parametrize("stalls", [(0.002, 0.5), (0.02, 0.03), (0.05, 0.01)])
def test_stalls_of_the_loop_give_the_ground_no_velocity(
    now: list[float], policy: str, stalls: tuple[float, float]
) -> None:
    """In a loop that has time otherwise, stalls of a mean length [s] come with a probability, before a step and before
    a map. The rise of the ground meanwhile is not the motion of some steps: that would be several metres a second."""
    chance, sent, queue = np.random.default_rng(2), 1000.0, deque[float](maxlen=10)

    def stall() -> None:
        now[0] += chance.exponential(stalls[1]) if chance.random() < stalls[0] else 0.0

    with fed({"physics.deadline": policy}) as node:

        def rise() -> None:
            nonlocal sent
            stall()
            while sent <= now[0]:
                queue.append(sent)
                sent += chance.choice([0.02, 0.03, 0.05])
            while queue:
                stamp = queue.popleft()
                heights = LEVEL + SPEED * (stamp - 1000.0)
                node.give("heightmap", heightmap_message(heights, resolution=0.5, stamp=stamp_of(stamp)), steps=0)
                now[0] += chance.uniform(0.0002, 0.002)
                stall()

        def velocity() -> float:
            now[0] += chance.uniform(0.1, 0.8) / 240.0
            return float(node.world.terrain.at(np.full((1, 2), 5.0), node.world.time).velocities[0])

        assert np.abs(node.play(now, 4.0, 0.0, rise, velocity)).max() < 2.0 * SPEED
