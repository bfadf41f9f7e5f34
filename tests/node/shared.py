"""What tests of nodes share: of a node over DDS, of one in this process, and of replays."""

from __future__ import annotations

import gc
import re
import subprocess
import sys
import tempfile
import traceback
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from time import monotonic, sleep
from typing import Any

import numpy as np
import rclpy
import yaml
from geometry_msgs.msg import TransformStamped
from numpy.typing import ArrayLike, NDArray
from rcl_interfaces.srv import GetParameters, SetParametersAtomically
from rclpy.context import Context
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.serialization import serialize_message
from shape_msgs.msg import SolidPrimitive
from smartmesh_msgs.msg import Heightmap
from smartmesh_msgs.srv import SpawnBody, StepPhysics

from smartmesh_ros.errors import InputError
from smartmesh_ros.node.services.turns import Work
from smartmesh_ros.node.terrain_collider import TerrainCollider
from smartmesh_ros.node.timing.pacing import stamp_of
from smartmesh_ros.tools.replay.replay import Replay
from smartmesh_ros.tools.testing import COLLIDER, TIMEOUT, Probe, heightmap_message, pose_message

ROOT = Path(__file__).parents[2]
Logged = Callable[[], str]  # the fixture `logged`
Log = Callable[[str], list[str]]  # the fixture `log`
BALL = SolidPrimitive(type=SolidPrimitive.SPHERE, dimensions=[0.2])
LATCHED = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
# Environment in which nodes share no memory with the tests; see the file.
UDP_ONLY = {
    "FASTRTPS_DEFAULT_PROFILES_FILE": str(Path(__file__).parent / "udp_only.xml"),
    "ROS_AUTOMATIC_DISCOVERY_RANGE": "SYSTEM_DEFAULT",
}


def show_map(probe: Probe, heights: ArrayLike, **options: Any) -> Heightmap:
    """Publishes the first map, as of `Probe.publish_map`, and waits until the node has it."""
    message = probe.publish_map(heights, **options)
    probe.wait_for(lambda: probe.diagnostics("terrain")["samples"] != "0")
    return message


def show_level_ground(probe: Probe, size: int = 60) -> None:
    """Shows a first map of zero height: a body that is spawned before would fall."""
    show_map(probe, np.zeros((size, size)))


def transform_message(
    node: Fed, parent: str, child: str, position: Sequence[float] = (0.0, 0.0, 0.0), yaw: float = 0.0
) -> TransformStamped:
    """A transform with now as its stamp: ``child`` is at a position [m] of ``parent``, turned about z [rad]."""
    made, pose = stamped(node, TransformStamped(child_frame_id=child), parent), pose_message(position, yaw)
    for axis in "xyz":
        setattr(made.transform.translation, axis, getattr(pose.position, axis))
    made.transform.rotation = pose.orientation
    return made


def body_names(probe: Probe) -> list[str]:
    """Names of the simulated bodies in the next states."""
    return [body.id for body in probe.latest("body_states").bodies]


def box(*edges: float) -> SolidPrimitive:
    """A box of these edges [m]."""
    return SolidPrimitive(type=SolidPrimitive.BOX, dimensions=edges)


def spawn(probe: Probe, name: str, position: Sequence[float] = (0.0, 0.0, 0.0), **fields: Any) -> None:
    """Has the node spawn a body: a ball of 1 kg, unless the request's fields say otherwise, or a robot."""
    given = fields if "urdf" in fields else {"mass": 1.0, "shape": BALL, **fields}
    answer = probe.call("spawn_body", SpawnBody, id=name, **{"pose": pose_message(position), **given})
    assert answer.success, answer.message


def position_of(probe: Probe, name: str) -> tuple[float, float, float] | None:
    """Position [m] of a simulated body in the next states, if it is there."""
    places = {body.id: body.pose.position for body in probe.latest("body_states").bodies}
    return (places[name].x, places[name].y, places[name].z) if name in places else None


def seconds(stamp: Any) -> float:
    """A stamp [s]."""
    return float(stamp.sec) + 1e-9 * float(stamp.nanosec)


def stamped(probe: Probe | Fed, message: Any, frame_id: str = "map") -> Any:
    """The message with a frame, and now as its stamp."""
    message.header.stamp, message.header.frame_id = probe.now(), frame_id
    return message


def refusals(probe: Probe) -> Counter[str]:
    """How many messages the node has refused so far, by topic and reason."""
    found = probe.diagnostics("inputs").items()
    return Counter({key.removeprefix("refused, "): int(count) for key, count in found if key.startswith("refused, ")})


def values(probe: Probe, names: Collection[str]) -> dict[str, Any]:
    """Values of parameters of the node; None of an empty list."""
    found = probe.call("get_parameters", GetParameters, names=[*names]).values
    return dict(zip(names, map(parameter_value_to_python, found), strict=True))


def set_parameters(probe: Probe, parameters: Mapping[str, Any]) -> Any:
    """Sets parameters of the node, all or none; its answer."""
    messages = [Parameter(name, value=value).to_parameter_msg() for name, value in parameters.items()]
    return probe.call("set_parameters_atomically", SetParametersAtomically, parameters=messages).result


@contextmanager
def changed(probe: Probe, parameters: Mapping[str, Any]) -> Iterator[None]:
    """Sets parameters of the node that may change while it runs, and after the block those of before."""
    before = values(probe, parameters)
    result = set_parameters(probe, parameters)
    assert result.successful, result.reason
    try:
        yield
    finally:
        assert set_parameters(probe, before).successful


def refusal_at_start(parameters: Mapping[str, Any], arguments: Sequence[str] = ()) -> str:
    """What a collider says that refuses to start with these parameters and ROS arguments, made in this process. How the
    executable then ends: test_processes.py."""
    try:
        with made_with(TerrainCollider, parameters, arguments):
            pass
    except InputError as error:
        return str(error)
    raise AssertionError(f"{parameters} {arguments} are not refused")


@contextmanager
def made_with(kind: Any, parameters: Mapping[str, Any], arguments: Sequence[str] = ()) -> Iterator[Any]:
    """A node of a class, made in this process with these parameters and ROS arguments."""
    context = Context()
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "parameters.yaml"
        file.write_text(yaml.safe_dump({"/**": {"ros__parameters": dict(parameters)}}))
        given = [*arguments, "--params-file", str(file)] if parameters else [*arguments]
        rclpy.init(context=context)
        try:
            node = _make(kind, context, given)
            try:
                yield node
            finally:  # also of a test that fails: later ones of this process would meet the node
                node.destroy_node()
        finally:
            gc.collect()  # what was made of the node, which peers would hear else
            rclpy.shutdown(context=context)


def _make(kind: Any, context: Context, arguments: Sequence[str]) -> Any:
    """A node. One that refuses to start would live, with all its topics, as long as its error: this lets go of it."""
    try:
        return kind(context=context, cli_args=["--ros-args", *arguments])
    except Exception as refusal:
        error: BaseException | None = refusal
        while error is not None:
            traceback.clear_frames(error.__traceback__)
            error = error.__context__
        raise


class Fed:
    """A collider in this process that is given messages as its subscriptions take them, without a middleware between.
    ``world``: what it simulates."""

    def __init__(self, node: TerrainCollider) -> None:
        self.node, self.world = node, node.session.world

    def now(self) -> Any:
        """The time of the node's clock, as a stamp."""
        return stamp_of(self.node.session.clock.stamp_now())

    def give(self, topic: str, message: Any, steps: int = 10) -> None:
        """Gives it a message or its bytes on a topic (below its name, or a full name), and runs some steps."""
        name = topic.replace("~", COLLIDER) if topic[0] in "~/" else f"{COLLIDER}/{topic}"
        [take] = [found.callback for found in self.node.session.subscriptions if found.topic_name == name]
        take(message if isinstance(message, bytes) else serialize_message(message))
        self.run(steps)

    def call(self, service: str, request: Any) -> Any:
        """Calls a service (below its name), does all turns of the answer, and returns it."""
        [served] = [found for found in self.node.services if found.srv_name.endswith(f"/{service}")]
        answers = [served.callback(request, served.srv_type.Response())]
        if isinstance(work := answers[0], Work):
            answers.clear()
            self.node.session.turns.add(work, answers.append)
        while not answers:
            self.node.turn()
        return answers[0]

    def step(self, steps: int) -> None:
        """Runs steps of the paused physics, by a call."""
        assert self.call("step", StepPhysics.Request(steps=steps)).success

    def run(self, steps: int) -> None:
        """Runs steps of the physics, with what the node does at each."""
        for _ in range(steps):
            self.node.tick()

    def play(
        self, now: list[float], seconds: float, period: float, give: Callable[[], None], look: Callable[[], Any] = int
    ) -> list[Any]:
        """Runs the loop for so long [s] of the fixture ``now``, and calls ``give`` once a period [s]; what
        ``look`` returns after each step."""
        found, due, end = [], now[0], now[0] + seconds
        while now[0] < end:
            if now[0] >= due:
                due = now[0] + period
                give()
            now[0] += max(self.node.pacer.remaining(), 0.0)
            self.node.tick(self.node.pacer.advance)
            found.append(look())
        return found

    def require_refused(self, topic: str, cases: Iterable[tuple[str, Any]]) -> None:
        """Gives it messages, each of which must be refused for its reason, and nothing besides."""
        counts = self.node.refusals.counts
        for reason, message in cases:
            expected = counts + Counter([f"{topic}: {reason}"])
            self.give(topic, message)
            assert counts == expected

    def set(self, name: str, value: Any) -> str:
        """Sets a parameter; why it was refused, empty if it was not."""
        return str(self.node.set_parameters_atomically([Parameter(name, value=value)]).reason)

    def heights(self, x: Any, y: Any) -> NDArray[np.float64]:
        """Heights of the ground now at places [m], in the shape of these."""
        points = np.column_stack([np.ravel(x), np.ravel(y)])
        return np.asarray(self.world.terrain.at(points, self.world.time).heights.reshape(np.shape(x)))


@contextmanager
def fed(parameters: Mapping[str, Any], arguments: Sequence[str] = ()) -> Iterator[Fed]:
    """A collider in this process, with these parameters and ROS arguments."""
    with made_with(TerrainCollider, parameters, arguments) as node:
        yield Fed(node)


def on_level(parameters: Mapping[str, Any] | None = None, *more: Any, keep: Collection[str] = ()) -> Replay:
    """A replay on level ground, 10 m wide from the origin on; ``more``: (topic, time [s], message)."""
    return Replay([("heightmap", 0.0, heightmap_message(np.zeros((101, 101)))), *more], parameters, keep=keep)


def told(run: Replay, task: str) -> dict[str, str]:
    """Values of a task in the newest diagnostics of a replay that keeps them, and the task's ``message``."""
    [found] = [status for status in run.received("/diagnostics")[-1].status if status.name.endswith(f": {task}")]
    return {pair.key: pair.value for pair in found.values} | {"message": found.message}


def blocks(page: str, language: str) -> list[str]:
    """The blocks of code of a page in a language."""
    return re.findall(rf"```{language}\n(.*?)```", (ROOT / page).read_text(), re.DOTALL)


@contextmanager
def running(program: str) -> Iterator[None]:
    """A program in Python that runs for the length of the block."""
    with subprocess.Popen([sys.executable, "-c", program]) as process:
        try:
            yield
        finally:
            process.kill()


def wait_until(condition: Callable[[], object]) -> None:
    """Waits for a condition without a probe."""
    end = monotonic() + TIMEOUT
    while not condition():
        assert monotonic() < end
        sleep(0.02)
