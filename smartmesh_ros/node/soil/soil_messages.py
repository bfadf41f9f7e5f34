"""Messages of the node ``soil``: contacts, the bodies that press, changed ground, and maps of which soil lies where."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import pybullet as pb
from numpy.typing import ArrayLike, NDArray
from pybullet_utils.bullet_client import BulletClient
from smartmesh_msgs.msg import BodyDescription, BodyDescriptionArray, ContactArray, HeightmapUpdate, TrackedBodyArray
from std_msgs.msg import Float32MultiArray, Header, MultiArrayDimension

from smartmesh_ros.errors import InputError
from smartmesh_ros.ground.config import PhysicsConfig
from smartmesh_ros.ground.shapes import SHAPES, shape_of
from smartmesh_ros.ground.state import BodyState
from smartmesh_ros.node.inputs.adapters import require_length, require_resolution
from smartmesh_ros.node.inputs.cdr_reader import require_cells, yaw_from
from smartmesh_ros.node.inputs.conversions import state_from
from smartmesh_ros.node.outputs.cdr import floats
from smartmesh_ros.patches.shapes import ShapeKind
from smartmesh_ros.soil.bodies import BulletBodies, GivenBodies, ManyBodies
from smartmesh_ros.soil.layer import Region
from smartmesh_ros.soil.soil import Soil
from smartmesh_ros.terrain.grid import GridGeometry
from smartmesh_ros.world.bodies import Body, BodyFactory
from smartmesh_ros.world.contacts import GroundContact
from smartmesh_ros.world.robots.prepared import prepare_robot


class SoilMap(NamedTuple):
    """Cells (rows, columns) of a map of soils: 0 = unknown, k = the k-th soil of the list.

    ``x``, ``y`` [m], ``yaw``: pose of the outer corner of the first cell in the terrain's frame. ``resolution`` [m]: of
    a cell.
    """

    cells: NDArray[np.uint8]
    x: float
    y: float
    yaw: float
    resolution: float

    def kinds_on(self, geometry: GridGeometry) -> NDArray[np.uint8]:
        """Return the cell in which each sample of a height map lies (rows, columns); 0 beside the map."""
        kinds = np.zeros((geometry.rows, geometry.columns), np.uint8)
        cos, sin = math.cos(self.yaw), math.sin(self.yaw)
        columns = np.arange(geometry.columns)
        for row in range(geometry.rows):
            x, y = (geometry.to_world(np.full(geometry.columns, row), columns) - (self.x, self.y)).T / self.resolution
            along, across = np.floor(cos * x + sin * y), np.floor(cos * y - sin * x)
            high, wide = self.cells.shape
            inside = (along >= 0) & (along < wide) & (across >= 0) & (across < high)
            kinds[row, inside] = self.cells[across[inside].astype(np.int64), along[inside].astype(np.int64)]
        return kinds


def soil_map_from(message: Any, count: int, max_cells: int) -> SoilMap:
    """Convert a message whose cells are -1 or the places of soils in a list of ``count``. Raises `InputError`."""
    info = message.info
    require_resolution(info.resolution)
    corner, turn = info.origin.position, info.origin.orientation
    if not (math.isfinite(corner.x) and math.isfinite(corner.y)):
        raise InputError("geometry", f"the origin is ({corner.x}, {corner.y}) m; it must be finite")
    require_cells(info.height * info.width, max_cells)
    require_length("the grid", len(message.data), info.height * info.width)
    cells = np.frombuffer(message.data, np.int8).reshape(info.height, info.width)
    if cells.size and not -1 <= cells.min() <= cells.max() < count:
        known = (
            f"places in the parameter soils, 0 to {count - 1}" if count else "in the parameter soils, which is empty"
        )
        raise InputError(
            "soil", f"cells are {cells.min()} to {cells.max()}; they must be -1, which is unknown, or {known}"
        )
    yaw = yaw_from(turn.x, turn.y, turn.z, turn.w)
    return SoilMap((cells + 1).astype(np.uint8), corner.x, corner.y, yaw, info.resolution)


def contacts_from(message: ContactArray) -> list[GroundContact]:
    """Convert a message; contacts of tracked bodies, which have no force, are left out. Raises `InputError`."""
    found = []
    for contact in message.contacts:
        numbers = (contact.position.x, contact.position.y, contact.position.z, contact.normal.z)
        if not np.isfinite(numbers).all() or np.isinf(contact.normal_force):
            raise InputError("non_finite", f"the contact of {contact.body_id!r} has values that are not finite")
        if contact.normal_force > 0.0:
            normal = (contact.normal.x, contact.normal.y, contact.normal.z)
            found.append(GroundContact(contact.body_id, numbers[:3], normal, contact.depth, contact.normal_force))
    return found


def update_message(header: Header, tile: str, region: Region) -> HeightmapUpdate:
    """Return a changed rectangle as a message."""
    height, width = region.heights.shape
    return HeightmapUpdate(
        header=header, tile=tile, x=region.column, y=region.row, width=width, height=height,
        heights=floats(region.heights), velocities=floats(region.velocities),
    )  # fmt: skip


def grid_map_message(kind: Any, header: Header, soil: Soil) -> Any:
    """Return the deformed terrain as a grid map of the class ``kind``: elevation and sinkage [m], pressure [Pa].

    Cell (0, 0) of a grid map is the one farthest along +x and +y. The map's yaw is not part of a grid map.
    """
    geometry = soil.map.geometry
    message = kind(header=header)
    message.info.resolution = geometry.resolution
    message.info.length_x = geometry.columns * geometry.resolution
    message.info.length_y = geometry.rows * geometry.resolution
    middle = geometry.to_world(0.5 * (geometry.rows - 1), 0.5 * (geometry.columns - 1))
    message.info.pose.position.x, message.info.pose.position.y = middle.tolist()
    message.info.pose.orientation.w = 1.0
    layers = {
        "elevation": soil.map.heights + np.float32(geometry.origin[2]),
        "sinkage": soil.sinkage(),
        "pressure": soil.layer.pressure,
    }
    message.layers, message.basic_layers = list(layers), ["elevation"]
    message.data = [_layer(values) for values in layers.values()]
    return message


def _layer(values: ArrayLike) -> Float32MultiArray:
    cells = np.asarray(values, np.float32).T[::-1, ::-1]  # rows along -x, columns along -y
    along_x, along_y = cells.shape
    message = Float32MultiArray(data=floats(cells.T))
    message.layout.dim = [
        MultiArrayDimension(label="column_index", size=along_y, stride=along_x * along_y),
        MultiArrayDimension(label="row_index", size=along_x, stride=along_x),
    ]
    return message


class MessageBodies:
    """Shapes and states of bodies and of the links of robots that press the soil, from a terrain_collider.

    Bodies come from ``~/body_states``. Links of robots are those of a copy of the robot in a PyBullet world that is
    never stepped: its description comes from ``~/body_descriptions``, its base from ``~/body_states``, and its joints
    from ``~/joint_states``.
    """

    def __init__(self) -> None:
        self._given = GivenBodies()
        self._client: Any = None
        self._robots: dict[str, Body] = {}
        self._described: dict[str, str] = {}
        self._links: BulletBodies | None = None

    def take_descriptions(self, message: BodyDescriptionArray) -> list[InputError]:
        """Take the robots of a message; return what is wrong with those that do not load, which press nothing."""
        wanted = {body.id: body for body in message.bodies if body.shape == BodyDescription.ROBOT}
        for name in [name for name in self._robots if name not in wanted or wanted[name].urdf != self._described[name]]:
            self._client.removeBody(self._robots.pop(name).uid)
        problems = []
        for name, body in wanted.items():
            if name not in self._robots:
                self._described[name] = body.urdf
                try:
                    self._load(name, body)
                except InputError as error:
                    problems.append(InputError(error.reason, f"robot {name!r} presses no soil: {error}"))
        return problems

    def take_states(self, message: TrackedBodyArray) -> None:
        """Take the states of all bodies."""
        for body in message.bodies:
            state = state_from(body.pose, body.twist)
            if body.id in self._robots:
                self._place(self._robots[body.id], state)
            elif body.shape in SHAPES:
                shape = shape_of(ShapeKind(body.shape), body.dimensions.tolist(), body.centre.tolist())
                self._given.put(
                    body.id, shape.body_shape, (*state.position, *state.orientation, *state.linear, *state.angular)
                )
        self._given.keep(body.id for body in message.bodies)

    def take_joints(self, positions: Mapping[str, float], velocities: Mapping[str, float]) -> None:
        """Take the positions [rad, m] and velocities of joints, named ``<robot>/<joint>``, or ``<joint>`` for the robot
        without prefix."""
        for name, robot in self._robots.items():
            for joint, index in robot.joints.items():
                key = f"{name}/{joint}" if f"{name}/{joint}" in positions else joint
                if key in positions:
                    self._client.resetJointState(robot.uid, index, positions[key], velocities.get(key, 0.0))

    def read(self, names: list[str]) -> ManyBodies:
        """Return bodies and links by name."""
        given = self._given.read(names)
        if self._links is None:
            return given
        links = self._links.read(names)
        shapes = [shape or link for shape, link in zip(given.shapes, links.shapes, strict=True)]
        return ManyBodies(shapes, given.states + links.states)

    def set_grip(self, name: str, grip: float) -> None:
        """Do nothing: friction belongs to the collider's node, which has no topic for it."""

    def close(self) -> None:
        """Close the PyBullet world of the robots."""
        if self._client is not None:
            self._client.disconnect()

    def _load(self, name: str, body: BodyDescription) -> None:
        if self._client is None:
            self._client = BulletClient(pb.DIRECT)
        prepared = prepare_robot(body.urdf_file or body.urdf)
        made = BodyFactory(self._client, PhysicsConfig()).robot(name, prepared, BodyState())
        self._robots[name] = made
        self._links = BulletBodies(self._client)
        for robot in self._robots.values():
            for link, part in robot.links.items():
                try:
                    self._links.add(f"{robot.name}/{part}", robot.uid, link)
                except InputError:
                    continue  # a mesh: its contacts are refused by name

    def _place(self, robot: Body, state: BodyState) -> None:
        self._client.resetBasePositionAndOrientation(robot.uid, state.position, state.orientation)
        self._client.resetBaseVelocity(robot.uid, state.linear, state.angular)
