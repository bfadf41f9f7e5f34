"""Short recordings with mixed inputs, and their digests: ``python -m tests.tools.replay.recordings``."""

import json
import math
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseArray, PoseStamped, TransformStamped, Twist, Vector3
from nav_msgs.msg import Odometry
from numpy.typing import NDArray
from rcl_interfaces.msg import Parameter, ParameterEvent
from sensor_msgs.msg import JointState
from shape_msgs.msg import SolidPrimitive
from smartmesh_msgs.msg import BodySpecification, HeightmapUpdate, TrackedBody, TrackedBodyArray
from smartmesh_msgs.srv import RemoveBody, SpawnBodies, SpawnBody, StepPhysics
from std_msgs.msg import String
from std_srvs.srv import SetBool, Trigger
from tf2_msgs.msg import TFMessage

from smartmesh_ros.node.timing.pacing import stamp_of
from smartmesh_ros.scenes import tracks
from smartmesh_ros.tools.replay.replay import Replay
from smartmesh_ros.tools.testing import bags, floats, heightmap_message, mesh_message, pose_message
from tests.grid_maps import grid_map_message
from tests.urdfs import HUSKY

Message = tuple[str, float, Any]
BEGIN = 1_700_000_000.0  # time of the recorder at the start [s]
SIDE, CELL = 41, 0.1  # of the maps [samples], [m]; their middle is at the origin
ORIGIN = (-0.5 * (SIDE - 1) * CELL, -0.5 * (SIDE - 1) * CELL, 0.0)
X, Y = np.meshgrid(ORIGIN[0] + CELL * np.arange(SIDE), ORIGIN[1] + CELL * np.arange(SIDE))
WHEELS = [f"{place}_wheel" for place in ("front_left", "front_right", "rear_left", "rear_right")]
TRACKS = ["left_track", "right_track"]
SHAPES = ("{shape: sphere, size: [0.12]", "{shape: box, size: [0.3, 0.2, 0.15]", "{shape: capsule, size: [0.2, 0.1]")


def bodies(count: int = 6) -> list[str]:
    """Entries of ``bodies.spawn`` of several shapes, on a circle of 1.2 m."""
    angles = [2.0 * math.pi * k / count for k in range(count)]
    places = [(1.2 * math.cos(angle), 1.2 * math.sin(angle)) for angle in angles]
    return [
        f"{SHAPES[k % 3]}, id: thing_{k}, mass: {1 + k}, xy: [{x:.3f}, {y:.3f}], clearance: 0.1, yaw: {0.3 * k}}}"
        for k, (x, y) in enumerate(places)
    ]


def wave(time: float, height: float = 0.1) -> NDArray[np.float64]:
    return np.asarray(height * np.sin(2.0 * X - 4.0 * time) * np.cos(Y))


def a_map(heights: Any, time: float, **options: Any) -> Message:
    options = {"resolution": CELL, "origin": ORIGIN, **options}
    return "heightmap", BEGIN + time, heightmap_message(heights, stamp=stamp_of(BEGIN + time), **options)


def every(period: float, seconds: float) -> Iterator[float]:
    return (period * k for k in range(round(seconds / period)))


def stamped(message: Any, time: float, frame_id: str = "map") -> Any:
    message.header.stamp, message.header.frame_id = stamp_of(BEGIN + time), frame_id
    return message


def maps() -> Iterator[Message]:
    """Waves, with jitter between stamp and arrival, and one late by more than a map's interval; then a pit that grows
    under the bodies, by regions of every shape, one of them outside of the map."""
    rng = np.random.default_rng(1)
    for time in every(0.05, 0.6):
        name, at, message = a_map(wave(time), time)
        yield name, at + (0.12 if abs(time - 0.3) < 0.01 else rng.uniform(0.002, 0.02)), message
    for number, time in enumerate(every(0.02, 0.4)):
        rows, columns = 5 + number % 7, 3 + number % 5
        update = HeightmapUpdate(x=20 + number, y=22 - number % 9, width=columns, height=rows)
        update.heights = floats(np.full(rows * columns, -0.01 * number, np.float32))
        yield "heightmap_update", BEGIN + 0.7 + time, stamped(update, 0.7 + time)


def grid_maps() -> Iterator[Message]:
    """Noisy maps with variances, which are corrections, around a rover whose odometry is in another frame."""
    rng = np.random.default_rng(2)
    step = TransformStamped(child_frame_id="odom")
    step.header.frame_id, step.transform.translation.x, step.transform.rotation.w = "map", 0.25, 1.0
    yield "/tf_static", BEGIN, TFMessage(transforms=[step])
    for time in every(0.05, 1.2):
        if abs(time % 0.2) < 1e-9 or abs(time % 0.2 - 0.2) < 1e-9:
            noise = rng.normal(0.0, 0.02, (SIDE, SIDE))
            heights = 0.1 * np.sin(X) + noise
            heights[rng.random((SIDE, SIDE)) < 0.02] = np.nan
            layers = {"elevation": heights, "variance": np.full((SIDE, SIDE), 4e-4)}
            yield "grid_map", BEGIN + time, grid_map_message(layers, CELL, start=(3, 7), stamp=stamp_of(BEGIN + time))
        pose = Odometry(child_frame_id="base_link")
        pose.pose.pose, pose.twist.twist.linear.x = pose_message((0.5 * time - 0.5, 0.0, 0.3)), 0.5
        yield "/odom", BEGIN + time + 0.003, stamped(pose, time, "odom")


def tiles() -> Iterator[Message]:
    """Two tiles of other resolutions, one that moves along with what it shows, with friction by place, and one that
    goes and comes back, with bodies across the seam."""
    for number, time in enumerate(every(0.1, 1.0)):
        shift = CELL * (number // 3)
        half = wave(time)[:, : SIDE // 2 + 1]
        friction = np.where(X + shift > -1.0, 0.3, 1.0)[:, : SIDE // 2 + 1]
        yield a_map(half, time, tile="west", origin=(ORIGIN[0] + shift, ORIGIN[1], 0.0), friction=friction)
        heights = np.zeros((3, 3)) if number == 4 else np.tile(0.05 * np.sin(4.0 * time), (21, 11))
        options = {"resolution": 0.2, "origin": (0.0, ORIGIN[1], 0.0), "tile": "east"}
        yield a_map(heights, time + 0.03, **options)
    yield "heightmap", BEGIN + 0.95, heightmap_message(np.empty((0, 0)), tile="east")


def robot() -> Iterator[Message]:
    """A husky that drives over waves, and a tracked machine, by commands of several kinds."""
    for time in every(0.1, 1.0):
        yield a_map(wave(time, 0.05), time)
        command = JointState(name=[*WHEELS, *TRACKS], velocity=[6.0 + 4.0 * time] * 4 + [0.5] * 2)
        if time > 0.6:
            command = JointState(name=[f"husky/{wheel}" for wheel in WHEELS], effort=[3.0, -3.0, 3.0, -3.0])
            yield "cmd_vel/machine", BEGIN + time + 0.04, Twist(angular=Vector3(z=0.8))
        yield "joint_commands", BEGIN + time + 0.05, command


def soil() -> Iterator[Message]:
    """Bodies and a described robot on loam beside softer soil, in which they leave prints."""
    yield a_map(0.02 * np.sin(3.0 * X), 0.0, soil=X > 0.3)
    yield "robot_description", BEGIN + 0.02, String(data=Path(HUSKY).read_text())
    for time in every(0.1, 0.8):
        yield "joint_commands", BEGIN + 0.1 + time, JointState(name=WHEELS, velocity=[5.0] * 4)


def tracked_bodies() -> Iterator[Message]:
    """Dictated poses of every kind, which push bodies about: some stop, jump, go, or are refused."""
    yield a_map(0.02 * np.cos(2.0 * X), 0.0)
    for number, time in enumerate(every(0.02, 1.0)):
        rover = TrackedBody(id="rover", pose=pose_message((time - 0.5, 0.1, 0.25), 0.2 * time), radius=0.2)
        others = [TrackedBody(id="rover")] if number == 20 else []
        yield "tracked_bodies", BEGIN + time, stamped(TrackedBodyArray(bodies=[rover, *others]), time)
        count = 4 if time < 0.5 else 2
        poses = [pose_message((0.6 * math.cos(k + time), 0.6 * math.sin(k + time), 0.2)) for k in range(count)]
        yield "body_poses", BEGIN + time + 0.001, stamped(PoseArray(poses=poses), time)
        jump = 1.0 if number == 30 else 0.0
        yield "/pose", BEGIN + time + 0.002, stamped(PoseStamped(pose=pose_message((jump, -time, 0.2))), time)
        transform = TransformStamped(child_frame_id="tool")
        transform.transform.translation.x, transform.transform.translation.y = -1.0 + time, 1.0 - time
        transform.transform.translation.z = 0.15
        yield "/tf", BEGIN + time + 0.003, TFMessage(transforms=[stamped(transform, time)])


def calls() -> Iterator[Message]:
    """Calls of services, of which some are refused, on a mesh that moves, and a parameter that is changed."""
    corners = np.array([(x, y, 0.0) for x in (-2.0, 0.0, 2.0) for y in (-2.0, 0.0, 2.0)])
    facets = [[k, k + 3, k + 1] for k in (0, 1, 3, 4)] + [[k + 3, k + 4, k + 1] for k in (0, 1, 3, 4)]
    yield "terrain_mesh", BEGIN, mesh_message(corners, facets)
    ball = SolidPrimitive(type=SolidPrimitive.SPHERE, dimensions=[0.15])
    for number in range(3):
        pose = pose_message((0.1 * number, 0.2, 0.5))
        request = SpawnBody.Request(id=f"ball_{number}", shape=ball, mass=1.0, pose=pose)
        yield "spawn_body", BEGIN + 0.05 * number, request
    yield "spawn_body", BEGIN + 0.2, SpawnBody.Request(id="ball_0", shape=ball, mass=1.0)
    box = SolidPrimitive(type=SolidPrimitive.BOX, dimensions=[0.3, 0.2, 0.2])
    some = [
        BodySpecification(id="husky", urdf=HUSKY, pose=pose_message((0.0, 0.0, 0.0)), on_ground=True),
        BodySpecification(id="box", shape=box, mass=3.0, pose=pose_message((1.0, 1.0, 0.4))),
    ]
    yield "spawn_bodies", BEGIN + 0.25, SpawnBodies.Request(bodies=some)
    changed = Parameter(name="physics.gravity")
    changed.value.type, changed.value.double_array_value = 8, [0.0, 1.0, -9.0]
    event = ParameterEvent(node="/terrain_collider", changed_parameters=[changed])
    yield "/parameter_events", BEGIN + 0.4, event
    yield "pause", BEGIN + 0.6, SetBool.Request(data=True)
    yield "step", BEGIN + 0.65, StepPhysics.Request(steps=30)
    yield "remove_body", BEGIN + 0.7, RemoveBody.Request(id="ball_1")
    yield "pause", BEGIN + 0.75, SetBool.Request(data=False)
    yield "reset", BEGIN + 0.9, Trigger.Request()
    yield "terrain_mesh", BEGIN + 1.0, mesh_message(corners + [0.0, 0.0, 0.05], facets, stamp=stamp_of(BEGIN + 1.0))


# The parameters of each recording, and its messages.
RECORDINGS: dict[str, tuple[dict[str, Any], Callable[[], Iterator[Message]]]] = {
    "maps": ({"bodies.spawn": bodies(), "height_scans": ["{body: thing_0, noise: 0.01}"]}, maps),
    "grid_maps": (
        {"terrain.input": "grid_map", "raster.variance_layer": "variance", "terrain.noise": 0.02,
         "bodies.odometry": ["rover=/odom"], "bodies.spawn": bodies(3)}, grid_maps),
    "tiles": ({"bodies.spawn": bodies(8)}, tiles),
    "robot": (
        {"bodies.spawn": [f"{{id: husky, urdf: {HUSKY}, xy: [0, 0], above: 0.3}}",
                          f"{{id: machine, urdf: {tracks.robot_file()}, xy: [-1, -1]}}", *bodies(3)],
         "imus": ["{body: machine, accelerometer_noise_density: 0.01, gyroscope_random_walk: 0.001}"],
         "bases": ["{body: machine, tracks: [left_track, right_track]}"]}, robot),
    "soil": ({"soil.type": ["sandy_loam", "lunar"], "bodies.spawn": bodies(3)}, soil),
    "tracked": (
        {"bodies.poses": ["arm=/pose"], "bodies.frames": ["tool"], "bodies.spawn": bodies(7), "publish.tf": 20.0},
        tracked_bodies),
    "calls": ({"simulation_interfaces": True}, calls),
}  # fmt: skip


def in_order(name: str) -> list[Message]:
    found = sorted(RECORDINGS[name][1](), key=lambda message: message[1])
    return [(topic if topic[0] == "/" else f"/terrain_collider/{topic}", time, one) for topic, time, one in found]


def digest_of(name: str, folder: Path) -> str:
    bags.write(folder / name, in_order(name))
    with Replay(folder / name, RECORDINGS[name][0]) as replay:
        replay.run()
        return replay.digest


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as made:
        print("\n" + json.dumps({name: digest_of(name, Path(made)) for name in RECORDINGS}))
