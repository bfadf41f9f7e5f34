"""Good messages of every input, to be spoilt."""

from typing import Any

import numpy as np
from geometry_msgs.msg import PoseArray, PoseStamped, TransformStamped
from nav_msgs.msg import OccupancyGrid, Odometry
from numpy.typing import NDArray
from rcl_interfaces import srv as parameters
from rclpy.parameter import Parameter
from sensor_msgs.msg import Image, JointState, PointCloud2, PointField
from shape_msgs.msg import SolidPrimitive
from smartmesh_msgs.msg import BodySpecification, HeightmapUpdate, TerrainMeshUpdate, TrackedBody, TrackedBodyArray
from smartmesh_msgs.srv import (
    CastRays,
    QueryGround,
    RemoveBodies,
    RemoveBody,
    RestoreState,
    SaveState,
    SpawnBodies,
    SpawnBody,
    StartEpisode,
    StepPhysics,
)
from std_msgs.msg import String
from std_srvs.srv import SetBool, Trigger

from smartmesh_ros.node.inputs.optional_messages import find_message
from smartmesh_ros.tools.testing import floats, heightmap_message, mesh_message, point_message, pose_message
from tests import urdfs
from tests.grid_maps import grid_map_message

ROWS, COLUMNS, RESOLUTION = 14, 17, 0.25
SIZE, CYLINDER = (0.3, 0.3, 0.2), '<cylinder radius="0.1" length="0.05"/>'
ROBOT = urdfs.robot(
    urdfs.link("base", urdfs.box(SIZE), 1.0, SIZE), urdfs.link("wheel", CYLINDER, 0.2, (0.2, 0.2, 0.2)),
    urdfs.joint("axle", "continuous", "base", "wheel", xyz="0 0.2 0"),
)  # fmt: skip


def heights(rng: np.random.Generator) -> NDArray[np.float32]:
    """A small map, at times with holes."""
    values = rng.normal(size=(ROWS, COLUMNS)).astype(np.float32) * 0.2
    if rng.random() < 0.3:
        values[rng.random(values.shape) < 0.1] = np.nan
    return values


def _place(rng: np.random.Generator) -> Any:
    x, y = rng.uniform(-0.5, 4.5, 2)
    return pose_message((x, y, float(rng.uniform(0.0, 0.5))))


def _framed(message: Any, frame_id: str = "map") -> Any:
    message.header.frame_id = frame_id
    return message


def make(name: str, rng: np.random.Generator) -> Any:
    """A good message for an input by the last part of its name."""
    return _MAKERS[name](rng)


def _heightmap(rng: np.random.Generator) -> Any:
    tile, origin = [("", (0.0, 0.0, 0.0)), ("far", (9.0, 1.0, 0.5))][int(rng.random() < 0.3)]
    speeds = rng.normal(size=(ROWS, COLUMNS)) if rng.random() < 0.3 else None
    friction = [None, None, rng.uniform(0.0, 2.0), rng.uniform(0.0, 2.0, (ROWS, COLUMNS))][int(rng.integers(4))]
    return heightmap_message(heights(rng), resolution=RESOLUTION, origin=origin, tile=tile, velocities=speeds,
                             friction=friction, yaw=float(rng.choice([0.0, 0.4])),
                             soil=rng.integers(0, 3, (ROWS, COLUMNS)) if rng.random() < 0.3 else None,
                             layers={"rolling": rng.uniform(0.0, 0.2)} if rng.random() < 0.3 else {})  # fmt: skip


def _update(rng: np.random.Generator) -> Any:
    height, width = int(rng.integers(1, 6)), int(rng.integers(1, 6))
    y, x = int(rng.integers(0, ROWS - 5)), int(rng.integers(0, COLUMNS - 5))
    new = rng.normal(size=height * width).astype(np.float32)
    tile = "far" if rng.random() < 0.3 else ""
    return _framed(HeightmapUpdate(tile=tile, x=x, y=y, width=width, height=height, heights=floats(new)))


def _vertices(rng: np.random.Generator) -> NDArray[np.float64]:
    x, y = np.meshgrid(np.arange(5) * 0.5 + 20.0, np.arange(4) * 0.5)
    return np.column_stack([x.ravel(), y.ravel(), rng.normal(size=20) * 0.1])


def _mesh(rng: np.random.Generator) -> Any:
    corner = np.array([row * 5 + column for row in range(3) for column in range(4)])[:, None]
    triangles = np.concatenate([corner + (0, 1, 6), corner + (0, 6, 5)])
    return mesh_message(_vertices(rng), triangles, tile="mesh")


def _mesh_update(rng: np.random.Generator) -> Any:
    chosen = np.sort(rng.choice(20, 4, replace=False))
    message = TerrainMeshUpdate(tile="mesh", indices=chosen.tolist())
    message.vertices = [point_message(vertex) for vertex in _vertices(rng)[chosen]]
    return _framed(message)


def _tracked(rng: np.random.Generator) -> Any:
    bodies = [
        TrackedBody(id=name, pose=_place(rng), radius=float(rng.choice([0.0, 0.1, 0.3])))
        for name in ("rover", "walker", "b")[: int(rng.integers(1, 4))]
    ]
    return _framed(TrackedBodyArray(bodies=bodies))


def _odometry(rng: np.random.Generator) -> Any:
    message = _framed(Odometry())
    message.pose.pose = _place(rng)
    return message


def _image(rng: np.random.Generator) -> Any:
    data = heights(rng).tobytes()
    return _framed(Image(height=ROWS, width=COLUMNS, encoding="32FC1", step=COLUMNS * 4, data=data))


def _occupancy(rng: np.random.Generator) -> Any:
    message = _framed(OccupancyGrid(data=rng.integers(-1, 101, ROWS * COLUMNS).tolist()))
    message.info.height, message.info.width, message.info.resolution = ROWS, COLUMNS, RESOLUTION
    message.info.origin.orientation.w = 1.0
    return message


def _occupancy_update(rng: np.random.Generator) -> Any:
    kind: Any = find_message("map_msgs", "OccupancyGridUpdate")
    return _framed(kind(x=2, y=3, width=4, height=2, data=rng.integers(-1, 101, 8).tolist()))


def _cloud(rng: np.random.Generator) -> Any:
    y, x = np.meshgrid(np.arange(ROWS) * RESOLUTION, np.arange(COLUMNS) * RESOLUTION, indexing="ij")
    points = np.stack([x, y, heights(rng)], axis=-1).astype(np.float32)
    fields = [PointField(name=name, offset=4 * i, datatype=PointField.FLOAT32, count=1) for i, name in enumerate("xyz")]
    return _framed(
        PointCloud2(height=ROWS, width=COLUMNS, fields=fields, point_step=12, row_step=12 * COLUMNS,
                    data=points.tobytes())
    )  # fmt: skip


def _grid_map(rng: np.random.Generator) -> Any:
    return grid_map_message(
        {"elevation": heights(rng)}, RESOLUTION, (2.0, 2.0, 0.0), start=(int(rng.integers(COLUMNS)), 0)
    )


def _transforms(rng: np.random.Generator) -> Any:
    kind: Any = find_message("tf2_msgs", "TFMessage")
    transforms = []
    for child in ("tool", "odom"):
        transform = _framed(TransformStamped(child_frame_id=child))
        pose = _place(rng)
        transform.transform.translation.x, transform.transform.translation.y = pose.position.x, pose.position.y
        transform.transform.rotation = pose.orientation
        transforms.append(transform)
    return kind(transforms=transforms)


def _spawn(rng: np.random.Generator) -> Any:
    name = str(rng.choice(["ball", "crate", "tin", "robot", "again"]))
    request = SpawnBody.Request(id=name, mass=1.0, pose=_place(rng))
    if rng.random() < 0.3:
        request.on_ground, request.align = True, bool(rng.random() < 0.5)
        request.clearance = float(rng.uniform(0.0, 0.5))
    if name == "robot":
        request.urdf = ROBOT
    elif name == "crate":
        request.shape = SolidPrimitive(type=SolidPrimitive.BOX, dimensions=[0.3, 0.2, 0.2])
    elif name == "tin":
        request.shape = SolidPrimitive(type=SolidPrimitive.CYLINDER, dimensions=[0.3, 0.1])
    else:
        request.shape = SolidPrimitive(type=SolidPrimitive.SPHERE, dimensions=[0.2])
    return request


def _query(rng: np.random.Generator) -> Any:
    x, y = rng.uniform(-5.0, 15.0, (2, int(rng.integers(0, 6)))).tolist()
    request = QueryGround.Request(x=x, y=y, below=x if rng.random() < 0.3 else [])
    request.header.frame_id = str(rng.choice(["", "map", "odom", "ball"]))
    return request


def _cast(rng: np.random.Generator) -> Any:
    origins, directions = rng.normal(scale=5.0, size=(2, 3 * int(rng.integers(0, 6)))).tolist()
    request = CastRays.Request(origins=origins, directions=directions, range=float(rng.uniform(0.1, 50.0)))
    request.header.frame_id = str(rng.choice(["", "map", "odom", "ball"]))
    return request


def _spawn_all(rng: np.random.Generator) -> Any:
    bodies = []
    for _ in range(int(rng.integers(1, 4))):
        one = _spawn(rng)
        bodies.append(BodySpecification(id=one.id, mass=one.mass, pose=one.pose, urdf=one.urdf, shape=one.shape))
    return SpawnBodies.Request(bodies=bodies)


_SETTINGS: tuple[tuple[str, Any], ...] = (
    ("physics.rate", 120.0), ("physics.gravity", [0.0, 0.0, -3.0]), ("physics.sleep", False),
    ("publish.incremental", True), ("bodies.timeout", 0.5),
)  # fmt: skip


def _settings(kind: Any) -> Any:
    def make_settings(rng: np.random.Generator) -> Any:
        chosen = [_SETTINGS[int(i)] for i in rng.integers(len(_SETTINGS), size=int(rng.integers(1, 3)))]
        return kind.Request(parameters=[Parameter(name, value=value).to_parameter_msg() for name, value in chosen])

    return make_settings


_NAMES = ["physics.rate", "terrain.motion", "raster.origin"]
_MAKERS: dict[str, Any] = {
    "heightmap": _heightmap,
    "heightmap_update": _update,
    "terrain_mesh": _mesh,
    "terrain_mesh_update": _mesh_update,
    "tracked_bodies": _tracked,
    "body_poses": lambda rng: _framed(PoseArray(poses=[_place(rng) for _ in range(int(rng.integers(0, 4)))])),
    "pose_in": lambda rng: _framed(PoseStamped(pose=_place(rng)), str(rng.choice(["map", "odom"]))),
    "odometry_in": _odometry,
    "tf": _transforms,
    "tf_static": _transforms,
    "robot_description": lambda rng: String(data=ROBOT.replace("0.3 0.3 0.2", f"0.3 0.3 {rng.uniform(0.1, 0.3):.2f}")),
    "joint_commands": lambda rng: JointState(name=["robot/axle"], velocity=[float(rng.normal())]),
    "image": _image,
    "occupancy_grid": _occupancy,
    "occupancy_grid_update": _occupancy_update,
    "point_cloud": _cloud,
    "grid_map": _grid_map,
    "spawn_body": _spawn,
    "remove_body": lambda rng: RemoveBody.Request(id=str(rng.choice(["ball", "crate", "robot", "rover"]))),
    "spawn_bodies": _spawn_all,
    "remove_bodies": lambda rng: RemoveBodies.Request(ids=["ball", str(rng.choice(["crate", "tin", "ball"]))]),
    "query_ground": _query,
    "cast_rays": _cast,
    "step": lambda rng: StepPhysics.Request(steps=int(rng.integers(1, 4))),
    "reset": lambda rng: Trigger.Request(),
    "save_state": lambda rng: SaveState.Request(),
    "restore_state": lambda rng: RestoreState.Request(state=bytes(rng.bytes(64))),
    "start_episode": lambda rng: StartEpisode.Request(seed=int(rng.integers(9))),
    "reset_terrain_clock": lambda rng: Trigger.Request(),
    "pause": lambda rng: SetBool.Request(data=bool(rng.random() < 0.2)),
    "set_parameters": _settings(parameters.SetParameters),
    "set_parameters_atomically": _settings(parameters.SetParametersAtomically),
    "get_parameters": lambda rng: parameters.GetParameters.Request(names=_NAMES),
    "get_parameter_types": lambda rng: parameters.GetParameterTypes.Request(names=_NAMES),
    "describe_parameters": lambda rng: parameters.DescribeParameters.Request(names=_NAMES),
    "list_parameters": lambda rng: parameters.ListParameters.Request(prefixes=["physics"], depth=2),
}
