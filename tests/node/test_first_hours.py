"""What a new user is told over DDS: of bodies below, beside and off the ground, of maps without ground, of stamps of
other clocks, and of files that services may not open."""

from pathlib import Path

import numpy as np
import pytest
from smartmesh_msgs.msg import BodySpecification, HeightmapUpdate
from smartmesh_msgs.srv import SpawnBodies, SpawnBody
from std_srvs.srv import SetBool, Trigger

from smartmesh_ros.tools.testing import Probe, Process, floats, heightmap_message, pose_message
from smartmesh_ros.tools.testing.replaying import replayed
from tests.node.shared import BALL, body_names, changed, one_round, position_of, show_level_ground, show_map, stamped
from tests.urdfs import link, robot

# Beside the ground of `show_level_ground`, which is 6 m wide from the origin on.
SHARED = {
    "bodies.spawn": ["{id: outside, shape: sphere, size: [0.2], xyz: [-1.0, 3.0, 0.5]}"],
    "physics.gravity": [0.0, 0.0, -200.0],  # so that it is soon far below
}


class Log:
    """The lines of a process from now on."""

    def __init__(self, process: Process) -> None:
        self._process, self._before = process, len(process.output)

    def lines(self, words: str) -> list[str]:
        return [line for line in self._process.output[self._before :].splitlines() if words in line]


@pytest.fixture
def log(shared_node: tuple[Probe, Process]) -> Log:
    return Log(shared_node[1])


def test_a_body_that_falls_beside_the_ground_is_named_once_removed_and_back_after_a_reset(
    shared: Probe, log: Log
) -> None:
    # Paused, so that the body does not begin to fall before the reset.
    assert shared.call("pause", SetBool, data=True).success
    show_map(shared, np.zeros((60, 60)))
    assert shared.call("reset", Trigger).success
    assert shared.call("pause", SetBool, data=False).success
    shared.wait_for(lambda: "fell off the ground: outside at (-1.00, 3.00)" in shared.diagnostics("bodies")["message"])
    shared.wait_for(lambda: "lost, outside" in shared.diagnostics("bodies"))
    shared.wait_for(lambda: log.lines("'outside' was 100 m below the ground at (-1.00, 3.00"))
    [told] = log.lines("'outside' at (-1.00, 3.00")
    assert "[WARN]" in told and "falls: there is no ground there" in told
    assert "outside" not in body_names(shared)
    assert shared.call("reset", Trigger).success
    shared.wait_for(lambda: "outside" in body_names(shared))


def test_a_body_that_is_spawned_below_the_ground_is_told_where_it_starts(shared: Probe, log: Log) -> None:
    show_level_ground(shared)
    words = "starts 2.00 m below the ground, which is at z = 0.00 m there, and is put onto it; on_ground: true chooses"
    fields = {"mass": 1.0, "shape": BALL, "pose": pose_message((2.0, 2.0, -2.0))}
    alone = shared.call("spawn_body", SpawnBody, id="alone", **fields)
    many = shared.call("spawn_bodies", SpawnBodies, bodies=[BodySpecification(id=name, **fields) for name in "ab"])
    on_ground = shared.call("spawn_body", SpawnBody, id="on", on_ground=True, **fields)
    above = shared.call("spawn_body", SpawnBody, id="above", **{**fields, "pose": pose_message((2.0, 2.0, 1.0))})
    assert all(answer.success for answer in (alone, many, on_ground, above))
    assert f"'alone' {words}" in alone.message and many.message.count(words) == 2
    assert on_ground.message == above.message == ""
    shared.wait_for(lambda: len(log.lines(words)) == 3)
    shared.wait_for(lambda: position_of(shared, "alone")[2] > 0.1)


def test_a_body_that_is_spawned_before_the_first_map_is_told_that_it_falls(shared: Probe) -> None:
    answer = shared.call("spawn_body", SpawnBody, id="early", mass=1.0, shape=BALL)
    assert answer.success and "'early' falls, because there is no ground before the first map" in answer.message


def test_a_map_of_holes_alone_is_told(shared: Probe, log: Log) -> None:
    shared.publish_map(np.full((30, 30), np.nan))
    words = "the map has no ground: all its 900 heights are NaN"
    shared.wait_for(lambda: words in shared.diagnostics("terrain")["message"])
    shared.publish_map(np.full((30, 30), np.nan))
    shared.publish_map(np.zeros((30, 30)))
    shared.wait_for(lambda: shared.diagnostics("terrain")["message"] == "maps arrive")
    shared.wait_for(lambda: len(log.lines(words)) == 1)


def test_a_map_of_holes_is_told_until_a_region_brings_ground_and_again_when_one_takes_it() -> None:
    region = HeightmapUpdate(x=5, y=5, width=3, height=3)
    told = "the map has no ground: all its 900 heights are NaN"
    with replayed([("heightmap", 0.0, heightmap_message(np.full((30, 30), np.nan)))], keep=["/diagnostics"]) as run:

        def says() -> str:
            run.run(run.time + 4.0)
            return next(of.message for of in run.received("/diagnostics")[-1].status if of.name.endswith("terrain"))

        assert told in says(), "the map may have been published once"
        assert run.call("reset", Trigger.Request()).success
        assert told in says()
        for height, words in [(0.0, "the last map is"), (np.nan, told)]:
            region.heights = floats(np.full(9, height, np.float32))
            run.give("heightmap_update", region)
            assert words in says()
        assert not run.refused


@pytest.mark.parametrize(
    ("ahead", "words"), [(3600, "s ahead of this node's clock"), (-3600, "s old"), (0, "")], ids=["ahead", "old", "now"]
)
def test_stamps_of_another_clock_are_told_once(shared: Probe, log: Log, ahead: int, words: str) -> None:
    for _ in range(3):
        message = stamped(shared, heightmap_message(np.zeros((30, 30))))
        message.header.stamp.sec += ahead
        shared.publishers["heightmap"].publish(message)
        one_round(shared)
    shared.wait_for(lambda: shared.diagnostics("terrain").get("updates of ''") == "3")
    told = log.lines("they count as those of another clock")
    assert [words in line for line in told] == ([True] if words else [])


def test_folders_of_robots_may_be_added_while_the_node_runs(shared: Probe, tmp_path: Path) -> None:
    (tmp_path / "robot.urdf").write_text(robot(link("a", '<box size="0.3 0.3 0.2"/>')))
    show_level_ground(shared)
    asked = {"id": "mine", "urdf": str(tmp_path / "robot.urdf"), "pose": pose_message((2.0, 2.0, 1.0))}
    refused = shared.call("spawn_body", SpawnBody, **asked)
    assert not refused.success
    where = refused.message.index("is not in bodies.urdf_folders: add its folder there")
    assert where < 250 and len(refused.message) < 700, "the cure first"
    with changed(shared, {"bodies.urdf_folders": [str(tmp_path)]}):
        assert shared.call("spawn_body", SpawnBody, **asked).success
