"""Good messages of every input, to be spoilt."""

from typing import Any

import numpy as np
from geometry_msgs.msg import (
    PoseArray,
    PoseStamped,
    PoseWithCovariance,
    Quaternion,
    Transform,
    TransformStamped,
    Vector3,
)
from nav_msgs.msg import MapMetaData, OccupancyGrid, Odometry
from numpy.typing import NDArray
from rcl_interfaces import srv as parameters
from rclpy.parameter import Parameter
from sensor_msgs.msg import Image, JointState
from shape_msgs.msg import SolidPrimitive
from smartmesh_msgs import srv
from smartmesh_msgs.msg import BodySpecification, HeightmapUpdate, TerrainMeshUpdate, TrackedBody, TrackedBodyArray
from std_msgs.msg import Header, String
from std_srvs.srv import SetBool, Trigger

from smartmesh_ros.node.inputs.optional_messages import find_class
from smartmesh_ros.node.sensor.terrain_sensor import cloud_message
from smartmesh_ros.tools.testing import floats, heightmap_message, mesh_message, point_message, pose_message
from tests import urdfs
from tests.grid_maps import grid_map_message

ROWS, COLUMNS, RESOLUTION = 14, 17, 0.25
SIZE, CYLINDER = (0.3, 0.3, 0.2), '<cylinder radius="0.1" length="0.05"/>'
ROBOT = urdfs.robot(
    urdfs.link("base", urdfs.box(SIZE), 1.0, SIZE), urdfs.link("wheel", CYLINDER, 0.2, (0.2, 0.2, 0.2)),
    urdfs.joint("axle", "continuous", "base", "wheel", xyz="0 0.2 0"),
)  # fmt: skip


def some(rng: np.random.Generator, share: float, value: Any) -> Any:
    """The value, in a share of all calls; else None."""
    return value if rng.random() < share else None


def one_of(rng: np.random.Generator, *values: Any) -> Any:
    return values[int(rng.integers(len(values)))]


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
    tile, origin = one_of(rng, ("", (0.0, 0.0, 0.0)), ("", (0.0, 0.0, 0.0)), ("far", (9.0, 1.0, 0.5)))
    return heightmap_message(
        heights(rng), resolution=RESOLUTION, origin=origin, tile=tile, yaw=one_of(rng, 0.0, 0.4),
        velocities=some(rng, 0.3, rng.normal(size=(ROWS, COLUMNS))),
        friction=one_of(rng, None, None, rng.uniform(0.0, 2.0), rng.uniform(0.0, 2.0, (ROWS, COLUMNS))),
        soil=some(rng, 0.3, rng.integers(0, 3, (ROWS, COLUMNS))),
        layers=some(rng, 0.3, {"rolling": rng.uniform(0.0, 0.2)}) or {},
    )  # fmt: skip


def _update(rng: np.random.Generator) -> Any:
    height, width = rng.integers(1, 6, 2).tolist()
    y, x = int(rng.integers(0, ROWS - 5)), int(rng.integers(0, COLUMNS - 5))
    new = floats(rng.normal(size=height * width).astype(np.float32))
    return _framed(HeightmapUpdate(tile=one_of(rng, "", "far"), x=x, y=y, width=width, height=height, heights=new))


def _vertices(rng: np.random.Generator) -> NDArray[np.float64]:
    x, y = np.meshgrid(np.arange(5) * 0.5 + 20.0, np.arange(4) * 0.5)
    return np.column_stack([x.ravel(), y.ravel(), rng.normal(size=20) * 0.1])


def _mesh_update(rng: np.random.Generator) -> Any:
    chosen = np.sort(rng.choice(20, 4, replace=False))
    vertices = [point_message(vertex) for vertex in _vertices(rng)[chosen]]
    return _framed(TerrainMeshUpdate(tile="mesh", indices=chosen.tolist(), vertices=vertices))


def _tracked(rng: np.random.Generator) -> Any:
    names = ("rover", "walker", "b")[: int(rng.integers(1, 4))]
    bodies = [TrackedBody(id=name, pose=_place(rng), radius=one_of(rng, 0.0, 0.1, 0.3)) for name in names]
    return _framed(TrackedBodyArray(bodies=bodies))


def _odometry(rng: np.random.Generator) -> Any:
    return _framed(Odometry(pose=PoseWithCovariance(pose=_place(rng))))


def _image(rng: np.random.Generator) -> Any:
    data = heights(rng).tobytes()
    return _framed(Image(height=ROWS, width=COLUMNS, encoding="32FC1", step=COLUMNS * 4, data=data))


def _occupancy(rng: np.random.Generator) -> Any:
    info = MapMetaData(height=ROWS, width=COLUMNS, resolution=RESOLUTION, origin=pose_message((0.0, 0.0, 0.0)))
    return _framed(OccupancyGrid(info=info, data=rng.integers(-1, 101, ROWS * COLUMNS).tolist()))


def _occupancy_update(rng: np.random.Generator) -> Any:
    kind: Any = find_class("map_msgs/msg/OccupancyGridUpdate")
    return _framed(kind(x=2, y=3, width=4, height=2, data=rng.integers(-1, 101, 8).tolist()))


def _cloud(rng: np.random.Generator) -> Any:
    y, x = np.mgrid[:ROWS, :COLUMNS] * RESOLUTION
    cloud = cloud_message(Header(frame_id="map"), np.stack([x, y, heights(rng)], axis=-1).reshape(-1, 3))
    cloud.height, cloud.width, cloud.row_step = ROWS, COLUMNS, 12 * COLUMNS
    return cloud


def _grid_map(rng: np.random.Generator) -> Any:
    start = (int(rng.integers(COLUMNS)), 0)
    return grid_map_message({"elevation": heights(rng)}, RESOLUTION, (2.0, 2.0, 0.0), start=start)


def _transforms(rng: np.random.Generator) -> Any:
    kind: Any = find_class("tf2_msgs/msg/TFMessage")
    places = [pose.position for pose in (_place(rng), _place(rng))]
    moves = [Transform(translation=Vector3(x=place.x, y=place.y), rotation=Quaternion(w=1.0)) for place in places]
    children = zip(("tool", "odom"), moves, strict=True)
    return kind(transforms=[_framed(TransformStamped(child_frame_id=name, transform=move)) for name, move in children])


# Kinds and dimensions of the bodies that are spawned, by name; the robot has a description.
_SHAPES = {"crate": (SolidPrimitive.BOX, [0.3, 0.2, 0.2]), "tin": (SolidPrimitive.CYLINDER, [0.3, 0.1])}


def _spawn(rng: np.random.Generator, kind: Any = srv.SpawnBody.Request) -> Any:
    name = one_of(rng, "ball", "crate", "tin", "robot", "again")
    form, dimensions = _SHAPES.get(name, (SolidPrimitive.SPHERE, [0.2]))
    shape = SolidPrimitive() if name == "robot" else SolidPrimitive(type=form, dimensions=dimensions)
    request = kind(id=name, mass=1.0, pose=_place(rng), shape=shape, urdf=ROBOT if name == "robot" else "")
    if kind is srv.SpawnBody.Request and rng.random() < 0.3:
        request.on_ground, request.align, request.clearance = True, one_of(rng, True, False), rng.uniform(0.0, 0.5)
    return request


def _query(rng: np.random.Generator) -> Any:
    x, y = rng.uniform(-5.0, 15.0, (2, int(rng.integers(0, 6)))).tolist()
    request = srv.QueryGround.Request(x=x, y=y, below=one_of(rng, x, [], []))
    return _framed(request, one_of(rng, "", "map", "odom", "ball"))


def _cast(rng: np.random.Generator) -> Any:
    origins, directions = rng.normal(scale=5.0, size=(2, 3 * int(rng.integers(0, 6)))).tolist()
    request = srv.CastRays.Request(origins=origins, directions=directions, range=float(rng.uniform(0.1, 50.0)))
    return _framed(request, one_of(rng, "", "map", "odom", "ball"))


_SETTINGS: tuple[tuple[str, Any], ...] = (
    ("physics.rate", 120.0), ("physics.gravity", [0.0, 0.0, -3.0]), ("physics.sleep", False),
    ("publish.incremental", True), ("bodies.timeout", 0.5),
)  # fmt: skip


def _settings(kind: Any) -> Any:
    def make_settings(rng: np.random.Generator) -> Any:
        chosen = [one_of(rng, *_SETTINGS) for _ in range(int(rng.integers(1, 3)))]
        return kind.Request(parameters=[Parameter(name, value=value).to_parameter_msg() for name, value in chosen])

    return make_settings


_NAMES = ["physics.rate", "terrain.motion", "raster.origin"]
_TRIANGLES = [(v, v + i, v + j) for v in range(14) if v % 5 < 4 for i, j in ((1, 6), (6, 5))]
_MAKERS: dict[str, Any] = {
    "heightmap": _heightmap,
    "heightmap_update": _update,
    "terrain_mesh": lambda rng: mesh_message(_vertices(rng), _TRIANGLES, tile="mesh"),
    "terrain_mesh_update": _mesh_update,
    "tracked_bodies": _tracked,
    "body_poses": lambda rng: _framed(PoseArray(poses=[_place(rng) for _ in range(int(rng.integers(0, 4)))])),
    "pose_in": lambda rng: _framed(PoseStamped(pose=_place(rng)), one_of(rng, "map", "odom")),
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
    "remove_body": lambda rng: srv.RemoveBody.Request(id=one_of(rng, "ball", "crate", "robot", "rover")),
    "spawn_bodies": lambda rng: srv.SpawnBodies.Request(bodies=[_spawn(rng, BodySpecification) for _ in range(2)]),
    "remove_bodies": lambda rng: srv.RemoveBodies.Request(ids=["ball", one_of(rng, "crate", "tin", "ball")]),
    "query_ground": _query,
    "cast_rays": _cast,
    "step": lambda rng: srv.StepPhysics.Request(steps=int(rng.integers(1, 4))),
    "reset": lambda rng: Trigger.Request(),
    "save_state": lambda rng: srv.SaveState.Request(),
    "restore_state": lambda rng: srv.RestoreState.Request(state=bytes(rng.bytes(64))),
    "start_episode": lambda rng: srv.StartEpisode.Request(seed=int(rng.integers(9))),
    "reset_terrain_clock": lambda rng: Trigger.Request(),
    "pause": lambda rng: SetBool.Request(data=bool(rng.random() < 0.2)),
    "set_parameters": _settings(parameters.SetParameters),
    "set_parameters_atomically": _settings(parameters.SetParametersAtomically),
    "get_parameters": lambda rng: parameters.GetParameters.Request(names=_NAMES),
    "get_parameter_types": lambda rng: parameters.GetParameterTypes.Request(names=_NAMES),
    "describe_parameters": lambda rng: parameters.DescribeParameters.Request(names=_NAMES),
    "list_parameters": lambda rng: parameters.ListParameters.Request(prefixes=["physics"], depth=2),
}
