"""Terrain as other stacks publish it, over real topics: patches lie on the surface that was meant."""

import math
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from grid_map_msgs.msg import GridMap
from map_msgs.msg import OccupancyGridUpdate
from nav_msgs.msg import OccupancyGrid
from numpy.typing import NDArray
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import Image, PointCloud2, PointField

from smartmesh_ros.tools.testing import Probe, pose_message
from tests.grid_maps import grid_map_message
from tests.node.shared import require_refused, stamped

RESOLUTION = 0.25
ROWS, COLUMNS = 24, 32  # along y and along x
# Patches show the last map as it is, at once.
HOLD = {"terrain.motion": "hold", "terrain.settle": 0.001}


def surface(x: Any, y: Any) -> Any:
    """Alike nowhere, so that a swapped or turned axis shows."""
    return 0.3 * np.asarray(x) - 0.2 * np.asarray(y) + 0.05 * np.asarray(x) * np.asarray(y)


def places(first: tuple[float, float] = (1.0, -2.0)) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Samples (rows along +y, columns along +x) of a map whose first sample lies there [m]."""
    rows, columns = np.mgrid[:ROWS, :COLUMNS]
    return first[0] + RESOLUTION * columns, first[1] + RESOLUTION * rows


def grid_map(
    heights: NDArray[np.float64],
    first: tuple[float, float],
    *,
    start: tuple[int, int] = (0, 0),
    row_major: bool = False,
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
    message.info.origin = pose_message((*corner, 0.0))
    return message


def point_cloud(x: Any, y: Any, z: Any) -> PointCloud2:
    kind = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("rgb", "<u4")])
    points = np.zeros(x.shape, kind)
    points["x"], points["y"], points["z"] = x, y, z
    fields = [PointField(name=name, offset=4 * k, datatype=7, count=1) for k, name in enumerate("xyz")]
    return PointCloud2(
        height=x.shape[0],
        width=x.shape[1],
        fields=fields,
        point_step=16,
        row_step=16 * x.shape[1],
        data=points.tobytes(),
    )


def patch_of(
    probe: Probe,
    position: tuple[float, float, float],
    reached: Callable[[Any], bool],
    publish: Callable[[], None] = lambda: None,
) -> NDArray[np.float64]:
    """Vertices of the patch under a body there, once they are what is waited for; ``publish`` is called till then."""

    def found() -> Any:
        publish()
        probe.publish_poses([position])
        return [points for points in probe.patches().values() if len(points) and reached(points)]

    [points] = probe.wait_for(found)
    return np.asarray(points)


def on_surface(points: NDArray[np.float64], tolerance: float = 1e-5) -> bool:
    return bool(np.abs(points[:, 2] - surface(points[:, 0], points[:, 1])).max() <= tolerance)


BODY = (3.1, 0.4, float(surface(3.1, 0.4)) + 0.2)


def set_to(path: str, value: Any) -> Callable[[Any], None]:
    """A change of a message: a dotted path's field."""
    *parents, name = path.split(".")

    def change(message: Any) -> None:
        for parent in parents:
            message = message[int(parent)] if parent.isdigit() else getattr(message, parent)
        setattr(message, name, value)

    return change


def all_refused(
    probe: Probe, publisher: Any, make: Callable[[], Any], cases: list[tuple[str, Callable[[Any], Any]]]
) -> None:
    """Publishes each changed message, which must be refused for its reason."""

    def changed(change: Callable[[Any], Any]) -> Any:
        message = stamped(probe, make())
        change(message)
        return message

    require_refused(probe, [(publisher, reason, partial(changed, change)) for reason, change in cases])


def test_grid_maps_of_both_orders_scroll_with_their_robot(probe: Probe) -> None:
    with probe.running(parameters={**HOLD, "terrain.input": "grid_map"}):
        publisher = probe.publisher(GridMap, "grid_map")
        x, y = places()
        for start, row_major in (((0, 0), False), ((5, 3), False), ((31, 23), True)):
            publisher.publish(stamped(probe, grid_map(surface(x, y) + 3.0, (1.0, -2.0), start=start)))
            patch_of(probe, BODY, lambda points: points[:, 2].min() > 2.0)
            publisher.publish(stamped(probe, grid_map(surface(x, y), (1.0, -2.0), start=start, row_major=row_major)))
            patch_of(probe, BODY, on_surface)
        # The robot has driven on: the same ground, another window on it, then a window with a hole under the body.
        x, y = places((1.5, -2.75))
        publisher.publish(stamped(probe, grid_map(surface(x, y), (1.5, -2.75), start=(2, 21))))
        patch_of(probe, BODY, on_surface)
        all_refused(
            probe,
            publisher,
            lambda: grid_map(surface(x, y) + 9.0, (1.5, -2.75)),
            [
                ("layer", set_to("layers", ["variance", "height"])),
                ("geometry", set_to("info.resolution", 0.3)),
                ("geometry", set_to("info.resolution", 0.0)),
                ("geometry", set_to("info.length_x", math.inf)),
                ("geometry", set_to("info.pose.position.x", math.nan)),
                ("size", set_to("info.length_x", 1e7)),
                ("region", set_to("outer_start_index", 400)),
                ("length", lambda message: message.data.pop()),
                ("length", lambda message: message.data[1].data.pop()),
                ("length", lambda message: set_to("label", "x")(message.data[1].layout.dim[0])),
                ("length", lambda message: set_to("size", 2**32 - 1)(message.data[1].layout.dim[1])),
                ("frame", set_to("header.frame_id", "base_link")),
            ],
        )
        patch_of(probe, BODY, on_surface)


def test_images_are_placed_by_parameters(probe: Probe) -> None:
    parameters = {
        **HOLD,
        "terrain.input": "image",
        "terrain.reliability": "best_effort",
        "raster.scale": 0.001,
        "raster.offset": -5.0,
        "raster.resolution": RESOLUTION,
        "raster.origin": [1.0, -2.0, 0.0],
        "frame_id": "map",
    }
    with probe.running(parameters=parameters):
        publisher = probe.publisher(Image, "image", qos_profile_sensor_data)
        heights = surface(*places())

        def good() -> None:  # best effort: one may be lost
            publisher.publish(stamped(probe, image(heights)))

        patch_of(probe, BODY, lambda points: on_surface(points, 0.001), good)
        all_refused(
            probe,
            publisher,
            lambda: image(heights + 9.0),
            [
                ("encoding", set_to("encoding", "rgb8")),
                ("length", set_to("step", 10)),
                ("length", set_to("width", COLUMNS + 9)),
                ("size", set_to("height", 2**31)),
            ],
        )
        patch_of(probe, BODY, lambda points: on_surface(points, 0.001))


def test_occupancy_grids_and_their_updates_become_walls(probe: Probe) -> None:
    percent = np.zeros((ROWS, COLUMNS), np.int8)
    with probe.running(parameters={**HOLD, "terrain.input": "occupancy_grid", "raster.scale": 2.0}):
        publisher = probe.publisher(OccupancyGrid, "occupancy_grid")
        updates = probe.publisher(OccupancyGridUpdate, "occupancy_grid_update")
        corner = (1.0 - 0.5 * RESOLUTION, -2.0 - 0.5 * RESOLUTION)  # so that samples lie where they do elsewhere
        publisher.publish(stamped(probe, occupancy_grid(percent, corner)))
        x, y = places()
        body = (float(x[10, 8]), float(y[10, 8]), 0.3)
        flat = patch_of(probe, body, lambda points: np.abs(points[:, 2]).max() == 0.0)
        assert np.abs((flat[:, :2] - (1.0, -2.0)) / RESOLUTION % 1.0 - 0.5).min() == pytest.approx(0.5)
        update = OccupancyGridUpdate(x=9, y=11, width=2, height=1, data=[100, 50])
        updates.publish(stamped(probe, update))
        points = patch_of(probe, body, lambda points: points[:, 2].max() > 0.0)
        heights = {(round(px, 4), round(py, 4)): pz for px, py, pz in points.tolist()}
        assert heights[(round(float(x[11, 9]), 4), round(float(y[11, 9]), 4))] == pytest.approx(2.0)
        assert heights[(round(float(x[11, 8]), 4), round(float(y[11, 8]), 4))] == pytest.approx(0.0)
        all_refused(
            probe,
            updates,
            lambda: OccupancyGridUpdate(x=9, y=11, width=2, height=1, data=[100, 100]),
            [
                ("region", set_to("x", -1)),
                ("region", set_to("x", COLUMNS - 1)),
                ("length", set_to("width", 3)),
                ("size", set_to("height", 2**31)),
                ("occupancy", set_to("data", [101, 0])),
            ],
        )


def test_organised_clouds_may_run_either_way(probe: Probe) -> None:
    with probe.running(parameters={**HOLD, "terrain.input": "point_cloud", "terrain.reliability": "best_effort"}):
        publisher = probe.publisher(PointCloud2, "point_cloud", qos_profile_sensor_data)
        x, y = places()
        z = surface(x, y)

        def publish(*cloud: Any) -> Callable[[], None]:  # best effort: one may be lost
            return lambda: publisher.publish(stamped(probe, point_cloud(*cloud)))

        patch_of(probe, BODY, lambda points: on_surface(points, 1e-4), publish(x, y, z))
        flipped = publish(x[::-1], y[::-1], z[::-1] + 3.0)
        patch_of(probe, BODY, lambda points: points[:, 2].min() > 2.0, flipped)
        patch_of(probe, BODY, lambda points: on_surface(points, 1e-4), publish(x.T, y.T, z.T))
        all_refused(
            probe,
            publisher,
            lambda: point_cloud(x, y, z + 9.0),
            [
                ("not_a_grid", set_to("height", 1)),
                ("length", set_to("row_step", 8)),
                ("size", set_to("height", 2**31)),
                ("fields", lambda cloud: cloud.fields.pop()),
                ("fields", set_to("fields.2.offset", 14)),
                ("fields", set_to("fields.2.datatype", 3)),
                ("fields", set_to("point_step", 8)),
            ],
        )
        patch_of(probe, BODY, lambda points: on_surface(points, 1e-4))


def test_a_file_is_there_from_the_start_and_can_be_updated(probe: Probe, tmp_path: Path) -> None:
    x, y = places()
    np.save(tmp_path / "terrain.npy", surface(x, y))
    parameters = {
        **HOLD,
        "terrain.file": str(tmp_path / "terrain.npy"),
        "raster.resolution": RESOLUTION,
        "raster.origin": [1.0, -2.0, 0.0],
        "raster.first_row": "bottom",
    }
    with probe.running(parameters=parameters):
        patch_of(probe, BODY, on_surface)
        probe.publish_map(surface(x, y) + 3.0, resolution=RESOLUTION, origin=(1.0, -2.0, 0.0))
        patch_of(probe, BODY, lambda points: points[:, 2].min() > 2.0)
