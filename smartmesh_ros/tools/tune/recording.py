"""A bag, and the conversion of its records to events, with the node's checks and its mapping of stamps to simulated
time."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import yaml
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
from smartmesh_ros.node.inputs.cdr_reader import Stamped, map_from, message_from, region_from
from smartmesh_ros.node.inputs.conversions import BodyInput
from smartmesh_ros.node.inputs.frames import FrameBuffer
from smartmesh_ros.node.inputs.optional_messages import require_message
from smartmesh_ros.node.inputs.transform_input import transforms_from
from smartmesh_ros.node.parameters.settings import Settings
from smartmesh_ros.node.timing.stamps import StampClock, stamp_seconds
from smartmesh_ros.tools.testing.bags import Record, read
from smartmesh_ros.tools.tune.replay import BodiesCame, Change, Event, JointsCame, MapCame, RegionCame

HEIGHTMAP, HEIGHTMAP_UPDATE = "smartmesh_msgs/msg/Heightmap", "smartmesh_msgs/msg/HeightmapUpdate"
TRACKED, POSES = "smartmesh_msgs/msg/TrackedBodyArray", "geometry_msgs/msg/PoseArray"
POSE, ODOMETRY = "geometry_msgs/msg/PoseStamped", "nav_msgs/msg/Odometry"
JOINTS, TRANSFORMS = "sensor_msgs/msg/JointState", "tf2_msgs/msg/TFMessage"

# Converts a record, given its arrival after the start [s].
Take = Callable[[Record, float], Iterator[Event]]


class Bag:
    """A recorded bag, sqlite3 or MCAP: the folder that holds ``metadata.yaml``. Raises `InputError` if it is none; its
    later errors list its contents.

    ``metadata``: the text of that file. ``topics``: their type (``package/msg/Name``) and number of messages, by name.
    """

    def __init__(self, path: Path) -> None:
        self.path = path if path.is_dir() else path.parent
        file = self.path / "metadata.yaml"
        if not file.is_file():
            there = ", ".join(sorted(other.name for other in self.path.iterdir())[:20]) or "nothing"
            raise InputError("bag", f"{path} is no bag: it has no metadata.yaml (there is: {there})")
        try:
            self.metadata = file.read_text()
            entries = yaml.safe_load(self.metadata)["rosbag2_bagfile_information"]["topics_with_message_count"]
            self.topics: dict[str, tuple[str, int]] = {
                entry["topic_metadata"]["name"]: (entry["topic_metadata"]["type"], int(entry["message_count"]))
                for entry in entries
            }
        except (KeyError, TypeError, ValueError, yaml.YAMLError) as error:
            raise InputError("bag", f"{file} is not that of a bag: {_words(error)}") from None

    def of_type(self, type_name: str, end: str = "") -> list[str]:
        """Return the topics of a type that have messages, and a name with this ``end``."""
        found = [name for name, (kind, messages) in self.topics.items() if kind == type_name and messages]
        return [name for name in found if name.endswith(end)]

    def require(self, name: str, type_name: str, what: str) -> None:
        """Raise `InputError` with the bag's contents if a topic has no messages of a type. ``what`` names the parameter
        or option that needs the topic."""
        if name not in self.topics:
            raise self.refusal("topic", f"{what}: there is no topic {name}")
        kind, messages = self.topics[name]
        if kind != type_name:
            raise self.refusal("topic", f"{what}: {name} has {kind}, and must have {type_name}")
        if not messages:
            raise self.refusal("topic", f"{what}: {name} has no message")

    def refusal(self, reason: str, message: str) -> InputError:
        """Return an error with the contents of the bag."""
        lines = [f"  {name}  {kind}  {messages} messages" for name, (kind, messages) in self.topics.items()]
        return InputError(reason, "\n".join([message, f"The bag {self.path} has", *(lines or ["  no topic"])]))

    def records(self) -> Iterator[Record]:
        """Yield the messages in recorded order; raise `InputError` if the file is cut off or damaged."""
        count = 0
        try:
            for record in read(self.path):
                yield record
                count += 1
        except InputError:
            raise
        except Exception as error:  # noqa: BLE001  # those of rosbags, SQLite and the decompressors have no common base
            raise self.refusal(
                "bag", f"the bag is cut off or damaged after {count} messages ({_words(error)}); ros2 bag reindex or "
                "the mcap tool's recover may save what is left"
            ) from None  # fmt: skip


class Recording:
    """The first ``seconds`` [s] of a bag as ``events`` in order of arrival; time zero is the first record that gives
    an event. Raises `InputError` if the bag is damaged or lacks a topic.

    Records are converted with the same state between them as in the node. ``frame``: the terrain's frame. ``refused``:
    counts of refused records, by the node's message. ``frames``: counts of records, by "what in frame".
    ``map_topics``: topics that changed the terrain.
    """

    def __init__(self, bag: Bag, settings: Settings, terrain_topic: str, seconds: float) -> None:
        self.frame = settings.frame_id.strip("/")
        self.events: list[Event] = []
        self.refused: Counter[str] = Counter()
        self.frames: Counter[str] = Counter()
        self.map_topics: set[str] = set()
        self._settings = settings
        self._clocks: dict[str, StampClock] = {}
        self._frames = FrameBuffer()
        self._of_poses: set[str] = set()
        takes = {**self._body_takes(bag), **self._terrain_takes(bag, terrain_topic)}
        self._read((record for record in bag.records() if record.topic in takes), takes, seconds)

    @property
    def changes(self) -> list[Change]:
        """Events that change the terrain."""
        return [event for event in self.events if isinstance(event, Change)]

    @property
    def length(self) -> float:
        """Time from the first record to the last [s]."""
        return max((event.arrives for event in self.events), default=0.0)

    def _read(self, records: Iterator[Record], takes: Mapping[str, Take], seconds: float) -> None:
        start = None
        for record in records:
            begun = record.time if start is None else start
            if record.time - begun > seconds:
                break
            try:
                events = list(takes[record.topic](record, record.time - begun))
            except InputError as error:
                self.refused[f"{record.topic}: {error}"] += 1
                continue
            if events:
                start = begun
                self.events += events
                if isinstance(events[0], Change):
                    self.map_topics.add(record.topic)

    def _take_map(self, record: Record, now: float) -> Iterator[Event]:
        """Convert a Heightmap."""
        new = map_from(record.data, self._settings.max_samples)
        yield MapCame(**self._placed(new.start, record, now), raster=new.raster, velocities=new.velocities)

    def _take_region(self, record: Record, now: float) -> Iterator[Event]:
        """Convert a HeightmapUpdate."""
        new = region_from(record.data, self._settings.max_samples)
        late = self._settings.motion.max_interval
        placed = self._placed(new.start, record, now, late)
        yield RegionCame(**placed, row=new.row, column=new.column, heights=new.heights, velocities=new.velocities)

    def _take_raster(self, kind: Any, convert: Callable[..., Raster], record: Record, now: float) -> Iterator[Event]:
        """Convert a message that an adapter reads as heights."""
        message = message_from(record.data, kind)
        stamp, frame = message.header.stamp, message.header.frame_id
        placed = self._placed(Stamped(stamp.sec, stamp.nanosec, frame, tile=""), record, now)
        yield MapCame(**placed, raster=convert(message, self._settings.raster, self._settings.max_samples))

    def _take_bodies(
        self, kind: Any, convert: Callable[[Any], list[BodyInput]], record: Record, now: float
    ) -> Iterator[Event]:
        """Convert dictated poses to the terrain's frame. Bodies of the previous PoseArray that are missing are gone."""
        message = message_from(record.data, kind, self._settings.most_bodies)
        bodies, gone = convert(message), set[str]()
        if kind is PoseArray:
            names = {body.name for body in bodies}
            gone, self._of_poses = self._of_poses - names, names
        stamp, frame = stamp_seconds(message.header.stamp), message.header.frame_id
        self.frames[f"bodies on {record.topic} in frame {frame!r}"] += 1
        if self.frame and frame and frame != self.frame:
            transform = self._frames.lookup(self.frame, frame, stamp)[0]
            bodies = [body._replace(state=transform.apply(body.state)) for body in bodies]
        for body in bodies:
            require_possible(body.name, body.state)
        at = self._place(record.topic, stamp, now, record.time)
        yield BodiesCame(arrives=now, at=at, bodies=tuple(bodies), gone=tuple(sorted(gone)))

    def _take_joints(self, record: Record, now: float) -> Iterator[Event]:
        """Convert a command to robots' joints."""
        yield JointsCame(arrives=now, at=now, message=message_from(record.data, JointState))

    def _take_transforms(self, static: bool, record: Record, now: float) -> Iterator[Event]:
        """Store a TFMessage, and yield the poses of bodies that are frames."""
        for stamp, parent, child, transform in transforms_from(record.data):
            time = None if static else stamp_seconds(stamp) or record.time
            self._frames.add(parent.strip("/"), child.strip("/"), transform, time)
        for name, frame in self._settings.frames if self.frame else ():
            try:
                pose, known = self._frames.lookup(self.frame, frame)
                at = self._place(f"frame {name}", known, now, record.time)
            except InputError as error:  # a transform between the frames is still missing
                self.refused[f"bodies.frames: {error}"] += 1
                continue
            yield BodiesCame(arrives=now, at=at, bodies=(BodyInput(name, BodyState(*pose), 0.0),))

    def _placed(self, start: Stamped, record: Record, now: float, late: float = 0.0) -> dict[str, Any]:
        """Return the tile of a map and when it arrives and is valid; raise `InputError` if it is in another frame than
        those before."""
        tile, frame, known = start.tile, start.frame_id, self.frame
        stamp, horizon = stamp_seconds(start), self._settings.motion.max_interval
        at = self._place(tile, stamp, now, record.time, late, horizon)
        self.frames[f"maps in frame {frame!r}"] += 1
        if known and frame and frame != known:
            raise InputError("frame", f"frame {frame!r} is not the terrain's frame {known!r}")
        self.frame = known or frame
        return {"arrives": now, "at": at, "tile": tile, "delay": self._clocks[tile].delay}

    def _place(
        self, source: str, stamp: float | None, now: float, clock: float, late: float = 0.0, horizon: float = math.inf
    ) -> float:
        """Return the simulated time [s] of a stamp that arrives at ``now`` [s], at ``clock`` [s] of the recorder."""
        known = self._clocks.setdefault(source, StampClock())
        placed = known.place(stamp, clock, lambda age: now - age, late, horizon)
        known.accept(placed)
        return placed.time

    def _body_takes(self, bag: Bag) -> dict[str, Take]:
        """Return the converter of each topic of bodies, joints and transforms."""
        takes: dict[str, Take] = {}
        for topic in bag.of_type(TRACKED):
            if not topic.endswith("/body_states"):  # an output of the node, in a recording of all topics
                takes[topic] = partial(self._take_bodies, TrackedBodyArray, conversions.bodies_from)
        for topic in bag.of_type(POSES, "/body_poses"):
            takes[topic] = partial(self._take_bodies, PoseArray, conversions.poses_from)
        for name, topic in self._settings.poses:
            bag.require(topic, POSE, f"bodies.poses names {name!r}")
            takes[topic] = partial(self._take_bodies, PoseStamped, partial(_from_pose, name))
        for name, topic in self._settings.odometry:
            bag.require(topic, ODOMETRY, f"bodies.odometry names {name!r}")
            takes[topic] = partial(self._take_bodies, Odometry, partial(_from_odometry, name))
        for topic in bag.of_type(JOINTS, "/joint_commands"):
            takes[topic] = self._take_joints
        for topic in bag.of_type(TRANSFORMS):
            takes[topic] = partial(self._take_transforms, topic.endswith("static"))
        return takes

    def _terrain_takes(self, bag: Bag, chosen: str) -> dict[str, Take]:
        """Return the converter of each topic of maps; raise `InputError` if there is none, or a choice of several."""
        kinds = {"heightmap": HEIGHTMAP, **{name: f"{a.package}/msg/{a.message}" for name, a in ADAPTERS.items()}}
        kind = kinds[self._settings.input]
        topics = [chosen] if chosen else bag.of_type(kind)
        if chosen:
            bag.require(chosen, kind, "--terrain")
        elif not topics:
            other = [name for name, type_name in kinds.items() if bag.of_type(type_name)]
            hint = f"; it has maps for terrain.input {' or '.join(other)}: give --set terrain.input=" if other else ""
            message = f"no maps: terrain.input {self._settings.input!r} needs {kind}{hint}{''.join(other[:1])}"
            raise bag.refusal("maps", message)
        if self._settings.input == "heightmap":
            updates = bag.of_type(HEIGHTMAP_UPDATE)
            return {**dict.fromkeys(topics, self._take_map), **dict.fromkeys(updates, self._take_region)}
        if len(topics) > 1:
            raise bag.refusal("topic", f"the bag has {kind} on {', '.join(topics)}; choose one with --terrain TOPIC")
        adapter = ADAPTERS[self._settings.input]
        made = require_message(adapter.package, adapter.message, f"terrain.input {self._settings.input!r}")
        return {topics[0]: partial(self._take_raster, made, adapter.convert)}


def _from_pose(name: str, message: PoseStamped) -> list[BodyInput]:
    return [BodyInput(name, conversions.state_from(message.pose), 0.0)]


def _from_odometry(name: str, message: Odometry) -> list[BodyInput]:
    return [BodyInput(name, conversions.odometry_from(message), 0.0, stated=True)]


def _words(error: Exception) -> str:
    return f"{type(error).__name__}: {error}".split("\n")[0]
