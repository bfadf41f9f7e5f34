"""A run of the node over DDS, recorded and replayed: the same bodies, but for when steps and messages met."""

from pathlib import Path
from time import time
from typing import Any

import numpy as np
from rclpy.serialization import deserialize_message
from shape_msgs.msg import SolidPrimitive
from smartmesh_msgs.msg import Heightmap, TrackedBodyArray
from smartmesh_msgs.srv import SpawnBody

from smartmesh_ros.tools.replay.bag import Bag
from smartmesh_ros.tools.replay.replay import Replay
from smartmesh_ros.tools.testing import Probe, bags, pose_message

PARAMETERS = {"service_introspection": "contents", "publish.body_states": 60.0}
RECORDED = {
    "heightmap": Heightmap, "body_states": TrackedBodyArray, "spawn_body/_service_event": SpawnBody.Event,
}  # fmt: skip
PERIOD, MOVING, LENGTH = 0.05, 0.5 * np.pi, 2.4  # of the maps, of the motion of the ground, of the run [s]
RISE = 0.05  # of the ground, to either side [m]
SHAPES = (
    SolidPrimitive(type=SolidPrimitive.SPHERE, dimensions=[0.2]),
    SolidPrimitive(type=SolidPrimitive.BOX, dimensions=[0.4, 0.3, 0.2]),
    SolidPrimitive(type=SolidPrimitive.CYLINDER, dimensions=[0.3, 0.2]),
)


def heights(time: float) -> Any:
    """Level ground that heaves, and stands still at the end."""
    return np.full((21, 21), RISE * np.cos(4.0 * min(time, MOVING)))


def positions(messages: list[TrackedBodyArray]) -> dict[str, Any]:
    """Rows of instant [s] and position [m] by body."""
    found: dict[str, list[list[float]]] = {}
    for message in messages:
        instant = message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec + message.ahead
        for body in message.bodies:
            place = body.pose.position
            found.setdefault(body.id, []).append([instant, place.x, place.y, place.z])
    return {name: np.array(rows) for name, rows in found.items()}


def at_rest(message: TrackedBodyArray) -> bool:
    return all(abs(body.twist.linear.z) < 1e-4 for body in message.bodies)


def test_a_recorded_run_is_replayed(probe: Probe, tmp_path: Path) -> None:
    records: list[tuple[str, float, Any]] = []

    def record(name: str, kind: Any) -> None:
        def note(data: bytes) -> None:
            records.append((probe.topic(name), time(), deserialize_message(data, kind)))

        probe.node.create_subscription(kind, probe.topic(name), note, 100, raw=True)

    def of(name: str) -> list[Any]:
        return [message for topic, _, message in records if topic.endswith(name)]

    with probe.running(parameters=PARAMETERS):
        for name, kind in RECORDED.items():
            record(name, kind)
        probe.wait_for(lambda: probe.node.count_publishers(probe.topic("spawn_body/_service_event")))
        probe.publish_map(heights(0.0), resolution=0.5, origin=(-5.0, -5.0, 0.0))
        probe.wait_for(lambda: of("heightmap"))
        for number, shape in enumerate(SHAPES):
            pose = pose_message((2.0 * number - 2.0, 0.5, 0.4), 0.3 * number)
            probe.call("spawn_body", SpawnBody, id=f"body_{number}", shape=shape, mass=1.0, pose=pose)
        start = time()
        for number in range(round(LENGTH / PERIOD)):
            probe.publish_map(heights(number * PERIOD), resolution=0.5, origin=(-5.0, -5.0, 0.0))
            probe.wait_for(lambda: time() >= start + (number + 1) * PERIOD)  # noqa: B023
        probe.wait_for(lambda: all(map(at_rest, of("body_states")[-30:])))
    bags.write(tmp_path / "bag", records)
    replayed: list[Any] = []

    def keep(publisher: Any) -> Any:
        return (lambda _, data: replayed.append(data)) if publisher.topic_name.endswith("body_states") else None

    with Replay(Bag(tmp_path / "bag"), PARAMETERS, record=keep) as run:
        run.run()
        assert not run.refused
    before = positions(of("body_states"))
    after = positions([deserialize_message(data, TrackedBodyArray) for data in replayed])
    assert before.keys() == after.keys() == {"body_0", "body_1", "body_2"}
    for name, rows in before.items():
        theirs, ours = rows[rows[:, 0] < after[name][-1, 0]], after[name]
        again = np.column_stack([np.interp(theirs[:, 0], ours[:, 0], ours[:, axis]) for axis in (1, 2, 3)])
        apart = np.linalg.norm(again - theirs[:, 1:], axis=1)
        assert len(apart) > 20 and apart[-1] < 1e-3, "at rest"
        assert np.median(apart) < 0.5 * RISE, "on ground that moves; a tenth of it on a machine that does not stall"
