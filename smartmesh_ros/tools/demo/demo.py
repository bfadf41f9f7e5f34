"""``make demo``: the whole system on a real elevation model with a wave over it, for about 15 seconds.

Terrain source and collider run as separate processes. The demo's own process spawns bodies, drives a robot, records
topics and draws them. It exits with 0 only if no body was lost and every output was received. A body counts as lost if
it is below the ground. One that was put back onto the ground counts as well, unless the node ran behind real time: the
ground, which moves in real time, is then faster than the simulated bodies.
"""

from __future__ import annotations

import argparse
import math
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from time import monotonic
from typing import Any

import pybullet_data
import rclpy
from ament_index_python.packages import get_package_prefix
from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.serialization import deserialize_message
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState
from shape_msgs.msg import SolidPrimitive
from smartmesh_msgs.msg import (
    BodyDescriptionArray,
    ColliderPatchArray,
    ContactArray,
    Heightmap,
    Timing,
    TrackedBodyArray,
)
from smartmesh_msgs.srv import SpawnBody
from visualization_msgs.msg import Marker, MarkerArray

from smartmesh_ros.node.running import Stop
from smartmesh_ros.startup.dds import isolated_unless_chosen, use_large_message_profile
from smartmesh_ros.tools.demo import demo_pictures
from smartmesh_ros.tools.demo.demo_pictures import Snapshot

SOURCE = {
    "scene": "elevation", "rate": 30.0, "resolution": 0.25, "relief": 3.0,
    "wave.amplitude": 0.1, "wave.number": 1.2, "wave.frequency": 4.0,
}  # fmt: skip
# Outputs whose rate is lowered to 10 Hz, so that two cores suffice for three processes.
WATCHED = ("patches", "collider_patches", "body_states", "contacts", "joint_states", "odometry")
COLLIDER = {f"publish.{topic}": 10.0 for topic in WATCHED}
ROBOT = "husky"
WHEELS = [f"{ROBOT}/{place}_wheel" for place in ("front_left", "front_right", "rear_left", "rear_right")]
SHAPES = (
    SolidPrimitive(type=SolidPrimitive.SPHERE, dimensions=[0.25]),
    SolidPrimitive(type=SolidPrimitive.BOX, dimensions=[0.6, 0.4, 0.3]),
    SolidPrimitive(type=SolidPrimitive.CYLINDER, dimensions=[0.4, 0.25]),
)
BODIES = 24
OUTPUTS = {
    "patches": MarkerArray,
    "collider_patches": ColliderPatchArray,
    "body_states": TrackedBodyArray,
    "contacts": ContactArray,
    "timing": Timing,
    "joint_states": JointState,
    "odometry": Odometry,
    "body_descriptions": BodyDescriptionArray,
}
# QoS of body_descriptions, which late subscribers receive as well.
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
START_TIMEOUT = 60.0  # [s]
# Real-time factor below which a node runs behind real time.
REAL_TIME = 0.9


class Demo(Node):
    """Spawns bodies, drives the robot and records topics."""

    def __init__(self) -> None:
        super().__init__("demo")
        self._latest: dict[str, Any] = {}
        self.counts: dict[str, int] = dict.fromkeys([*OUTPUTS, "diagnostics"], 0)
        for topic, kind in OUTPUTS.items():
            # Raw bytes, because most messages are only counted; drawing converts those that it needs.
            qos = LATCHED if topic == "body_descriptions" else 10
            self.create_subscription(kind, f"terrain_collider/{topic}", self._keeper(topic), qos, raw=True)
        self.create_subscription(DiagnosticArray, "/diagnostics", self._keeper("diagnostics"), 10)
        self.create_subscription(Heightmap, "terrain_collider/heightmap", self._keeper("heightmap"), 1, raw=True)
        self._spawner = self.create_client(SpawnBody, "terrain_collider/spawn_body")
        self._commands = self.create_publisher(JointState, "terrain_collider/joint_commands", 10)

    def _keeper(self, topic: str) -> Any:
        def keep(message: Any) -> None:
            self._latest[topic] = message
            if topic in self.counts:
                self.counts[topic] += 1

        return keep

    def latest(self, topic: str) -> Any:
        """Return the newest message of a topic."""
        message = self._latest[topic]
        return deserialize_message(message, OUTPUTS[topic]) if isinstance(message, bytes) else message

    def snapshot(self, time: float) -> Snapshot:
        """Return the newest messages to draw, at ``time`` [s] of the demo."""
        return Snapshot(time, {topic: self._latest[topic] for topic in demo_pictures.DRAWN})

    def wait_for(self, condition: Any, what: str) -> Any:
        """Spin until the condition holds; return its value. Raises `TimeoutError`, which names ``what``."""
        end = monotonic() + START_TIMEOUT
        while not (value := condition()):
            if monotonic() > end:
                raise TimeoutError(f"no {what} after {START_TIMEOUT:.0f} s; received {self.counts}")
            rclpy.spin_once(self, timeout_sec=0.1)
        return value

    def spawn_all(self) -> None:
        """Spawn two dozen bodies of three shapes in rings, and a wheeled robot."""
        self.wait_for(lambda: "heightmap" in self._latest, "map")
        self.wait_for(self._spawner.service_is_ready, "spawn service")
        # Bodies spawned before the node has a map would fall, and be below the ground when the map arrives.
        self.wait_for(lambda: "diagnostics" in self._latest and int(self._value("terrain", "tiles")), "map in the node")
        for index in range(BODIES):
            angle = 2.0 * math.pi * index / BODIES
            reach = 5.0 + 2.0 * (index % 3)
            x, y = reach * math.cos(angle), reach * math.sin(angle)
            self._spawn(f"{['ball', 'box', 'can'][index % 3]}_{index}", x, y, 0.4, shape=SHAPES[index % 3])
        urdf = Path(pybullet_data.getDataPath()) / "husky" / "husky.urdf"
        self._spawn(ROBOT, -4.0, 0.0, 0.02, urdf=str(urdf), align=True)

    def drive(self) -> None:
        """Command the robot's wheels."""
        self._commands.publish(JointState(name=WHEELS, velocity=[6.0] * len(WHEELS)))

    def lost(self) -> int:
        """Return the number of bodies and links below the ground, from the node's diagnostics."""
        return int(self._value("bodies", "below ground"))

    def put_back(self) -> int:
        """Return the number of bodies put back onto the ground so far, from the node's diagnostics."""
        return int(self._value("bodies", "put back onto the ground"))

    def status(self, task: str) -> Any:
        """Return a task of the node's diagnostics."""
        [status] = [status for status in self.latest("diagnostics").status if status.name.endswith(f": {task}")]
        return status

    def _value(self, task: str, key: str) -> str:
        """Return the value of a key in a task of the node's diagnostics."""
        return next(str(pair.value) for pair in self.status(task).values if pair.key == key)

    def line(self) -> str:
        """Return numbers of bodies and patches, real-time factor and stage times in one line."""
        timing = self.latest("timing")
        stages = "  ".join(f"{stage.stage} {stage.p50_us:.0f}" for stage in timing.stages)
        shown = sum(marker.action == Marker.ADD for marker in self.latest("patches").markers)
        bodies = len(self.latest("body_states").bodies)
        return (
            f"bodies {bodies}  patches {shown}  real-time {timing.real_time_factor:.2f}  "
            f"missed {timing.deadline_misses}  lost {self.lost()}  put back {self.put_back()}  | us: {stages}"
        )

    def _spawn(self, name: str, x: float, y: float, clearance: float, **what: Any) -> None:
        request = SpawnBody.Request(id=name, mass=5.0, on_ground=True, clearance=clearance, **what)
        request.pose.position.x, request.pose.position.y = x, y
        future = self._spawner.call_async(request)
        self.wait_for(future.done, f"answer to the spawning of {name}")
        if not future.result().success:
            raise RuntimeError(f"{name} was not spawned: {future.result().message}")


@contextmanager
def demo_running() -> Iterator[Demo]:
    """Run the demo's nodes, each in its own process, with its bodies and robot, for the length of the block."""
    demo = Demo()
    try:
        with _node_process("terrain_source", SOURCE), _node_process("terrain_collider", COLLIDER):
            print("starting terrain_source and terrain_collider ...", flush=True)
            demo.spawn_all()
            yield demo
    finally:
        demo.destroy_node()


@contextmanager
def _node_process(name: str, parameters: dict[str, Any]) -> Iterator[None]:
    """Run an installed executable of the package as a process for the length of the block."""
    path = Path(get_package_prefix("smartmesh_ros")) / "lib" / "smartmesh_ros" / name
    given = [word for key, value in parameters.items() for word in ("-p", f"{key}:={value}")]
    process = subprocess.Popen([str(path), "--ros-args", *given], stdout=subprocess.DEVNULL)
    try:
        yield
    finally:
        process.terminate()
        process.wait(10)


def watch(demo: Demo, seconds: float) -> tuple[list[Snapshot], int]:
    """Run the demo and print a line a second. Return snapshots to draw and the largest number of lost bodies."""
    snapshots: list[Snapshot] = []
    lost, slowest = 0, 1.0
    start = monotonic()
    next_line, next_frame = start + 1.0, start
    while (now := monotonic()) < start + seconds:
        rclpy.spin_once(demo, timeout_sec=0.05)
        if now >= next_frame:
            next_frame += 0.25
            snapshots.append(demo.snapshot(now - start))
            demo.drive()
        if now >= next_line:
            next_line += 1.0
            lost, slowest = max(lost, demo.lost()), min(slowest, demo.latest("timing").real_time_factor)
            print(f"{now - start:5.1f} s  {demo.line()}", flush=True)
            if demo.lost():
                print(f"         {demo.status('bodies').message}", flush=True)
    if slowest >= REAL_TIME:
        lost += demo.put_back()
    return snapshots, max(lost, demo.lost())


def main(args: list[str] | None = None) -> None:
    """Run the demo."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=15.0, help="duration of the recording")
    parser.add_argument("--out", type=Path, default=Path("out"), help="folder of the pictures")
    options = parser.parse_args(args)
    use_large_message_profile()
    Stop()  # the first signal raises KeyboardInterrupt; later ones leave the processes the time to end
    try:
        with isolated_unless_chosen():
            snapshots, lost, counts = run(options.seconds)
        print("drawing ...", flush=True)
        for path in demo_pictures.draw(snapshots, options.out):
            print(f"wrote {path}")
    except KeyboardInterrupt:
        sys.exit("demo was interrupted")
    if lost:
        sys.exit(f"demo failed: {lost} bodies were lost")
    print(f"no body lost; received {counts}")


def run(seconds: float) -> tuple[list[Snapshot], int, dict[str, int]]:
    """Start the processes and run the demo for ``seconds`` [s]. Return snapshots to draw, the largest number of lost
    bodies, and the number of messages by output."""
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    try:
        with demo_running() as demo:
            demo.wait_for(lambda: all(demo.counts.values()), "message on some output")
            return *watch(demo, seconds), demo.counts
    except (TimeoutError, RuntimeError) as error:
        sys.exit(f"demo failed: {error}")
    finally:
        rclpy.shutdown()
