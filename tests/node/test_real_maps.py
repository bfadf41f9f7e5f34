"""Maps as mappers publish them: corrections, messages that are late or overtake each other, rival publishers."""

from collections.abc import Callable
from functools import partial
from types import SimpleNamespace
from typing import Any, get_args

import numpy as np
import pytest
import rclpy
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticStatus
from numpy.typing import NDArray
from smartmesh_msgs.msg import Heightmap
from std_srvs.srv import Trigger

from smartmesh_ros import BodyState, Box
from smartmesh_ros.node.inputs.map_checks import MapChecks
from smartmesh_ros.node.inputs.rivals import Rivals
from smartmesh_ros.node.parameters.specifications import SPECS, settings_from
from smartmesh_ros.node.timing.pacing import Pacer, stamp_of
from smartmesh_ros.node.timing.stamps import StampClock
from smartmesh_ros.terrain.grid import GridGeometry
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.motion import Changes, MotionConfig, MotionMode
from smartmesh_ros.terrain.trimesh import TriangleMesh
from smartmesh_ros.tools.testing import Probe, heightmap_message
from tests.node.shared import fed, own_time

DEFAULTS = {spec.name: spec.default for spec in SPECS}
GRID = GridGeometry(rows=21, columns=21, resolution=0.5)
LEVEL = np.zeros((21, 21), np.float32)


@pytest.mark.parametrize(
    ("said", "source", "meant"),
    [
        ("auto", "heightmap", "motion"),
        ("auto", "grid_map", "correction"),
        ("auto", "point_cloud", "correction"),
        ("motion", "grid_map", "motion"),
        ("correction", "heightmap", "correction"),
    ],
)
def test_what_changes_mean_follows_from_the_input_unless_it_is_said(said: str, source: str, meant: str) -> None:
    values = {**DEFAULTS, "terrain.changes": said, "terrain.input": source}
    assert settings_from(values).motion.changes == meant


def told(rivals: Rivals, height: Callable[[int], float], count: int = 12) -> bool:
    for number in range(count):
        rivals.take(GRID, LEVEL + np.float32(height(number)))
    return rivals.found


def test_maps_that_agree_go_on_or_come_alone_again_are_not_of_rivals() -> None:
    rivals = Rivals()
    assert told(rivals, lambda number: 0.3 * (number % 3 == 0) + 0.001 * number)
    assert not told(rivals, lambda _: 0.0)
    assert not told(Rivals(), lambda number: 0.005 * (number % 2))
    assert not told(Rivals(), lambda number: 0.03 * number)
    assert not told(Rivals(), lambda number: 0.3 * (number > 5))


def test_maps_of_different_places_do_not_disagree() -> None:
    rivals = Rivals()
    beside = GridGeometry(rows=21, columns=21, resolution=0.5, origin=(20.0, 0.0, 0.0))
    for number in range(12):
        rivals.take((GRID, beside)[number % 2], LEVEL + np.float32(number % 2))
    assert not rivals.found


ADVICE = "set terrain.changes: correction"


def of_mapper(number: int) -> NDArray[np.float32]:
    """Maps of level ground at 10 Hz: 5 mm of noise, 1 cm/s of drift, a closure of 8 cm every 2 s."""
    noise = np.random.default_rng(number).normal(0.0, 0.005, LEVEL.shape)
    return np.asarray(LEVEL + noise + 0.001 * number + 0.08 * (number // 20 % 2), np.float32)


def test_maps_of_a_mapper_that_are_taken_for_motion_are_a_warning(
    domain: int, capfd: pytest.CaptureFixture[str]
) -> None:
    with fed({"terrain.changes": "motion"}) as node:

        def give(number: int) -> tuple[bytes, str]:
            """Gives a map that holds from now on; level and words of the diagnostics a tenth of a second later."""
            node.give("heightmap", heightmap_message(of_mapper(number), resolution=0.5), steps=24)
            level, words, _ = node.node._outputs._diagnostics._terrain()
            return level, words

        warned = [ADVICE in give(number)[1] for number in range(60)]
        assert warned[50:] == [True] * 10
        level, words = give(60)
        assert level == DiagnosticStatus.WARN and "jumps of still ground" in words and "noise of 5." in words
        assert capfd.readouterr().err.count(ADVICE) == 1
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


@pytest.mark.parametrize(
    ("given", "changes", "doubted"),
    [(False, "motion", True), (True, "motion", False), (False, "correction", False)],
)
def test_a_doubt_goes_with_its_tile_and_there_is_none_of_given_velocities_and_corrections(
    given: bool, changes: Changes, doubted: bool
) -> None:
    lines: list[str] = []
    checks = MapChecks(SimpleNamespace(warning=lines.append))
    for number in range(50):
        heightmap = HeightMap(of_mapper(number), geometry=GRID, motion=MotionConfig(changes=changes))
        checks.take("east", heightmap, 0.1 * number, given=given)
    assert ("tile 'east'" in checks.warning and ADVICE in checks.warning) == bool(lines) == doubted
    checks.forget("east")
    assert checks.warning == ""


def before(stamp: Time, seconds: int, tenths: int = 0) -> Time:
    total = stamp.sec * 10**9 + stamp.nanosec - seconds * 10**9 - tenths * 10**8
    return Time(sec=total // 10**9, nanosec=total % 10**9)


def test_a_map_that_was_overtaken_is_neither_taken_nor_refused(domain: int) -> None:
    with fed({}) as node:
        now = node.now()
        for height, stamp in ((0.0, now), (1.0, before(now, 0, 1)), (0.0, node.now())):
            node.give("heightmap", heightmap_message(LEVEL + height, stamp=stamp))
        assert node.world.terrain.tiles[""].version == 2
        assert not node.node.refusals.counts
        assert node.node.session.overtaken.total() == 1


def test_older_stamps_are_taken_again_and_bodies_stay_where_they_are(domain: int) -> None:
    """The clock of the source was set back by an hour."""
    with fed({}) as node:
        node.give("heightmap", heightmap_message(LEVEL, resolution=0.5, stamp=node.now()))
        node.world.spawn("box", Box(0.4, 0.4, 0.3), 1.0, BodyState((5.0, 5.0, 0.3)))
        node.run(240)
        place = node.world.state("box").position
        assert place[2] < 0.152
        back = before(node.now(), 3600)
        message = heightmap_message(LEVEL, resolution=0.5, stamp=back)
        node.require_refused("heightmap", [("stamp_backwards", message)])
        [clock] = [found for found in node.node.services if found.srv_name.endswith("/reset_terrain_clock")]
        assert clock.callback(Trigger.Request(), Trigger.Response()).success
        for number in range(1, 4):
            message.header.stamp = before(back, 0, -number)
            node.give("heightmap", message)
            assert node.world.terrain.tiles[""].version == 1 + number
        assert node.world.state("box").position == pytest.approx(place, abs=0.002)


# Maps whose stamps are old on arrival: by a slow link or pipeline, or because two clocks differ.
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
            placed = clock.place(
                source.stamps[taken], now[0], lambda age, step=simulated: pacer.simulated_at(age, step), 0.0, horizon
            )
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


LATE = [0.0, 0.1, 0.3, 0.7, 1.0, 1.05, 3.0]


def mesh() -> TriangleMesh:
    return TriangleMesh(np.column_stack([CORNERS, np.zeros(4)]), SQUARE, time=-100.0)


@pytest.mark.parametrize("ground", [*(partial(heightmap, mode) for mode in get_args(MotionMode)), mesh])
@pytest.mark.parametrize("rate", [5.3, 57.0])
@pytest.mark.parametrize("late", LATE)
def test_ground_has_its_velocity_however_late_its_maps_are(late: float, rate: float, ground: Any) -> None:
    found = velocities(Source(rate, np.full(int(8 * rate), late)), ground(), 7.5)
    assert np.abs(found[found.size // 3 :] - SPEED).max() < 0.02 * SPEED


@pytest.mark.parametrize("behind", [0.0, 1e6])
@pytest.mark.parametrize("rate", [10.0, 20.0])
@pytest.mark.parametrize(("late", "jitter"), [(0.1, 0.1), (0.3, 0.1), (0.7, 0.2), (2.0, 0.2)])
def test_jitter_around_a_steady_delay_does_not_end_the_motion(
    late: float, jitter: float, rate: float, behind: float
) -> None:
    """On this node's clock as on another one."""
    delays = late + jitter * np.random.default_rng(1).uniform(-1.0, 1.0, int(30 * rate))
    found = velocities(Source(rate, delays, behind), heightmap(), 29.0)
    found = found[int(4.0 / PERIOD) :]
    assert np.mean(np.abs(found - SPEED) < 0.2 * SPEED) > 0.98
    assert found.min() > 0.0 and found.max() < 2.0 * SPEED


def test_ground_in_a_node_has_its_velocity_however_late_its_maps_are(
    domain: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    now = own_time(monkeypatch)
    with fed({}) as node:

        def rise() -> None:
            heights = LEVEL + SPEED * (now[0] - 1000.0)
            node.give("heightmap", heightmap_message(heights, resolution=0.5, stamp=stamp_of(now[0] - 0.7)), steps=0)

        def velocity() -> float:
            return float(node.world.terrain.at(np.full((1, 2), 5.0), node.world.time).velocities[0])

        found = node.play(now, 4.0, 1 / 20, rise, velocity)
        assert np.abs(np.array(found[240:]) - SPEED).max() < 0.02 * SPEED
        assert node.node.session.stamp_ages["terrain"] == pytest.approx(0.7, abs=0.1)
