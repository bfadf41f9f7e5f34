"""Terrain as other stacks publish it, given to a node: its ground is the surface that was meant."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from grid_map_msgs.msg import GridMap
from map_msgs.msg import OccupancyGridUpdate
from nav_msgs.msg import OccupancyGrid
from numpy.typing import NDArray
from sensor_msgs.msg import Image, PointCloud2, PointField

from smartmesh_ros.errors import InputError
from smartmesh_ros.io.rasters import RasterConfig
from smartmesh_ros.node.inputs.adapters import grid_map_raster
from smartmesh_ros.tools.testing import pose_message
from tests.grid_maps import grid_map_message
from tests.node.shared import Fed, Logged, fed, stamped
from tests.node.test_refusals import changed

RESOLUTION = 0.25
ROWS, COLUMNS = 25, 32  # along y and along x
# The ground is as in the last map, at once.
HOLD = {"terrain.motion": "hold", "terrain.settle": 0.001}
CORNER = (1.0 - 0.5 * RESOLUTION, -2.0 - 0.5 * RESOLUTION)  # of a grid whose samples lie where they do elsewhere
PLACED = {"raster.resolution": RESOLUTION, "raster.origin": [1.0, -2.0, 0.0]}


def surface(x: Any, y: Any) -> Any:
    """Alike nowhere, so that a swapped or turned axis shows."""
    return 0.3 * np.asarray(x) - 0.2 * np.asarray(y) + 0.05 * np.asarray(x) * np.asarray(y)


def places(first: tuple[float, float] = (1.0, -2.0)) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Samples (rows along +y, columns along +x) of a map whose first sample lies there [m]."""
    rows, columns = np.mgrid[:ROWS, :COLUMNS]
    return first[0] + RESOLUTION * columns, first[1] + RESOLUTION * rows


def grid_map(
    heights: NDArray[np.float64], first: tuple[float, float], start: tuple[int, int] = (0, 0), row_major: bool = False
) -> GridMap:
    """A grid map whose first sample lies at ``first`` [m], from heights (rows along +y, columns along +x)."""
    middle = (first[0] + 0.5 * (COLUMNS - 1) * RESOLUTION, first[1] + 0.5 * (ROWS - 1) * RESOLUTION, 7.0)
    layers = {"variance": np.full_like(heights, 99.0), "elevation": heights}
    return grid_map_message(layers, RESOLUTION, middle, start=start, row_major=row_major)


def image(heights: NDArray[np.float64]) -> Image:
    pixels = np.rint(heights[::-1] * 1000.0 + 5000.0).astype("<u2")  # the first row is the top one
    padded = np.full((ROWS, COLUMNS + 3), 65535, "<u2")  # rows longer than their pixels
    padded[:, :COLUMNS] = pixels
    return Image(height=ROWS, width=COLUMNS, encoding="16UC1", step=padded.shape[1] * 2, data=padded.tobytes())


def occupancy_grid(percent: NDArray[np.int8], corner: tuple[float, float]) -> OccupancyGrid:
    message = OccupancyGrid(data=percent.ravel().tolist())
    message.info.resolution, message.info.height, message.info.width = RESOLUTION, *percent.shape
    message.info.origin = pose_message((*corner, 0.5))
    return message


def point_cloud(x: Any, y: Any, z: Any) -> PointCloud2:
    kind = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("rgb", "<u4")])
    points = np.zeros(x.shape, kind)
    points["x"], points["y"], points["z"] = x, y, z
    fields = [PointField(name=name, offset=4 * k, datatype=7, count=1) for k, name in enumerate("xyz")]
    size: dict[str, Any] = {"height": x.shape[0], "width": x.shape[1], "point_step": 16, "row_step": 16 * x.shape[1]}
    return PointCloud2(fields=fields, data=points.tobytes(), **size)


def shows(node: Fed, first: tuple[float, float] = (1.0, -2.0), rise: float = 0.0, tolerance: float = 1e-5) -> bool:
    """Whether the ground inside the window of `places` is the surface, raised [m]."""
    x, y = (axis[1:-1, 1:-1] for axis in places(first))
    return bool(np.abs(node.heights(x, y) - surface(x, y) - rise).max() <= tolerance)


def require_refused(node: Fed, topic: str, make: Callable[[], Any], *cases: tuple[str, dict[str, Any]]) -> None:
    """Gives messages with changed fields, each of which must be refused for its reason."""
    node.require_refused(topic, [(reason, changed(stamped(node, make()), **fields)) for reason, fields in cases])


def test_grid_maps_of_both_orders_scroll_with_their_robot(logged: Logged) -> None:
    with fed({**HOLD, "terrain.input": "grid_map"}) as node:
        x, y = places()

        def give(rise: float = 0.0, *, stretched: float = 0.0, **options: Any) -> None:
            sent = stamped(node, grid_map(surface(x, y) + rise, (1.0, -2.0), **options))
            sent.info.length_x += stretched
            sent.info.length_y += stretched
            node.give("grid_map", sent)
            assert shows(node, rise=rise)

        for start, row_major in (((0, 0), False), ((5, 3), False), ((31, 24), True)):
            give(3.0, start=start)
            give(start=start, row_major=row_major)
        for excess in (-0.45, 0.499):  # lengths are rounded to cells: 8.0 m of 0.06 m of elevation_mapping_cupy are 133
            give(stretched=excess * RESOLUTION)
        # The robot has driven on: the same ground, another window on it.
        there = (1.5, -2.75)
        x, y = places(there)
        node.give("grid_map", stamped(node, grid_map(surface(x, y), there, start=(2, 21))))
        assert shows(node, there)
        require_refused(
            node, "grid_map", lambda: grid_map(surface(x, y) + 9.0, there),
            ("layer", {"layers": ["variance", "height"]}),
            ("geometry", {"info__resolution": 0.0}),
            ("geometry", {"info__length_x": math.inf}),
            ("size", {"info__length_x": 1e7}),
            ("region", {"outer_start_index": COLUMNS}),
            ("region", {"inner_start_index": ROWS}),
            ("length", {"data": []}),
            ("length", {"data__1__data": [0.0]}),
            ("length", {"data__1__layout__dim__0__label": "x"}),
            ("frame", {"header__frame_id": "base_link"}),
        )  # fmt: skip
        assert shows(node, there)
        assert node.node._outputs._diagnostics._terrain()[2]["updates of ''"] == 9
    assert "there is no layer 'elevation'; raster.layer may be one of variance, height" in logged()
    with pytest.raises(InputError, match="there is no layer 'elevation'; the map has no layers"):
        grid_map_raster(GridMap(), RasterConfig())


def test_images_are_placed_by_parameters() -> None:
    raised = {"raster.scale": 0.001, "raster.origin": [1.0, -2.0, -5.0]}  # pixels are millimetres above -5 m
    with fed({**HOLD, **PLACED, **raised, "terrain.input": "image", "frame_id": "map"}) as node:
        heights = surface(*places())
        node.give("image", stamped(node, image(heights)))
        assert shows(node, tolerance=0.001)
        require_refused(
            node, "image", lambda: image(heights + 9.0),
            ("encoding", {"encoding": "rgb8"}),
            ("length", {"step": 10}),
            ("length", {"width": COLUMNS + 9}),
            ("size", {"height": 2**31}),
        )  # fmt: skip
        assert shows(node, tolerance=0.001)


def test_occupancy_grids_and_their_updates_become_walls_and_holes_where_they_are_unknown() -> None:
    percent = np.zeros((ROWS, COLUMNS), np.int8)
    percent[0, 0] = -1
    with fed({**HOLD, "terrain.input": "occupancy_grid", "raster.scale": 2.0}) as node:
        node.give("occupancy_grid", stamped(node, occupancy_grid(percent, CORNER)))
        expected = np.where(percent < 0, np.nan, 0.5)
        np.testing.assert_array_equal(node.heights(*places()), expected)

        def update(data: tuple[int, ...] = (100, 50)) -> OccupancyGridUpdate:
            return OccupancyGridUpdate(x=9, y=11, width=2, height=1, data=data)

        node.give("occupancy_grid_update", stamped(node, update()))
        expected[11, 9:11] = 2.5, 1.5
        np.testing.assert_allclose(node.heights(*places()), expected, atol=1e-6)
        require_refused(
            node, "occupancy_grid_update", lambda: update((100, 100)),
            ("region", {"x": -1}),
            ("region", {"x": COLUMNS - 1}),
            ("length", {"width": 3}),
            ("size", {"height": 2**31}),
            ("occupancy", {"data": [101, 0]}),
        )  # fmt: skip


def test_organised_clouds_may_run_either_way(logged: Logged) -> None:
    with fed({**HOLD, "terrain.input": "point_cloud"}) as node:
        x, y = places()
        z = surface(x, y)
        for rise, cloud in (
            (0.0, (x, y, z)), (3.0, (x[::-1], y[::-1], z[::-1] + 3.0)), (0.0, (x.T, y.T, z.T)),
        ):  # fmt: skip
            node.give("point_cloud", stamped(node, point_cloud(*cloud)))
            assert shows(node, rise=rise, tolerance=1e-4)
        require_refused(
            node, "point_cloud", lambda: point_cloud(x, y, z + 9.0),
            ("not_a_grid", {"height": 1}),
            ("length", {"row_step": 8}),
            ("size", {"height": 2**31}),
            ("fields", {"fields": []}),
            ("fields", {"fields__2__offset": 14}),
            ("fields", {"fields__2__datatype": 3}),
        )  # fmt: skip
        assert shows(node, tolerance=1e-4)
    assert "must have the rows and columns of a grid; a mapper makes a grid map of the points of a lidar" in logged()
