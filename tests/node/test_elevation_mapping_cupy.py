"""Maps of the form that the ROS 2 release of elevation_mapping_cupy sends are taken as they are.

That form: a square of cells around the robot, in layers of float32 whose columns are contiguous; the buffer always
starts at zero; unseen heights are NaN, while unseen cells have a variance of 1000; the middle of the map is given as
the position of the robot, although the cells lie at whole multiples of the resolution.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from grid_map_msgs.msg import GridMap
from nav_msgs.msg import Odometry
from rclpy.qos import QoSProfile
from smartmesh_msgs.srv import QueryGround

from smartmesh_ros.io.rasters import RasterConfig
from smartmesh_ros.node.inputs.adapters import grid_map_raster as raster_from
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.tools.testing import Probe, Process, pose_message
from tests.grid_maps import grid_map_message
from tests.node.test_tutorial import ROOT

LENGTH, RESOLUTION = 15.0, 0.1  # of its example [m]
CELLS = round(LENGTH / RESOLUTION)
UNSEEN = 1000.0  # its variance of cells without a measurement [m^2]
# By which the ground may be off where the middle is off by half a cell along x and y, on slopes of `ground` [m].
HALF_CELL = 0.5 * RESOLUTION * (0.14 + 0.1)
# Layers and basic layers of its publishers elevation_map_raw and elevation_map_filter.
RAW = (["elevation", "traversability", "variance", "rgb"], ["elevation"])
FILTERED = (["min_filter", "smooth", "inpaint", "elevation"], ["min_filter"])
QOS = QoSProfile(depth=10)


def ground(x: Any, y: Any) -> Any:
    return 0.5 + 0.2 * np.sin(0.7 * np.asarray(x)) + 0.1 * np.asarray(y)


def cells_around(x: float, y: float) -> tuple[FloatArray, FloatArray]:
    """Positions of the cells (rows along +y, columns along +x) of a map that follows a robot by whole cells."""
    rows, columns = (np.mgrid[:CELLS, :CELLS] - 0.5 * (CELLS - 1)) * RESOLUTION
    middle = np.round(np.array([x, y]) / RESOLUTION) * RESOLUTION
    return middle[0] + columns, middle[1] + rows


def layer(name: str, cells: tuple[FloatArray, FloatArray], seen: Any) -> FloatArray:
    heights = ground(*cells)
    seen = np.broadcast_to(seen, heights.shape)
    edge = np.ones_like(heights, bool)
    edge[3:-3, 3:-3] = False  # where its filter of traversability has no result
    color = np.full(heights.shape, 0x00FF7F10, np.uint32).view(np.float32)
    return {
        "elevation": np.where(seen, heights, np.nan),
        "traversability": np.where(seen & ~edge, 0.9, np.nan),
        "variance": np.where(seen, 1e-4, UNSEEN),
        "rgb": np.where(seen, color, np.nan),
        "min_filter": np.where(seen, heights, 0.0),
        "smooth": np.where(seen, heights, 0.0),
        "inpaint": heights,
    }[name]


def message(layers: tuple[list[str], list[str]], x: float, y: float, *, seen: bool | FloatArray = True) -> GridMap:
    values = {name: layer(name, cells_around(x, y), seen) for name in layers[0]}
    made = grid_map_message(values, RESOLUTION, (x, y, 0.0), frame_id="odom")
    made.basic_layers = layers[1]
    return made


@pytest.mark.parametrize("layers", [(RAW, "elevation"), (FILTERED, "inpaint")], ids=["raw", "filter"])
@pytest.mark.parametrize("place", [(0.0, 0.0), (3.2, -1.7), (0.033, -4.048)])
def test_heights_are_where_it_says(layers: Any, place: tuple[float, float]) -> None:
    """Within the half cell by which the middle that it sends is off."""
    form, name = layers
    geometry, heights, *_ = raster_from(message(form, *place), RasterConfig(layer=name), 10**6)
    rows, columns = np.mgrid[:CELLS, :CELLS]
    off = np.abs(heights - ground(*np.moveaxis(geometry.to_world(rows, columns), -1, 0))).max()
    on_grid = np.allclose(np.round(place, 1), place)
    assert off < (1e-5 if on_grid else HALF_CELL)


def test_the_node_takes_them_with_the_file_of_the_page(probe: Probe) -> None:
    arguments = ["--ros-args", "--params-file", str(ROOT / "config" / "elevation_mapping.yaml")]
    arguments += ["-r", "~/grid_map:=/elevation_mapping_node/elevation_map_raw", "-r", "~/tracked_odometry:=/odom"]
    with Process("terrain_collider", arguments=arguments) as process:
        maps = probe.publisher(GridMap, "/elevation_mapping_node/elevation_map_raw", QOS)
        odometry = probe.publisher(Odometry, "/odom")

        def publish(x: float, seen: bool) -> None:
            sent, pose = message(RAW, x, 0.2, seen=seen), Odometry(child_frame_id="base_link")
            sent.header.stamp = pose.header.stamp = probe.now()
            pose.header.frame_id = "odom"
            pose.pose.pose = pose_message((x, 0.2, float(ground(x, 0.2)) + 0.35))
            odometry.publish(pose)
            maps.publish(sent)

        def stands_at(x: float) -> bool:
            publish(x, seen=True)
            answer = probe.call("query_ground", QueryGround, x=[x], y=[0.2])
            patches = probe.latest("collider_patches").patches
            under = [p.z - ground(p.x, p.y) for patch in patches for p in patch.mesh.vertices]
            near = bool(answer.success) and abs(answer.z[0] - ground(x, 0.2)) < HALF_CELL
            return near and bool(under) and float(np.abs(under).max()) < HALF_CELL

        publish(0.0, seen=False)
        for x in (0.0, 0.033, 0.31, 1.248):
            probe.wait_for(lambda: stands_at(x), watch=process)  # noqa: B023
        assert probe.diagnostics("terrain")["message"] == "maps arrive"
        refused = [key for key in probe.diagnostics("inputs") if key.startswith("refused")]
        assert [key for key in refused if "query_ground" not in key] == [], "questions before the first map are refused"
