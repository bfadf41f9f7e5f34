"""``make demo``: the whole system on a real elevation model with a wave over it, for about 15 seconds.

Terrain source and collider run as separate processes. The demo's own process spawns bodies, drives a robot, records
topics and draws them. It exits with 0 only if no body was lost. A body counts as lost if it is below the ground. One
that was put back onto the ground counts as well, unless the node missed deadlines: the ground, which moves in real
time, then jumps under the simulated bodies.
"""

from __future__ import annotations

import math
import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Any

import numpy as np
from sensor_msgs.msg import JointState
from shape_msgs.msg import SolidPrimitive

from smartmesh_ros.errors import InputError
from smartmesh_ros.scenes.eight import robot_file
from smartmesh_ros.startup.arguments import Parser, make_folder, number
from smartmesh_ros.startup.dds import isolated_unless_chosen
from smartmesh_ros.startup.executables import executable
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.tools.client.remote import OUTPUTS, Remote, following
from smartmesh_ros.tools.fleet import processes
from smartmesh_ros.tools.messages import pose_message

if TYPE_CHECKING:
    from smartmesh_ros.tools.demo.demo_pictures import Frame

SOURCE = {
    "scene": "elevation", "rate": 30.0, "resolution": 0.25, "relief": 3.0,
    "wave.amplitude": 0.1, "wave.number": 1.2, "wave.frequency": 4.0,
}  # fmt: skip
# Rates are lowered to 10 Hz, so that two cores suffice for three processes.
COLLIDER = {"publish.patches": 10.0, "publish.body_states": 10.0}
ROBOT = "husky"
# Numbers of bodies and links below the ground, and of bodies put back onto it so far, in the node's diagnostics.
BELOW, PUT_BACK = "below ground", "put back onto the ground"
WHEELS = [f"{ROBOT}/{place}_wheel" for place in ("front_left", "front_right", "rear_left", "rear_right")]
DRIVE = JointState(name=WHEELS, velocity=[6.0] * len(WHEELS))  # [rad/s]
SHAPES = (
    SolidPrimitive(type=SolidPrimitive.SPHERE, dimensions=[0.25]),
    SolidPrimitive(type=SolidPrimitive.BOX, dimensions=[0.6, 0.4, 0.3]),
    SolidPrimitive(type=SolidPrimitive.CYLINDER, dimensions=[0.4, 0.25]),
)
# Where two dozen bodies start, in a ring for each shape [m].
PLACES = [
    (reach * math.cos(angle), reach * math.sin(angle))
    for reach, angle in zip(8 * (5.0, 7.0, 9.0), 2.0 * math.pi * np.arange(24) / 24, strict=True)
]


class Demo:
    """Spawns bodies, drives the robot and tells the state, over a ``remote`` of the collider. ``nodes``: processes that
    must run, by name."""

    def __init__(self, remote: Remote, nodes: Mapping[str, subprocess.Popen[bytes]]) -> None:
        self._nodes = nodes
        self.remote = remote
        self._commands = remote.node.create_publisher(JointState, f"{remote.name}/joint_commands", 10)

    def shown(self) -> bool:
        """Take what has come; return True once there is something to draw and to tell."""
        self.remote.apply_waiting()
        return bool(self.remote.ground.tiles and self.remote.sight.poses and self.remote.timings)

    def frame(self, time: float) -> Frame:
        """Return what to draw at ``time`` [s] of the demo, of what was taken last."""
        from smartmesh_ros.tools.demo.demo_pictures import Frame  # needs Matplotlib

        sight, tile = self.remote.sight, self.remote.ground.tiles[""]
        assert isinstance(tile, HeightMap)
        grid = tile.geometry
        x, y = grid.to_world(0, np.arange(grid.columns))[:, 0], grid.to_world(np.arange(grid.rows), 0)[:, 1]
        patches = [patch.vertices_w[patch.triangles] for patch in sight.patches.values()]
        return Frame(
            time=time, x=x, y=y, heights=tile.heights,
            triangles=np.concatenate([np.empty((0, 3, 3)), *patches]),
            bodies={name: pose.position for name, pose in sight.poses.items()},
        )  # fmt: skip

    def spawn_all(self) -> None:
        """Spawn bodies of three shapes, and a wheeled robot."""
        # Bodies spawned before the node has a map would fall, and be below the ground when the map arrives.
        self.remote.wait_for(lambda: self.remote.tasks and self.count("tiles", "terrain"), "map in the node")
        for index, (x, y) in enumerate(PLACES):
            self._spawn(f"{['ball', 'box', 'can'][index % 3]}_{index}", x, y, 0.4, shape=SHAPES[index % 3])
        self._spawn(ROBOT, -4.0, 0.0, 0.02, urdf=str(robot_file()), align=True)

    def drive(self) -> None:
        """Command the robot's wheels."""
        self._commands.publish(DRIVE)

    def require_nodes(self) -> None:
        """Raise `InputError` if a node has ended."""
        for name, process in self._nodes.items():
            if process.poll() is not None:
                raise InputError("ended", f"{name} has ended, with {process.returncode}")
        if missing := self.remote.missing:
            raise InputError("missing", missing)

    def count(self, key: str, task: str = "bodies") -> int:
        """Return a count of a task in the node's diagnostics."""
        return next(int(pair.value) for pair in self.remote.tasks[task].values if pair.key == key)

    def line(self) -> str:
        """Return numbers of bodies and patches, the time of a step and the real-time factor in one line."""
        _, timing = self.remote.timings[-1]
        step = next((stage.p50_us for stage in timing.stages if stage.stage == "total"), 0.0)
        bodies, shown = len(self.remote.sight.poses), len(self.remote.sight.patches)
        words = [
            f"{bodies} bodies", f"{shown} patches", f"a step takes {1e-3 * step:.2f} ms",
            f"real-time factor {timing.real_time_factor:.2f}",
        ]  # fmt: skip
        lost, put_back = self.count(BELOW), self.count(PUT_BACK)
        counts = {"deadlines missed": timing.deadline_misses, "lost": lost, "put back": put_back}
        return ", ".join([*words, *(f"{count} {what}" for what, count in counts.items() if count)])

    def _spawn(self, name: str, x: float, y: float, clearance: float, **what: Any) -> None:
        pose = pose_message((x, y, 0.0))
        self.remote.call("spawn_body", id=name, mass=5.0, pose=pose, on_ground=True, clearance=clearance, **what)


@contextmanager
def demo_running(remote: Remote) -> Iterator[Demo]:
    """Run the demo's nodes, each in its own process, with its bodies and robot, for the length of the block."""
    commands: dict[str, list[str]] = {}
    for name, parameters in (("terrain_source", SOURCE), ("terrain_collider", COLLIDER)):
        given = [word for key, value in parameters.items() for word in ("-p", f"{key}:={value}")]
        commands[name] = [str(executable(name)), "--ros-args", *given]
    with processes(commands) as nodes:
        print("starting terrain_source and terrain_collider ...", flush=True)
        demo = Demo(remote, nodes)
        demo.spawn_all()
        yield demo


def watch(demo: Demo, seconds: float) -> tuple[list[Frame], int]:
    """Run the demo for ``seconds`` [s] and print a line a second. Return frames to draw and the largest number of lost
    bodies."""
    demo.remote.watch(set(OUTPUTS))
    demo.remote.wait_for(demo.shown, "map, state or timing")
    frames: list[Frame] = []
    lost = 0
    start = monotonic()
    next_line, next_frame = start + 1.0, start
    while (now := monotonic()) < start + seconds:
        demo.remote.spin(0.01)
        demo.require_nodes()
        if now >= next_frame:
            next_frame += 0.25
            demo.shown()
            frames.append(demo.frame(now - start))
            demo.drive()
        if now >= next_line:
            next_line += 1.0
            lost = max(lost, demo.count(BELOW))
            print(f"{now - start:5.1f} s  {demo.line()}", flush=True)
            if demo.count(BELOW):
                print(f"         {demo.remote.tasks['bodies'].message}", flush=True)
    if not any(timing.deadline_misses for _, timing in demo.remote.timings):
        lost += demo.count(PUT_BACK)
    return frames, max(lost, demo.count(BELOW))


def main(args: list[str] | None = None) -> None:
    """Run the demo."""
    parser = Parser(description=__doc__)
    seconds = number(float, 0.1, 3600.0)
    parser.add_argument("--seconds", type=seconds, default=15.0, help="duration of the recording (%(default)s)")
    parser.add_argument("--out", type=Path, default=Path("out"), help="folder of the pictures (%(default)s)")
    options = parser.parse_args(args)
    try:
        from smartmesh_ros.tools.demo import demo_pictures

        make_folder(options.out)
    except ModuleNotFoundError as error:
        sys.exit(f"demo failed: its pictures need {error.name}: pip install {error.name}")
    except InputError as error:
        sys.exit(f"demo failed: {error}")
    with isolated_unless_chosen(), following("/terrain_collider", "demo failed", sys.argv) as (remote, _):
        try:
            with demo_running(remote) as demo:
                frames, lost = watch(demo, options.seconds)
            print("drawing a picture and a clip, which takes up to a minute", flush=True)
            for path in demo_pictures.draw(frames, options.out):
                print(f"wrote {path}", flush=True)
        except KeyboardInterrupt:
            sys.exit("demo was interrupted")
    if lost:
        sys.exit(f"demo failed: {lost} bodies were lost")
    print("no body lost")
