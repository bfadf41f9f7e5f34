"""Bags without a ROS installation: write messages, play bags into nodes under test. Needs ``pip install rosbags``.

Bags are sqlite3 or MCAP and hold the CDR bytes that ROS itself serializes; ``ros2 bag`` reads them.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from time import monotonic
from typing import Any, Literal, get_args

from rclpy.node import Node
from rosbags.rosbag2 import StoragePlugin, Writer

from smartmesh_ros.errors import InputError, require
from smartmesh_ros.node.inputs.optional_messages import class_of
from smartmesh_ros.tools.replay.bag import EVENTS, Bag, Record, recorded
from smartmesh_ros.tools.replay.mcap_file import VERSION, add_topic
from smartmesh_ros.tools.testing.process import TIMEOUT

Storage = Literal["sqlite3", "mcap"]


def write(path: str | Path, messages: Iterable[tuple[str, float, Any]], storage: Storage = "mcap") -> None:
    """Write (topic, time [s], message) to a new bag, the folder ``path``; for (service, time [s], request) the event of
    the call. Names are full. Raises `InputError`, and leaves nothing behind, if there is a file or folder ``path``, or
    what is given cannot be recorded."""
    require(storage in get_args(Storage), "parameter", "the storage", storage, " or ".join(get_args(Storage)))
    if Path(path).exists():
        raise InputError("file", f"{path} is there, and a bag is a new folder; name another one, or remove it")
    connections: dict[tuple[str, str], Any] = {}
    try:
        with Writer(path, version=VERSION, storage_plugin=StoragePlugin[storage.upper()]) as writer:
            for record in (recorded(*message) for message in messages):
                key = record.topic, record.type_name
                require(key[0].startswith("/"), "topic", "a name", key[0], "a full one, which begins with '/'")
                require(record.time >= 0.0, "time", f"the time of {key[0]}", record.time, "zero or more")
                if key not in connections:
                    connections[key] = add_topic(writer, *key, [])
                writer.write(connections[key], round(record.time * 1e9), record.data)
    except BaseException:
        shutil.rmtree(path, ignore_errors=True)
        raise


def read(path: str | Path) -> Iterator[Record]:
    """Yield the messages of a bag in the order of recording."""
    bag = Bag(Path(path))
    return bag.records(bag.topics)


def play(
    path: str | Path,
    node: Node,
    spin: Callable[[float], None],
    *,
    rate: float = 1.0,
    remap: dict[str, str] | None = None,
    qos: Any = 10,
    timeout: float = TIMEOUT,
) -> int:
    """Publish a bag from ``node`` at ``rate`` times the recorded speed; return the number of messages.

    ``spin`` is called with the time to wait [s], like `Probe.spin`. ``remap``: new names by recorded topic. Publishing
    starts when every topic has a subscriber. Raises `AssertionError` if one has none after ``timeout`` [s], and
    `InputError` for a ``rate`` that is not above zero, and for a bag with calls.
    """
    require(rate > 0.0, "parameter", "the rate", rate, "a number above zero")
    records = list(read(path))
    if calls := sorted({record.topic for record in records if record.topic.endswith(EVENTS)}):
        raise InputError("topic", f"{path} has calls, on {', '.join(calls)}: a replay makes them, play none")
    publishers = {
        topic: node.create_publisher(class_of(kind), (remap or {}).get(topic, topic), qos)
        for topic, kind in {record.topic: record.type_name for record in records}.items()
    }
    try:
        end = monotonic() + timeout
        while alone := [it.topic_name for it in publishers.values() if not it.get_subscription_count()]:
            if monotonic() > end:
                raise AssertionError(
                    f"nobody subscribes to {', '.join(alone)} after {timeout:g} s; remap renames topics"
                )
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
