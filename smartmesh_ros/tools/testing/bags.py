"""Bags without a ROS installation: write messages, play bags into nodes under test. Needs ``pip install rosbags``.

Bags are sqlite3 or MCAP and hold the CDR bytes that ROS itself serializes; ``ros2 bag`` reads them.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from time import monotonic
from typing import Any, Literal, NamedTuple

from ament_index_python.packages import get_package_share_directory
from rclpy.node import Node
from rclpy.serialization import serialize_message
from rosbags.rosbag2 import Reader, StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

Storage = Literal["sqlite3", "mcap"]
# Version of the bag format that Jazzy writes.
VERSION: Literal[9] = 9


class Record(NamedTuple):
    """A message of a bag: its topic, its type (``package/msg/Name``), its recording time [s], and its CDR bytes."""

    topic: str
    type_name: str
    time: float
    data: bytes


def write(path: Path, messages: Iterable[tuple[str, float, Any]], storage: Storage = "mcap") -> None:
    """Write (topic, time [s], message) to a new bag, the folder ``path``."""
    types = get_typestore(Stores.ROS2_JAZZY)
    connections: dict[tuple[str, str], Any] = {}
    with Writer(path, version=VERSION, storage_plugin=StoragePlugin[storage.upper()]) as writer:
        for topic, time, message in messages:
            name = type_name(message)
            if (topic, name) not in connections:
                _register(types, name)
                connections[topic, name] = writer.add_connection(topic, name, typestore=types)
            writer.write(connections[topic, name], round(time * 1e9), serialize_message(message))


def read(path: Path) -> Iterator[Record]:
    """Yield the messages of a bag in the order of recording."""
    with Reader(path) as reader:
        for connection, nanoseconds, data in reader.messages():
            yield Record(connection.topic, connection.msgtype, nanoseconds * 1e-9, bytes(data))


def play(
    path: Path,
    node: Node,
    spin: Callable[[float], None],
    *,
    rate: float = 1.0,
    remap: dict[str, str] | None = None,
    qos: Any = 10,
) -> int:
    """Publish a bag from ``node`` at ``rate`` times the recorded speed; return the number of messages.

    ``spin`` is called with the time to wait [s], like `Probe.spin`. ``remap``: new names by recorded topic. Publishing
    starts when every topic has a subscriber.
    """
    records = list(read(path))
    names = {**{record.topic: record.topic for record in records}, **(remap or {})}
    publishers = {
        record.topic: node.create_publisher(message_class(record.type_name), names[record.topic], qos)
        for record in {record.topic: record for record in records}.values()
    }
    try:
        while not all(publisher.get_subscription_count() for publisher in publishers.values()):
            spin(0.02)
        start = monotonic()
        for record in records:
            due = start + (record.time - records[0].time) / rate
            while (left := due - monotonic()) > 0.0:
                spin(left)
            publishers[record.topic].publish(record.data)
        for publisher in publishers.values():
            publisher.wait_for_all_acked()
    finally:
        for publisher in publishers.values():
            node.destroy_publisher(publisher)
    return len(records)


def type_name(message: Any) -> str:
    """Return the type ``package/msg/Name`` of a message."""
    package, kind, *_ = type(message).__module__.split(".")
    return f"{package}/{kind}/{type(message).__name__}"


def message_class(name: str) -> Any:
    """Return the class of ``package/msg/Name``."""
    package, kind, message = name.split("/")
    return getattr(importlib.import_module(f"{package}.{kind}"), message)


def _register(types: Typestore, name: str) -> None:
    """Register all installed messages of the package of type ``name``, unless the store knows the type."""
    if name in types.types:
        return
    package, kind, _ = name.split("/")
    found: dict[str, Any] = {}
    for file in (Path(get_package_share_directory(package)) / kind).glob("*.msg"):
        found.update(get_types_from_msg(file.read_text(), f"{package}/{kind}/{file.stem}"))
    types.register({key: value for key, value in found.items() if key not in types.types})
