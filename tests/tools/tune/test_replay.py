"""A replayed bag is what the node makes of it, and the yardstick is right."""

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rclpy.serialization import serialize_message
from smartmesh_msgs.msg import TrackedBody, TrackedBodyArray

from smartmesh_ros.ground.state import BodyState
from smartmesh_ros.node.terrain_collider import TerrainCollider
from smartmesh_ros.tools.testing import bags, heightmap_message, pose_message
from smartmesh_ros.tools.tune import measuring, space
from smartmesh_ros.tools.tune.bag_case import bag_case
from smartmesh_ros.tools.tune.case import reference
from smartmesh_ros.tools.tune.confirm import Verdict
from smartmesh_ros.tools.tune.figures import Asked, Figures, Limits, Point
from smartmesh_ros.tools.tune.measuring import Measuring, measure, run
from smartmesh_ros.tools.tune.recording import Bag
from smartmesh_ros.tools.tune.replay import Replay
from smartmesh_ros.tools.tune.report import parameter_file
from smartmesh_ros.tools.tune.search import Search, open_study
from smartmesh_ros.tools.tune.start import settings_of
from tests.node.shared import made_with

RATE, STEPS = 240.0, 96
MAPS = 12  # steps from one to the next
START: dict[str, Any] = {
    "bodies.spawn": [
        "{id: ball, shape: sphere, size: [0.2], mass: 1.0, xy: [0.1, 0.2], above: 0.3}",
        "{id: crate, shape: box, size: [0.3, 0.2, 0.2], mass: 2.0, xy: [-1.0, 0.5], above: 0.2, yaw: 0.4}",
    ]
}


def wave(time: float) -> np.ndarray:
    x = np.linspace(-3.0, 3.0, 41)
    return np.asarray(np.tile(0.1 * np.sin(2.0 * x - 4.0 * time), (41, 1)), np.float32)


def messages(yaw: float = 0.0) -> Iterator[tuple[str, float, Any]]:
    """Maps and a tracked body whose stamps are not set, so that they count from when they arrive."""
    for step in range(0, STEPS, MAPS):
        time = step / RATE
        origin = (-3.0 * math.cos(yaw) + 3.0 * math.sin(yaw), -3.0 * math.sin(yaw) - 3.0 * math.cos(yaw), 0.0)
        heightmap = heightmap_message(wave(time), resolution=0.15, origin=origin, yaw=yaw)
        yield "/terrain_collider/heightmap", time, heightmap
        body = TrackedBody(id="rover", pose=pose_message((1.0 + 0.2 * time, 0.0, 0.25)), radius=0.2)
        body.twist.linear.x = 0.2  # else the node estimates it by its own clock
        yield "/terrain_collider/tracked_bodies", time, TrackedBodyArray(bodies=[body])


def flat(state: BodyState) -> list[float]:
    return [*state.position, *state.orientation, *state.linear, *state.angular]


@pytest.fixture
def node(domain: int) -> Iterator[TerrainCollider]:
    with made_with(TerrainCollider, START) as made:
        made.pause(True)
        yield made


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_a_replayed_bag_is_what_the_node_makes_of_it(node: TerrainCollider, tmp_path: Path, storage: Any) -> None:
    recorded = list(messages())
    bags.write(tmp_path / "bag", recorded, storage)
    case = bag_case(Bag(tmp_path / "bag"), START)
    settings = settings_of(START)
    takes = {sub.topic_name: sub.callback for sub in node.subscriptions}
    with Replay(settings, case.bodies, case.events()) as replay:
        for step in range(STEPS):
            for topic, time, message in recorded:
                if round(time * RATE) == step:
                    takes[topic](serialize_message(message))
            node.step(1)
            replay.step(replay.due())
        world = node.session.world
        assert set(world.bodies) == set(replay.world.bodies) == {"ball", "crate", "rover"}
        for name in world.bodies:
            assert flat(replay.world.state(name)) == pytest.approx(flat(world.state(name)), abs=1e-9), name
        assert not replay.refused and not node.refusals.counts
        # And it has not merely fallen: it is where the wave is.
        ball = replay.world.state("ball").position
        below = replay.world.terrain.at([ball[:2]], replay.world.time).heights[0]
        assert 0.15 < ball[2] - below < 0.5


def test_a_map_that_is_turned_is_measured_as_one_that_is_not(tmp_path: Path) -> None:
    found = []
    for yaw in (0.0, 0.5):
        bags.write(tmp_path / f"{yaw}", messages(yaw))
        x, y = 0.1 * math.cos(yaw) - 0.2 * math.sin(yaw), 0.1 * math.sin(yaw) + 0.2 * math.cos(yaw)
        ball = f"{{id: ball, shape: sphere, size: [0.2], mass: 1.0, xy: [{x}, {y}], above: 0.25}}"
        case = bag_case(Bag(tmp_path / f"{yaw}"), {"bodies.spawn": [ball]})
        found += measure(case, run(case, [settings_of(case.start)], case.span.confirm), None)
    assert all(math.isfinite(one.penetration) and not one.failed for one in found)
    assert found[0].penetration == pytest.approx(found[1].penetration, abs=2e-5)
    assert found[0].hover == pytest.approx(found[1].hover, abs=2e-5)


def test_ground_that_is_not_followed_is_measured_as_penetration(tmp_path: Path) -> None:
    """Control: with patches that wait for the next map, bodies are inside the ground by what it rises."""
    bags.write(tmp_path / "bag", messages())
    case = bag_case(Bag(tmp_path / "bag"), START)
    hold = {**START, "terrain.motion": "hold", "patch.carry_velocity": False}
    runners = run(case, [settings_of(START), settings_of(hold)], case.span.confirm)
    kept, lagging = measure(case, runners, reference(case))
    assert kept.penetration < 0.5 * lagging.penetration
    assert kept.hover < 0.5 * lagging.hover
    assert kept.cost > 0.0 and kept.longest > 0.0


def test_a_setting_that_costs_too_much_is_stopped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(measuring, "MEASURING", Measuring(cost_factor=1.5, grace=0.0))
    bags.write(tmp_path / "bag", messages())
    case = bag_case(Bag(tmp_path / "bag"), START)
    slow = {**START, "physics.rate": 960.0, "patch.rate": 0.0}
    runners = run(case, [settings_of({**START, "physics.rate": 60.0}), settings_of(slow)], case.span.confirm)
    whole, stopped = measure(case, runners, None)
    assert runners[1].time < runners[0].time and stopped.cost > 1.5 * whole.cost
    assert math.isfinite(whole.error) and math.isinf(stopped.error)


def test_the_file_says_which_topic_its_maps_were_on(tmp_path: Path) -> None:
    """And how the node gets them from there, unless they are on its own topic."""
    chosen = Point(space.defaults(), Figures())
    verdict = Verdict(
        chosen=chosen, keeps=True, limits=Limits(), short=Figures(), others={}, confirmed=(chosen,),
    )  # fmt: skip
    for topic, words in (
        ("/mapper/heights", "which the node takes on ~/heightmap: start it with -r ~/heightmap:=/mapper/heights"),
        ("/terrain_collider/heightmap", "which the node takes on ~/heightmap."),
    ):
        bag = tmp_path / topic.rpartition("/")[2]
        others = [("/elsewhere/heightmap", time, message) for name, time, message in messages() if "height" in name]
        renamed = [(topic if "height" in name else name, time, message) for name, time, message in messages()]
        bags.write(bag, sorted([*renamed, *others], key=lambda record: record[1]))
        case = bag_case(Bag(bag), START, topic)
        search = Search(case, Asked(), open_study(str(tmp_path / "journal"), case.name, None))
        text = parameter_file(search, verdict).replace("\n# ", " ")
        assert f"Maps: {topic} (smartmesh_msgs/msg/Heightmap), {words}" in text
        assert "/elsewhere" not in text
