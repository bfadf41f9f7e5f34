"""Whatever a message holds, an adapter gives a surface of its size or refuses it: nothing else comes out."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from grid_map_msgs.msg import GridMap
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from map_msgs.msg import OccupancyGridUpdate
from nav_msgs.msg import OccupancyGrid
from sensor_msgs.msg import Image, PointCloud2, PointField
from std_msgs.msg import Float32MultiArray, MultiArrayDimension

from smartmesh_ros.errors import InputError
from smartmesh_ros.io.rasters import RasterConfig
from smartmesh_ros.node.inputs.adapters import ADAPTERS, occupancy_region

ROWS, COLUMNS, MOST = 5, 4, 1000
UINT32 = [0, 1, 3, 4, 5, 7, 16, 20, 64, 2**16, 2**31, 2**32 - 1]
INT32 = [0, 1, 3, -1, 2**31 - 1, -(2**31)]
DOUBLES = [0.0, -1.0, 0.5, 1.0, 5.0, 1e-320, 1e9, 1e308, math.nan, math.inf, -math.inf]


def grid_map() -> GridMap:
    message = GridMap(layers=["elevation"], outer_start_index=2, inner_start_index=1)
    message.info.resolution, message.info.length_x, message.info.length_y = 1.0, float(COLUMNS), float(ROWS)
    data = Float32MultiArray(data=list(range(ROWS * COLUMNS)))
    data.layout.dim = [
        MultiArrayDimension(label="column_index", size=ROWS), MultiArrayDimension(label="row_index", size=COLUMNS)
    ]  # fmt: skip
    message.data = [data]
    return message


def image() -> Image:
    return Image(height=ROWS, width=COLUMNS, encoding="32FC1", step=4 * COLUMNS, data=bytes(4 * ROWS * COLUMNS))


def occupancy() -> OccupancyGrid:
    message = OccupancyGrid(data=[50] * (ROWS * COLUMNS))
    message.info.resolution, message.info.height, message.info.width = 1.0, ROWS, COLUMNS
    return message


def cloud() -> PointCloud2:
    rows, columns = np.mgrid[:ROWS, :COLUMNS]
    points = np.stack([columns, rows, columns], axis=-1).astype("<f4")
    fields = [PointField(name=name, offset=4 * k, datatype=7, count=1) for k, name in enumerate("xyz")]
    return PointCloud2(
        height=ROWS, width=COLUMNS, fields=fields, point_step=12, row_step=12 * COLUMNS, data=points.tobytes()
    )


# What may be set to what, by dotted path.
FIELDS: dict[str, tuple[Callable[[], Any], dict[str, list[Any]]]] = {
    "grid_map": (
        grid_map,
        {
            "info.resolution": DOUBLES,
            "info.length_x": DOUBLES,
            "info.length_y": DOUBLES,
            "info.pose.position.x": DOUBLES,
            "info.pose.orientation.w": DOUBLES,
            "layers": [[], ["elevation", "other"], ["other"], ["other", "elevation"]],
            "data": [[], [Float32MultiArray()] * 2],
            "data.0.data": [[], [math.nan] * 20, [math.inf] * 20, [1.0] * 21],
            "data.0.layout.dim": [[], [MultiArrayDimension()], [MultiArrayDimension(label="row_index")] * 2],
            "data.0.layout.data_offset": UINT32,
            "outer_start_index": [0, 3, 4, 5, 65535],
            "inner_start_index": [0, 3, 4, 5, 65535],
        },
    ),
    "image": (
        image,
        {
            "height": UINT32,
            "width": UINT32,
            "step": UINT32,
            "encoding": ["16UC1", "mono16", "mono8", "8UC1", "rgb8", "", "64FC1"],
            "is_bigendian": [1, 255],
            "data": [b"", bytes(79), bytes(81), b"\xff" * 80],
        },
    ),
    "occupancy_grid": (
        occupancy,
        {
            "info.resolution": [0.0, -1.0, 0.05, math.nan, math.inf],
            "info.height": UINT32,
            "info.width": UINT32,
            "info.origin.position.x": DOUBLES,
            "info.origin.orientation.w": DOUBLES,
            "info.origin.orientation.z": DOUBLES,
            "data": [[], [-1] * 20, [-128] * 20, [127] * 20, [100] * 21],
        },
    ),
    "point_cloud": (
        cloud,
        {
            "height": UINT32,
            "width": UINT32,
            "point_step": UINT32,
            "row_step": UINT32,
            "is_bigendian": [True],
            "fields": [[], [PointField(name=name, datatype=8) for name in "xyz"]],
            "fields.0.offset": UINT32,
            "fields.1.datatype": [0, 1, 8, 9, 255],
            "fields.2.count": UINT32,
            "fields.2.name": ["w", "x", ""],
            "data": [b"", bytes(240), b"\xff" * 240, b"\x7f" * 240, bytes(239)],
        },
    ),
}


def set_to(message: Any, path: str, value: Any) -> None:
    *parents, name = path.split(".")
    for parent in parents:
        message = message[int(parent)] if parent.isdigit() else getattr(message, parent)
    setattr(message, name, value)


@pytest.mark.parametrize("name", ADAPTERS)
def test_the_message_as_it_is_gives_a_surface(name: str) -> None:
    raster = ADAPTERS[name].convert(FIELDS[name][0](), RasterConfig(), MOST)
    assert raster.heights.shape == (ROWS, COLUMNS)
    assert np.isfinite(raster.heights).all()


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("name", ADAPTERS)
@settings(max_examples=200, suppress_health_check=[HealthCheck.too_slow], deadline=None)
@given(data=st.data())
def test_any_message_gives_a_surface_of_its_size_or_is_refused(name: str, data: st.DataObject) -> None:
    make, fields = FIELDS[name]
    message = make()
    for path in data.draw(st.lists(st.sampled_from(sorted(fields)), min_size=1, max_size=4, unique=True)):
        value = data.draw(st.sampled_from(fields[path]))
        try:
            set_to(message, path, value)
        except IndexError:
            continue  # an earlier change has taken that part away
    config = RasterConfig(scale=data.draw(st.sampled_from([1.0, -2.0, 0.0, 1e30])), offset=0.5)
    try:
        raster = ADAPTERS[name].convert(message, config, MOST)
    except InputError as error:
        assert error.reason
        assert str(error)
        return
    assert raster.heights.shape == (raster.geometry.rows, raster.geometry.columns)
    assert raster.heights.dtype == np.float32
    assert raster.heights.size <= MOST
    assert not np.isinf(raster.heights).any()


@pytest.mark.filterwarnings("error")
@settings(max_examples=200, deadline=None)
@given(
    x=st.sampled_from(INT32),
    y=st.sampled_from(INT32),
    height=st.sampled_from(UINT32),
    width=st.sampled_from(UINT32),
    count=st.integers(0, 20),
)
def test_any_occupancy_update_gives_a_region_of_its_size_or_is_refused(
    x: int, y: int, height: int, width: int, count: int
) -> None:
    message = OccupancyGridUpdate(x=x, y=y, height=height, width=width, data=[7] * count)
    try:
        row, column, heights = occupancy_region(message, RasterConfig(), MOST)
    except InputError:
        return
    assert heights.shape == (height, width)
    assert (row, column) == (y, x)
