"""Conversion of a bag's records to events, with the node's checks and its mapping of stamps to simulated time."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from geometry_msgs.msg import PoseArray, PoseStamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import JointState
from smartmesh_msgs.msg import TrackedBodyArray

from smartmesh_ros.errors import InputError
from smartmesh_ros.ground.limits import require_possible
from smartmesh_ros.ground.state import BodyState
from smartmesh_ros.io.rasters import Raster
from smartmesh_ros.node.inputs import conversions
from smartmesh_ros.node.inputs.adapters import ADAPTERS
from smartmesh_ros.node.inputs.conversions import BodyInput
from smartmesh_ros.node.inputs.decoding import message_from
from smartmesh_ros.node.inputs.frames import FrameBuffer
from smartmesh_ros.node.inputs.optional_messages import require_message
from smartmesh_ros.node.inputs.transform_input import transforms_from
from smartmesh_ros.node.parameters.settings import Settings
from smartmesh_ros.node.timing.pacing import StampClock
from smartmesh_ros.tools.testing.bags import Record
from smartmesh_ros.tools.tune.bag import Bag
from smartmesh_ros.tools.tune.events import BodiesCame, Event, JointsCame, MapCame, RegionCame

HEIGHTMAP, HEIGHTMAP_UPDATE = "smartmesh_msgs/msg/Heightmap", "smartmesh_msgs/msg/HeightmapUpdate"
TRACKED, POSES = "smartmesh_msgs/msg/TrackedBodyArray", "geometry_msgs/msg/PoseArray"
POSE, ODOMETRY = "geometry_msgs/msg/PoseStamped", "nav_msgs/msg/Odometry"
JOINTS, TRANSFORMS = "sensor_msgs/msg/JointState", "tf2_msgs/msg/TFMessage"
# Outputs of the node that a recording of all topics contains too.
OUTPUTS = ("/body_states",)


@dataclass
class Recording:
    """Events of a bag in order of arrival; time zero is the first record that gives an event.

    ``frame``: the terrain's frame. ``refused``: counts of refused records, by the node's message.
    """

    events: list[Event] = field(default_factory=list)
    frame: str = ""
    refused: Counter[str] = field(default_factory=Counter)
    frames: Counter[str] = field(default_factory=Counter)  # of maps and bodies: counts by "what in frame"
    map_topics: set[str] = field(default_factory=set)  # topics that changed the terrain

    @property
    def maps(self) -> list[MapCame | RegionCame]:
        """Events that change the terrain."""
        return [event for event in self.events if isinstance(event, MapCame | RegionCame)]

    @property
    def length(self) -> float:
        """Time from the first record to the last [s]."""
        return max((event.arrives for event in self.events), default=0.0)


class Reader:
    """Converts records to events, with the same state between records as in the node."""

    def __init__(self, bag: Bag, settings: Settings, terrain_topic: str, memory: float) -> None:
        self._bag, self._memory = bag, memory
        self.recording = Recording(frame=settings.frame_id.strip("/"))
        self._settings = settings
        self._clocks: dict[str, StampClock] = {}
        self._frames = FrameBuffer()
        self._of_poses: set[str] = set()
        self._start: float | None = None
        self._takes = _takers(self, bag, settings, terrain_topic)

    def read(self, records: Iterator[Record], seconds: float | None) -> Recording:
        """Return the recording of the first ``seconds`` [s], None = all; raise `InputError` if it is too large."""
        taken = 0
        for record in records:
            take = self._takes.get(record.topic)
            if take is None:
                continue
            begun = record.time if self._start is None else self._start
            if seconds is not None and record.time - begun > seconds:
                break
            try:
                events = list(take(record, record.time - begun))
            except InputError as error:
                self.recording.refused[f"{record.topic}: {error}"] += 1
                continue
            if events:
                self._start = begun
                taken += len(record.data)
                if taken > self._memory:
                    raise self._bag.refusal(
                        "size", f"its first {record.time - begun:.2f} s take more than {self._memory / 1e9:g} GB; "
                        "replay less of it with --seconds"
                    )  # fmt: skip
                self.recording.events += events
                if isinstance(events[0], MapCame | RegionCame):
                    self.recording.map_topics.add(record.topic)
        return self.recording

    def take_map(self, record: Record, now: float) -> Iterator[Event]:
        """Convert a Heightmap."""
        new = conversions.map_from(record.data, self._settings.max_samples)
        start = new.start
        stamp = conversions.stamp_seconds(start)
        at = self._place(start.tile, stamp, now, record.time, horizon=self._settings.motion.max_interval)
        self._require_frame(start.frame_id)
        raster = None if new.geometry is None else Raster(new.geometry, new.heights, friction=new.friction)
        yield MapCame(
            arrives=now, at=at, stamped=stamp is not None, tile=start.tile, raster=raster, velocities=new.velocities,
            delay=self._clocks[start.tile].delay,
        )  # fmt: skip

    def take_region(self, record: Record, now: float) -> Iterator[Event]:
        """Convert a HeightmapUpdate."""
        new = conversions.region_from(record.data, self._settings.max_samples)
        start = new.start
        late = self._settings.motion.max_interval
        stamp = conversions.stamp_seconds(start)
        at = self._place(start.tile, stamp, now, record.time, late, late)
        self._require_frame(start.frame_id)
        yield RegionCame(
            arrives=now, at=at, stamped=stamp is not None, tile=start.tile, row=new.row, column=new.column,
            heights=new.heights, velocities=new.velocities, delay=self._clocks[start.tile].delay,
        )  # fmt: skip

    def take_raster(self, kind: Any, convert: Callable[..., Raster], record: Record, now: float) -> Iterator[Event]:
        """Convert a message that an adapter reads as heights."""
        message = message_from(record.data, kind)
        stamp = conversions.stamp_seconds(message.header.stamp)
        at = self._place("", stamp, now, record.time, horizon=self._settings.motion.max_interval)
        self._require_frame(message.header.frame_id)
        raster = convert(message, self._settings.raster, self._settings.max_samples)
        delay = self._clocks[""].delay
        yield MapCame(arrives=now, at=at, stamped=stamp is not None, tile="", raster=raster, delay=delay)

    def take_tracked(self, record: Record, now: float) -> Iterator[Event]:
        """Convert a TrackedBodyArray."""
        message = message_from(record.data, TrackedBodyArray, self._settings.most_bodies)
        yield self._bodies(record, now, message.header, conversions.bodies_from(message))

    def take_poses(self, record: Record, now: float) -> Iterator[Event]:
        """Convert a PoseArray. Bodies of the previous message that are missing now are gone."""
        message = message_from(record.data, PoseArray, self._settings.most_bodies)
        bodies = conversions.poses_from(message)
        names = {body.name for body in bodies}
        gone, self._of_poses = self._of_poses - names, names
        yield self._bodies(record, now, message.header, bodies, tuple(sorted(gone)))

    def take_pose(self, name: str, record: Record, now: float) -> Iterator[Event]:
        """Convert a PoseStamped."""
        message = message_from(record.data, PoseStamped)
        body = BodyInput(name, conversions.state_from(message.pose), 0.0)
        yield self._bodies(record, now, message.header, [body])

    def take_odometry(self, name: str, record: Record, now: float) -> Iterator[Event]:
        """Convert an Odometry."""
        message = message_from(record.data, Odometry)
        yield self._bodies(
            record, now, message.header, [BodyInput(name, conversions.odometry_from(message), 0.0, stated=True)]
        )

    def take_joints(self, record: Record, now: float) -> Iterator[Event]:
        """Convert a command to robots' joints."""
        yield JointsCame(arrives=now, at=now, message=message_from(record.data, JointState))

    def take_transforms(self, static: bool, record: Record, now: float) -> Iterator[Event]:
        """Store a TFMessage, and yield the poses of bodies that are frames."""
        for stamp, parent, child, transform in transforms_from(record.data):
            time = None if static else conversions.stamp_seconds(stamp) or record.time
            self._frames.add(parent.strip("/"), child.strip("/"), transform, time)
        if self.recording.frame:
            for name, frame in self._settings.frames:
                yield from self._follow(name, frame, record, now)

    def _follow(self, name: str, frame: str, record: Record, now: float) -> Iterator[Event]:
        try:
            pose, stamp = self._frames.lookup(self.recording.frame, frame)
            at = self._place(f"frame {name}", stamp, now, record.time)
        except InputError as error:  # a transform between the frames is still missing
            self.recording.refused[f"bodies.frames: {error}"] += 1
            return
        yield BodiesCame(arrives=now, at=at, bodies=(BodyInput(name, BodyState(*pose), 0.0),))

    def _bodies(
        self, record: Record, now: float, header: Any, bodies: list[BodyInput], gone: tuple[str, ...] = ()
    ) -> BodiesCame:
        stamp, frame = conversions.stamp_seconds(header.stamp), header.frame_id
        self.recording.frames[f"bodies on {record.topic} in frame {frame!r}"] += 1
        terrain = self.recording.frame
        if terrain and frame and frame != terrain:
            transform = self._frames.lookup(terrain, frame, stamp)[0]
            bodies = [body._replace(state=transform.apply(body.state)) for body in bodies]
        for body in bodies:
            require_possible(body.name, body.state)
        at = self._place(record.topic, stamp, now, record.time)
        return BodiesCame(arrives=now, at=at, stamped=stamp is not None, bodies=tuple(bodies), gone=gone)

    def _require_frame(self, frame: str) -> None:
        known = self.recording.frame
        self.recording.frames[f"maps in frame {frame!r}"] += 1
        if known and frame and frame != known:
            raise InputError("frame", f"frame {frame!r} is not the terrain's frame {known!r}")
        self.recording.frame = known or frame

    def _place(
        self, source: str, stamp: float | None, now: float, clock: float, late: float = 0.0, horizon: float = math.inf
    ) -> float:
        """Return the simulated time [s] of a stamp that arrives at ``now`` [s], at ``clock`` [s] of the recorder."""
        known = self._clocks.setdefault(source, StampClock())
        placed = known.place(stamp, clock, lambda age: now - age, late, horizon)
        known.accept(placed)
        return placed.time


# Converts a record, given its arrival after the start [s].
Take = Callable[[Record, float], Iterator[Event]]


def _takers(reader: Reader, bag: Bag, settings: Settings, terrain_topic: str) -> dict[str, Take]:
    """Return the converter of each topic's records."""
    takes: dict[str, Take] = {}
    for topic in bag.of_type(TRACKED):
        if not topic.endswith(OUTPUTS):
            takes[topic] = reader.take_tracked
    for topic in bag.of_type(POSES):
        if topic.endswith("/body_poses"):
            takes[topic] = reader.take_poses
    for topic in bag.of_type(JOINTS):
        if topic.endswith("/joint_commands"):
            takes[topic] = reader.take_joints
    for name, source in settings.poses:
        takes[bag.require(source, POSE, f"bodies.poses names {name!r}")] = partial(reader.take_pose, name)
    for name, source in settings.odometry:
        takes[bag.require(source, ODOMETRY, f"bodies.odometry names {name!r}")] = partial(reader.take_odometry, name)
    for topic in bag.of_type(TRANSFORMS):
        takes[topic] = partial(reader.take_transforms, topic.endswith("static"))
    return {**takes, **_terrain_takers(reader, bag, settings, terrain_topic)}


def _terrain_takers(reader: Reader, bag: Bag, settings: Settings, chosen: str) -> dict[str, Take]:
    if settings.input == "heightmap":
        topics = [bag.require(chosen, HEIGHTMAP, "--terrain")] if chosen else bag.of_type(HEIGHTMAP)
        if not topics:
            raise _without_maps(bag, settings, HEIGHTMAP)
        updates = bag.of_type(HEIGHTMAP_UPDATE)
        return {**dict.fromkeys(topics, reader.take_map), **dict.fromkeys(updates, reader.take_region)}
    adapter = ADAPTERS[settings.input]
    type_name = f"{adapter.package}/msg/{adapter.message}"
    topics = [bag.require(chosen, type_name, "--terrain")] if chosen else bag.of_type(type_name)
    if not topics:
        raise _without_maps(bag, settings, type_name)
    if len(topics) > 1:
        raise bag.refusal("topic", f"the bag has {type_name} on {', '.join(topics)}; choose one with --terrain TOPIC")
    kind = require_message(adapter.package, adapter.message, f"terrain.input {settings.input!r}")
    return {topics[0]: partial(reader.take_raster, kind, adapter.convert)}


def _without_maps(bag: Bag, settings: Settings, type_name: str) -> InputError:
    kinds = {"heightmap": HEIGHTMAP, **{name: f"{a.package}/msg/{a.message}" for name, a in ADAPTERS.items()}}
    other = [name for name, kind in kinds.items() if bag.of_type(kind)]
    hint = f"; it has maps for terrain.input {' or '.join(other)}: give --set terrain.input={other[0]}" if other else ""
    return bag.refusal("maps", f"no maps: terrain.input {settings.input!r} needs {type_name}{hint}")
