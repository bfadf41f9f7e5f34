"""The node ``terrain_source``: publishes moving terrain like a simulator."""

from __future__ import annotations

from typing import Any

from rclpy.time import Time
from smartmesh_msgs.msg import Heightmap, HeightmapUpdate
from std_msgs.msg import Header

from smartmesh_ros.node.outputs.cdr import floats
from smartmesh_ros.node.parameters.declaring import ParameterNode, fixed
from smartmesh_ros.node.parameters.helping import answer
from smartmesh_ros.node.running import spin
from smartmesh_ros.node.transport import LATCHED
from smartmesh_ros.scenes import SCENES
from smartmesh_ros.scenes.moving import InwardWaves, Scene, Wave, jacksboro_fault
from smartmesh_ros.terrain.grid import GridGeometry
from smartmesh_ros.tools.evaluation.grounds import make_ground
from smartmesh_ros.tools.messages import heightmap_message

NAME = "terrain_source"
# Maximum time between whole maps in region mode [s]; a late subscriber waits no longer for one.
FULL_PERIOD = 5.0

_WAVE = Wave()
SPECS = (
    fixed("scene", "waves", "Motion of the terrain.", choices=SCENES),
    fixed("mode", "full", "Publish whole maps, or only regions that change.", choices=("full", "regions")),
    fixed("rate", 30.0, "Maps or regions per second [Hz].", 0.1, 1000.0),
    fixed("rows", 201, "Rows of the map; ignored for scene elevation.", 3, 16384),
    fixed("columns", 201, "Columns of the map; ignored for scene elevation.", 3, 16384),
    fixed("resolution", 0.25, "Distance between samples [m].", 0.001, 1000.0),
    fixed("relief", 10.0, "Height of the elevation model from its lowest to its highest sample [m].", 0.0, 1.0e4),
    fixed("wave.amplitude", _WAVE.amplitude, "Amplitude of the waves [m].", 0.0, 100.0),
    fixed("wave.number", _WAVE.number, "Wave number [rad/m].", 0.0, 100.0),
    fixed("wave.frequency", _WAVE.frequency, "Angular frequency [rad/s].", -1000.0, 1000.0),
)


class TerrainSource(ParameterNode):
    """Publishes a scene, centred on the frame's origin, on ``terrain_collider/heightmap`` and ``..._update``."""

    def __init__(self, **node_options: Any) -> None:
        super().__init__(NAME, SPECS, **node_options)
        values = self.values
        self._scene = make_scene(values)
        self._maps = self.create_publisher(Heightmap, "terrain_collider/heightmap", LATCHED)
        self._regions = self.create_publisher(HeightmapUpdate, "terrain_collider/heightmap_update", 100)
        self._start: Time | None = None  # of the first map; until then simulated time may not have come
        self._listeners = 0
        self._time = self._full_due = 0.0
        self.create_timer(1.0 / values["rate"], self._tick)

    def _tick(self) -> None:
        now = self.get_clock().now()
        self._start = self._start or now
        time = (now - self._start).nanoseconds * 1e-9
        listeners = self._maps.get_subscription_count()
        went_back = time < self._time
        if self.values["mode"] == "full" or listeners > self._listeners or went_back or time >= self._full_due:
            self._full_due = time + FULL_PERIOD
            self._maps.publish(map_of(self._scene.geometry, self._scene.heights(time), now.to_msg()))
        else:
            row, column, part = self._scene.changed(time)
            header = Header(stamp=now.to_msg(), frame_id="map")
            message = HeightmapUpdate(header=header, x=column, y=row, heights=floats(part))
            message.height, message.width = part.shape
            self._regions.publish(message)
        self._listeners, self._time = listeners, time


def map_of(geometry: GridGeometry, heights: Any, stamp: Any) -> Heightmap:
    """Return heights (rows, columns) [m] as a message in the frame "map"; the grid is not turned."""
    return heightmap_message(heights, resolution=geometry.resolution, origin=geometry.origin, stamp=stamp)


def make_scene(values: dict[str, Any]) -> Scene:
    """Return the scene that the parameters describe, centred on the frame's origin."""
    relief: Any = 0.0
    rows, columns = values["rows"], values["columns"]
    if values["scene"] == "elevation":
        relief = jacksboro_fault(values["relief"])
        rows, columns = relief.shape
    resolution = values["resolution"]
    corner = (-0.5 * (columns - 1) * resolution, -0.5 * (rows - 1) * resolution, 0.0)
    geometry = GridGeometry(rows=rows, columns=columns, resolution=resolution, origin=corner)
    if values["scene"] not in ("waves", "elevation"):
        return make_ground(geometry, values["scene"])
    wave = Wave(values["wave.amplitude"], values["wave.number"], values["wave.frequency"])
    return InwardWaves(geometry, wave, relief)


def main(args: list[str] | None = None) -> None:
    """Run the node until SIGINT or SIGTERM."""
    answer(NAME, __doc__, SPECS, args)
    spin(TerrainSource, args)
