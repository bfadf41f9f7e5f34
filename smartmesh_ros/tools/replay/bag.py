"""Recorded messages: bags, sqlite3 or MCAP, and lists of messages."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from rclpy.serialization import serialize_message

from smartmesh_ros.errors import InputError, as_float
from smartmesh_ros.node.inputs.optional_messages import class_of

# The end of the names of topics with the events of a service.
EVENTS = "/_service_event"


class Record(NamedTuple):
    """A message of a bag: its topic, its type (``package/msg/Name``), its recording time [s], and its CDR bytes."""

    topic: str
    type_name: str
    time: float
    data: bytes


class Topic(NamedTuple):
    """A recorded topic: type, number of messages, and whether late subscribers get its last messages."""

    type_name: str
    messages: int
    latched: bool


class Source(ABC):
    """A recording. ``title``: the words before its topics. ``topics``: by full name. ``end`` [s]: time of the last
    message."""

    title: str
    topics: Mapping[str, Topic]
    end: float

    @abstractmethod
    def records(self, topics: Collection[str]) -> Iterator[Record]:
        """Yield the messages of some topics in the order of recording."""

    def refusal(self, reason: str, message: str) -> InputError:
        """Return an error with what the recording contains."""
        lines = [f"  {name}  {topic.type_name}  {topic.messages} messages" for name, topic in self.topics.items()]
        return InputError(reason, "\n".join([message, self.title, *(lines or ["  no topic"])]))


class Bag(Source):
    """A recorded bag: the folder that holds ``metadata.yaml``, or a single .mcap or .db3 file. Needs ``pip install
    rosbags``. Raises `InputError` if it is none."""

    def __init__(self, path: Path) -> None:
        self.path = path.parent if path.name == "metadata.yaml" else path
        self.title = f"The bag {self.path} has"
        if not path.exists():
            raise InputError("bag", f"there is no bag {path}")
        if self.path.is_dir() and not (self.path / "metadata.yaml").is_file():
            there = ", ".join(sorted(other.name for other in self.path.iterdir())[:20]) or "nothing"
            raise InputError("bag", f"{self.path} is no bag: it has no metadata.yaml (there is: {there})")
        with self._open() as reader:
            self.end = 1e-9 * reader.end_time
            self.topics = {
                one.topic: Topic(one.msgtype, one.msgcount, _latched(one.ext.offered_qos_profiles))
                for one in reader.connections
            }

    def records(self, topics: Collection[str]) -> Iterator[Record]:
        """Yield the messages of some topics in the order of recording; raise `InputError` if a file is damaged."""
        with self._open() as reader:
            wanted = [connection for connection in reader.connections if connection.topic in topics]
            for connection, nanoseconds, data in reader.messages(wanted) if wanted else ():
                yield Record(connection.topic, connection.msgtype, nanoseconds * 1e-9, bytes(data))

    @contextmanager
    def _open(self) -> Iterator[Any]:
        from rosbags.rosbag2 import Reader

        try:
            with Reader(self.path) as reader:
                yield reader
        except Exception as error:  # noqa: BLE001  # those of rosbags, SQLite, YAML and decompressors have no common base
            words = f"{type(error).__name__}: {error}".split("\n")[0]
            raise InputError(
                "bag", f"{self.path} is no bag, or it is cut off or damaged ({words}); ros2 bag reindex or the mcap "
                "tool's recover may save what is left"
            ) from None  # fmt: skip


class Messages(Source):
    """A list of (topic, time [s], message or request of a service), as a recording. A name without a leading ``/`` is
    below that of the ``node``. All topics are latched."""

    title = "The messages are"

    def __init__(self, messages: Sequence[tuple[str, float, Any]], node: str) -> None:
        named = ((name if name.startswith("/") else f"{node}/{name}", time, one) for name, time, one in messages)
        self._records = sorted((recorded(*message) for message in named), key=lambda record: record.time)
        counts = Counter(record.topic for record in self._records)
        self.topics = {one.topic: Topic(one.type_name, counts[one.topic], True) for one in self._records}
        self.end = self._records[-1].time if self._records else 0.0

    def records(self, topics: Collection[str]) -> Iterator[Record]:
        """Yield the messages of some topics in the order of time."""
        return (record for record in self._records if record.topic in topics)


def type_of(kind: Any) -> str:
    """Return the name ``package/msg/Name`` of a message class."""
    package, middle, *_ = kind.__module__.split(".")
    return f"{package}/{middle}/{kind.__name__}"


def recorded(topic: str, time: float, message: Any) -> Record:
    """Return a message on a topic at a ``time`` [s] as a record; for a service's request, the event of the call. Raises
    `InputError` for what is no message or request, and for a time that is no number."""
    if not hasattr(type(message), "SLOT_TYPES") or type(message).__name__.endswith("_Response"):
        kind = type(message).__name__
        raise InputError("content", f"{topic} was given a {kind}; it must be a message or the request of a service")
    if not math.isfinite(as_float(time)):
        raise InputError("time", f"the time of {topic} is {time!r}; it must be a number of seconds")
    service, request, _ = type_of(type(message)).partition("_Request")
    if request and service.split("/")[1] == "srv":
        event = class_of(service).Event(request=[message])
        event.info.event_type = event.info.REQUEST_RECEIVED
        topic, message = topic + EVENTS, event
    return Record(topic, type_of(type(message)), time, serialize_message(message))


def _latched(profiles: Any) -> bool:
    """Return True if one of a topic's publishers is latched, or if none is known."""
    return not profiles or any(profile.durability.name == "TRANSIENT_LOCAL" for profile in profiles)
