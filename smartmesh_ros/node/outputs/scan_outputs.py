"""Outputs of the ground around a body: height scans for policies, and grid maps with all that is known of it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from std_msgs.msg import Float32MultiArray, Header, MultiArrayDimension, MultiArrayLayout

from smartmesh_ros.node.inputs.optional_messages import class_of
from smartmesh_ros.node.outputs.cdr import floats
from smartmesh_ros.node.outputs.rates import Beat
from smartmesh_ros.node.parameters.entries import OutputEntry
from smartmesh_ros.node.session import Session
from smartmesh_ros.soil.soil import Soil
from smartmesh_ros.terrain.grid import FloatArray, GridGeometry
from smartmesh_ros.world.height_scanner import HeightScanner
from smartmesh_ros.world.world import World


class ScanOutput:
    """``~/height_scan/<body>``, for policies of legged robots: the scan of an entry of ``height_scans`` at its rate in
    simulated time, while it has subscribers and its body is there. ``publisher``: of the scan."""

    def __init__(self, session: Session, entry: OutputEntry) -> None:
        self._world, self._entry, self._beat = session.world, entry, Beat(session.world, entry.rate)
        self.publisher = session.publisher(Float32MultiArray, entry.topic)
        (slow, rows), (fast, columns) = entry.config.layout  # axes of the body's yaw frame
        dimensions = [
            MultiArrayDimension(label=slow, size=rows, stride=rows * columns),
            MultiArrayDimension(label=fast, size=columns, stride=columns),
        ]
        self._layout = MultiArrayLayout(dim=dimensions)
        self._scanner = HeightScanner(session.world, entry.body, entry.config)

    def publish(self, *, now: bool) -> None:
        """Scan if that is due, or ``now``, and publish the values that are known by now."""
        if not self.publisher.get_subscription_count() or self._entry.body not in self._world.bodies:
            self._scanner.forget()
            return
        if self._beat.is_due(now=now):
            self._scanner.measure()
        if (values := self._scanner.take()) is not None:
            self.publisher.publish(Float32MultiArray(layout=self._layout, data=floats(values[0])))


class GroundMapOutput:
    """``~/ground_map/<body>``: the true ground of an entry of ``ground_maps`` at its rate in simulated time, while it
    has subscribers, its body is there, and there is ground. ``publisher``: of the map."""

    def __init__(self, session: Session, entry: OutputEntry) -> None:
        self._session, self._entry, self._beat = session, entry, Beat(session.world, entry.rate)
        self._kind = class_of("grid_map_msgs/msg/GridMap", "ground_maps")
        self.publisher = session.publisher(self._kind, entry.topic)

    def publish(self, *, now: bool) -> None:
        session, entry, world = self._session, self._entry, self._session.world
        seen = self.publisher.get_subscription_count() and entry.body in world.bodies and not world.terrain.empty
        if not seen or not self._beat.is_due(now=now):
            return
        header = Header(stamp=session.stamp_now(), frame_id=session.frame_id)
        grid = grid_around(world.base_state(entry.body).position, entry.config.size, entry.config.spacing)
        self.publisher.publish(grid_map_message(self._kind, header, grid, ground_layers(world, grid)))


def grid_around(position: tuple[float, float, float], size: tuple[float, float], spacing: float) -> GridGeometry:
    """Return the grid of cells of a ``size`` (x, y) [m] around a position, whose middles are multiples of their
    ``spacing`` [m]: it moves by whole cells."""
    columns, rows = (max(round(length / spacing), 3) for length in size)
    first = [spacing * (round(at / spacing) - count // 2) for at, count in zip(position, (columns, rows), strict=False)]
    return GridGeometry(rows=rows, columns=columns, resolution=spacing, origin=(first[0], first[1], 0.0))


def ground_layers(world: World, grid: GridGeometry) -> dict[str, FloatArray]:
    """Return what a world knows of its ground at the samples of a grid, by the names of layers, each (rows, columns);
    NaN = no ground."""
    xy_w = grid.to_world(*np.mgrid[: grid.rows, : grid.columns]).reshape(-1, 2)
    found = world.ground_at(xy_w)
    layers = {"elevation": found.z}
    layers |= {f"velocity_{axis}": found.velocities[:, k] for k, axis in enumerate("xyz")}
    layers |= {f"normal_{axis}": found.normals[:, k] for k, axis in enumerate("xyz")}
    layers |= {"friction": found.friction, "sinkage": _sinkage(world, xy_w, found.z), "age": found.ages}
    return {name: values.reshape(grid.rows, grid.columns) for name, values in layers.items()}


def _sinkage(world: World, xy_w: FloatArray, z: FloatArray) -> FloatArray:
    """Return how deep the ground of heights ``z`` (N,) [m] at points (N, 2) was pressed (N,) [m]; zero beside soil."""
    soil, sinkage = world.ground.soil, np.where(np.isnan(z), np.nan, 0.0)
    if isinstance(soil, Soil):
        grid, places = soil.map.geometry, np.rint(soil.map.geometry.to_grid(xy_w)).astype(np.int64)
        on_map = ((places >= 0) & (places <= grid.last)).all(axis=1)
        chosen = on_map & (soil.map.at(xy_w, world.time).heights == z)
        sinkage[chosen] = soil.sinkage()[tuple(places[chosen].T)]
    return sinkage


def grid_map_message(kind: Any, header: Header, grid: GridGeometry, layers: Mapping[str, ArrayLike]) -> Any:
    """Return ``layers`` (rows, columns) of a grid as a grid map of the class ``kind``; its basic layer is the first.

    Cell (0, 0) of a grid map is the one farthest along +x and +y. The grid's yaw is not part of a grid map.
    """
    message = kind(header=header)
    message.info.resolution = grid.resolution
    message.info.length_x, message.info.length_y = grid.columns * grid.resolution, grid.rows * grid.resolution
    middle = grid.to_world(0.5 * (grid.rows - 1), 0.5 * (grid.columns - 1))
    message.info.pose.position.x, message.info.pose.position.y = middle.tolist()
    message.info.pose.orientation.w = 1.0
    message.layers, message.basic_layers = [*layers], [next(iter(layers))]
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
