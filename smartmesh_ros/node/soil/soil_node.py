"""The node ``soil``: ground that gives way under the bodies of a terrain_collider.

It takes the collider's ``heightmap``, ``contacts``, ``body_states``, ``body_descriptions`` and ``joint_states``, lets
the soil give way under the contact forces, and sends the changed ground to the collider's ``heightmap_update``. Nothing
is sent while nothing moves. The deformed terrain is published on ``~/grid_map`` (elevation, sinkage, pressure) if
grid_map_msgs is installed. ``~/soils`` (nav_msgs/OccupancyGrid, latched) says which soil lies where: values are places
in the parameter ``soils``, -1 is the parameter ``soil``. The collider must extrapolate its terrain
(``terrain.motion``, the default).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from nav_msgs.msg import OccupancyGrid
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState
from smartmesh_msgs.msg import BodyDescriptionArray, ContactArray, Heightmap, HeightmapUpdate, TrackedBodyArray
from std_msgs.msg import Header

from smartmesh_ros.errors import InputError
from smartmesh_ros.node.inputs.cdr_reader import map_from, region_from
from smartmesh_ros.node.inputs.optional_messages import find_message
from smartmesh_ros.node.parameters.declaring import ParameterNode, fixed
from smartmesh_ros.node.parameters.helping import answer
from smartmesh_ros.node.refusals import Refusals
from smartmesh_ros.node.running import spin
from smartmesh_ros.node.soil.soil_messages import (
    MessageBodies,
    SoilMap,
    contacts_from,
    grid_map_message,
    soil_map_from,
    update_message,
)
from smartmesh_ros.node.timing.stamps import stamp_seconds
from smartmesh_ros.soil.config import SoilConfig
from smartmesh_ros.soil.layer import Region
from smartmesh_ros.soil.soil import Soil, loads_of
from smartmesh_ros.soil.soils import KNOWN, soil_named, soils_of
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.world.contacts import GroundContact

NAME = "soil"
_D = SoilConfig()
SPECS = (
    fixed("soil", "dry_sand", f"Name of the soil: {', '.join(soils_of())}, or one of soils_file."),
    fixed("soils_file", "", "YAML file of soils under Chrono's names; empty = the soils that ship."),
    fixed("soils", [], "Names of more soils, for the cells of ~/soils; empty = there is one soil."),
    fixed("flow", _D.flow, "Share of the displaced volume that moves to the rim; the rest is compacted.", 0.0, 1.0),
    fixed("rim", _D.rim, "Width of that rim [samples].", 1, 20),
    fixed("repose", _D.repose, "Angle above which disturbed ground slides down [degrees].", 1.0, 89.0),
    fixed("slides", _D.slides, "Rounds of sliding in an update; 0 = none.", 0, 100),
    fixed("load_time", _D.load_time, "Time constant of the filter on contact forces [s].", 0.0, 10.0),
    fixed("lean_time", _D.lean_time, "Time constant of the filter on the place of contact forces [s].", 0.0, 100.0),
    fixed("rate", 60.0, "Largest rate of updates [Hz]. Contacts that come more often are averaged between updates.",
          1.0, 1000.0),
    fixed("still", _D.still, "Ground that moves more slowly stays where it is [m/s].", 0.0, 1.0),
    fixed("tile", "", "Tile of the terrain that gives way; empty = the single map."),
    fixed("grid_map_rate", 1.0, "Rate of ~/grid_map while the ground changes [Hz]; 0 = never.", 0.0, 60.0),
    fixed("durability", "volatile", "QoS durability of the map subscription, as terrain.durability of the collider.",
          choices=("volatile", "transient_local")),
    fixed("max_samples", 16_777_216, "Largest number of samples of a map.", 9, 2**31 - 1),
)  # fmt: skip
# Longest time between two messages of contacts that counts as one update [s]; after a longer one contact was lost.
LONGEST_UPDATE = 0.25
# Share of the time between two updates by which an update may come early, because stamps are those of steps.
EARLY = 0.1
# Number of own updates that may still come back.
ECHOES = 1000


class SoilNode(ParameterNode):
    """Presses the soil at each message of contacts."""

    def __init__(self, **node_options: Any) -> None:
        super().__init__(NAME, SPECS, **node_options)
        values = self.values
        self.refusals = Refusals(self.get_logger())
        file = Path(values["soils_file"]) if values["soils_file"] else KNOWN
        self._soils = [soil_named(name, file) for name in (values["soil"], *values["soils"])]
        self._soil_map: SoilMap | None = None
        same = ("flow", "rim", "repose", "slides", "load_time", "lean_time", "still")
        self._config = SoilConfig(grip=False, **{name: values[name] for name in same})
        self._tile, self._most, self._durability = values["tile"], values["max_samples"], values["durability"]
        self._bodies = MessageBodies()
        self.soil: Soil | None = None
        self._frame = ""
        self._start: float | None = None  # stamp that is time zero of the soil's map [s]
        self._time, self._interval = 0.0, 1.0 / values["rate"]  # of the last update, and least time between two [s]
        self._contacts: list[GroundContact] = []  # since the last update, of a number of messages
        self._steps = 0
        self._sent: dict[tuple[int, int, int, int, int], None] = {}  # own updates that may come back
        self._changed = False
        self._listen()
        updates = QoSProfile(depth=1000)
        self._updates = self.create_publisher(HeightmapUpdate, "terrain_collider/heightmap_update", updates)
        kind = find_message("grid_map_msgs", "GridMap")
        if kind is not None and values["grid_map_rate"] > 0.0:
            latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
            self._grid_map_kind, self._grid_maps = kind, self.create_publisher(kind, "~/grid_map", latched)
            self.create_timer(1.0 / values["grid_map_rate"], self._publish_grid_map)

    def destroy_node(self) -> None:
        """Destroy the node and its copies of robots."""
        self._bodies.close()
        super().destroy_node()

    def _listen(self) -> None:
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        maps = latched if self._durability == "transient_local" else QoSProfile(depth=1)
        self.create_subscription(OccupancyGrid, "~/soils", self._guarded("soils", self._take_soils), latched)
        inputs: list[tuple[Any, str, Any, Callable[[Any], None], bool]] = [
            (Heightmap, "heightmap", maps, self._take_map, True),
            (HeightmapUpdate, "heightmap_update", QoSProfile(depth=1000), self._take_region, True),
            (BodyDescriptionArray, "body_descriptions", latched, self._take_descriptions, False),
            (TrackedBodyArray, "body_states", QoSProfile(depth=10), self._take_states, False),
            (JointState, "joint_states", QoSProfile(depth=10), self._take_joints, False),
            (ContactArray, "contacts", QoSProfile(depth=10), self._take_contacts, False),
        ]
        for kind, topic, qos, take, raw in inputs:
            name = f"terrain_collider/{topic}"
            self.create_subscription(kind, name, self._guarded(name, take), qos, raw=raw)

    def _guarded(self, topic: str, take: Callable[[Any], None]) -> Callable[[Any], None]:
        """Return a callback that counts and logs what ``take`` refuses."""

        def guarded(message: Any) -> None:
            try:
                take(message)
            except InputError as error:
                self.refusals.add(topic, error)

        return guarded

    def _take_map(self, data: bytes) -> None:
        found = map_from(data, self._most)
        if found.start.tile != self._tile:
            return
        self._require_frame(found.start.frame_id, first=True)
        if found.geometry is None:
            self.soil = None
            return
        time = self._time_of(found.start)
        if self.soil is not None and self.soil.map.geometry == found.geometry:
            self.soil.map.replace(found.heights, time=time, velocities=found.velocities)
            return
        new = HeightMap(found.heights, geometry=found.geometry, time=time, velocities=found.velocities)
        kinds = None if self._soil_map is None else self._soil_map.kinds_on(found.geometry)
        self.soil = Soil(new, self._soils, self._bodies, self._config, kinds=kinds)

    def _take_soils(self, message: OccupancyGrid) -> None:
        """Take which soil lies where."""
        self._require_frame(message.header.frame_id)
        self._soil_map = soil_map_from(message, len(self._soils) - 1, self._most)
        if self.soil is not None:
            self.soil.set_kinds(self._soil_map.kinds_on(self.soil.map.geometry))

    def _take_region(self, data: bytes) -> None:
        """Take a change by others; own ones come back and are left out."""
        found = region_from(data, self._most)
        if found.start.tile != self._tile or self.soil is None:
            return
        start = found.start
        key = (start.sec, start.nanosec, found.row, found.column, found.heights.size)
        if key in self._sent:
            del self._sent[key]
            return
        self._require_frame(start.frame_id)
        time = self._time_of(start)
        self.soil.map.update_region(found.row, found.column, found.heights, time=time, velocities=found.velocities)

    def _take_descriptions(self, message: BodyDescriptionArray) -> None:
        for problem in self._bodies.take_descriptions(message):
            self.refusals.add("terrain_collider/body_descriptions", problem)

    def _take_states(self, message: TrackedBodyArray) -> None:
        self._require_frame(message.header.frame_id)
        self._bodies.take_states(message)

    def _take_joints(self, message: JointState) -> None:
        for values, what in ((message.position, "positions"), (message.velocity, "velocities")):
            if len(values) not in (0, len(message.name)):
                raise InputError(
                    "length", f"{len(values)} {what} for {len(message.name)} joints; there must be as many"
                )
        positions = dict(zip(message.name, message.position, strict=False))
        self._bodies.take_joints(positions, dict(zip(message.name, message.velocity, strict=False)))

    def _take_contacts(self, message: ContactArray) -> None:
        """Press the soil."""
        if self.soil is None:
            return
        self._require_frame(message.header.frame_id)
        time = self._time_of(message.header.stamp)
        self._contacts += contacts_from(message)
        self._steps += 1
        dt = time - self._time
        if 0.0 < dt < (1.0 - EARLY) * self._interval:
            return
        loads, self._time = loads_of(self._contacts, self._steps), time
        self._contacts, self._steps = [], 0
        if not 0.0 < dt <= LONGEST_UPDATE:
            return
        shapes = self._bodies.read([*loads]).shapes
        for name in [name for name, shape in zip([*loads], shapes, strict=True) if shape is None]:
            del loads[name]
            problem = f"there is no shape and state of {name!r}; it presses no soil"
            self.refusals.add("terrain_collider/contacts", InputError("unknown_body", problem))
        for region in self.soil.press(loads, dt, time):
            self._send(message.header, region, time)

    def _send(self, header: Header, region: Region, time: float) -> None:
        assert self.soil is not None
        self.soil.map.update_region(*region[:3], time=time, velocities=region.velocities)
        self._sent[header.stamp.sec, header.stamp.nanosec, region.row, region.column, region.heights.size] = None
        if len(self._sent) > ECHOES:
            del self._sent[next(iter(self._sent))]
        self._updates.publish(update_message(header, self._tile, region))
        self._changed = True

    def _publish_grid_map(self) -> None:
        if self.soil is None or not self._changed:
            return
        header = Header(stamp=self.get_clock().now().to_msg(), frame_id=self._frame)
        self._grid_maps.publish(grid_map_message(self._grid_map_kind, header, self.soil))
        self._changed = False

    def _require_frame(self, frame: str, *, first: bool = False) -> None:
        """Raise `InputError` for another frame than the map's; a map sets the frame if none is known."""
        if first and self.soil is None:
            self._frame = frame
        if frame and self._frame and frame != self._frame:
            raise InputError("frame", f"frame is {frame!r}; the map's is {self._frame!r}, and all must have that")

    def _time_of(self, stamp: Any) -> float:
        """Return the time of a stamp on the soil's clock [s]; a stamp of zero is now."""
        seconds = stamp_seconds(stamp)
        if seconds is None:
            seconds = self.get_clock().now().nanoseconds * 1e-9
        if self._start is None:
            self._start = seconds
        return seconds - self._start


def main(args: Sequence[str] | None = None) -> None:
    """Run the node until SIGINT or SIGTERM."""
    answer(NAME, __doc__, SPECS, None if args is None else list(args))
    spin(SoilNode, args)
