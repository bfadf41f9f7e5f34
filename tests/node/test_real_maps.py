"""Maps as mappers publish them, over real topics: corrections, messages that overtake each other, rival publishers."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import count
from types import SimpleNamespace

import numpy as np
import pytest
import rclpy
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticStatus
from numpy.typing import NDArray
from smartmesh_msgs.msg import Heightmap
from std_srvs.srv import Trigger

from smartmesh_ros import BodyState, Box
from smartmesh_ros.node.inputs.maps import MapChecks, Rivals
from smartmesh_ros.node.parameters import specifications as parameters
from smartmesh_ros.node.parameters.specifications import SPECS, settings_from
from smartmesh_ros.terrain.grid import GridGeometry
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.motion import Changes, MotionConfig
from smartmesh_ros.tools.testing import Probe, Process, heightmap_message
from smartmesh_ros.tools.testing.probe import DIAGNOSTICS
from tests.node.shared import changed, fed, set_parameters

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


def test_noise_settle_and_interval_reach_the_core() -> None:
    said = {"terrain.noise": 0.01, "terrain.settle": 0.3, "terrain.min_interval": 0.01, "raster.variance_layer": "var"}
    settings = settings_from({**DEFAULTS, **said})
    motion = settings.motion
    assert (motion.noise, motion.settle, motion.min_interval) == (0.01, 0.3, 0.01)
    assert settings.raster.variance_layer == "var"
    assert said.keys() <= parameters.NAMES


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


@contextmanager
def maps_of(probe: Probe, heights: Callable[[int], NDArray[np.float32]]) -> Iterator[None]:
    """Publishes maps at 10 Hz while the block lasts."""
    numbers = count()
    timer = probe.node.create_timer(0.1, lambda: probe.publish_map(heights(next(numbers)), resolution=0.5))
    try:
        yield
    finally:
        probe.node.destroy_timer(timer)


def test_maps_of_a_mapper_that_are_taken_for_motion_are_a_warning(
    shared: Probe, shared_node: tuple[Probe, Process]
) -> None:
    with maps_of(shared, of_mapper), changed(shared, {"terrain.changes": "motion"}):
        maps = "updates of ''"
        shared.wait_for(lambda: ADVICE in shared.diagnostics("terrain")["message"])
        assert int(shared.diagnostics("terrain")[maps]) <= 60  # 5 s, and a second until the diagnostics say so
        shared.wait_for(lambda: "jumps of still ground" in shared.diagnostics("terrain")["message"])
        status = terrain_status(shared)
        assert status.level == DiagnosticStatus.WARN
        assert "noise of 5." in status.message
        assert shared_node[1].output.count(ADVICE) == 1
        assert set_parameters(shared, {"terrain.changes": "correction"}).successful
        shared.wait_for(lambda: shared.diagnostics("terrain")["message"] == "maps arrive")


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


def terrain_status(probe: Probe) -> DiagnosticStatus:
    [status] = [
        status for status in probe.latest(DIAGNOSTICS).status if status.name.endswith("terrain_collider: terrain")
    ]
    return status


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
        for _ in range(240):
            node.node.tick()
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
