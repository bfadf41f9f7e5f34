"""Outputs of a replay in an MCAP file, as rosbag2 writes them. Needs ``pip install mcap``."""

from __future__ import annotations

from pathlib import Path
from typing import IO, Any

import yaml
from mcap.writer import Writer

from smartmesh_ros.tools.replay.bag import type_of
from smartmesh_ros.tools.replay.definitions import definition_of, hash_of
from smartmesh_ros.tools.replay.transport import Publisher

# Version of rosbag2's metadata that Jazzy writes.
VERSION = 9
# Seconds and nanoseconds of a duration without end.
FOREVER = {"sec": 9223372036, "nsec": 854775807}


class McapFile:
    """A new file at ``path`` for the length of a block, after which it is whole. ``notes``: its metadata
    ``smartmesh_ros``."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.notes: dict[str, str] = {}
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        self._topics: dict[str, dict[str, Any]] = {}  # rosbag2's metadata by topic
        self._times: list[int] = []  # of the first and the last message [ns]

    def __enter__(self) -> McapFile:
        self._stream: IO[bytes] = self.path.open("wb")
        self._writer = Writer(self._stream)
        self._writer.start(profile="ros2")
        return self

    def __exit__(self, *_: object) -> None:
        with self._stream:
            self._writer.add_metadata("smartmesh_ros", self.notes)
            about = yaml.safe_dump(self._metadata(), sort_keys=False)
            self._writer.add_metadata("rosbag2", {"serialized_metadata": about})
            self._writer.finish()  # type: ignore[no-untyped-call]

    def write(self, publisher: Publisher, time: float, data: bytes) -> None:
        """Write the bytes of an output's message, published at ``time`` [s]."""
        topic, nanoseconds = publisher.topic_name, round(time * 1e9)
        if topic not in self._channels:
            self._add(publisher)
        entry = self._topics[topic]
        self._times = [*self._times[:1], nanoseconds]
        entry["message_count"] += 1
        self._writer.add_message(self._channels[topic], nanoseconds, data, nanoseconds, sequence=entry["message_count"])

    @property
    def counts(self) -> dict[str, int]:
        """Number of messages by topic."""
        return {topic: entry["message_count"] for topic, entry in self._topics.items()}

    def _add(self, publisher: Publisher) -> None:
        name = type_of(publisher.kind)
        if name not in self._schemas:
            text = definition_of(publisher.kind).encode()
            self._schemas[name] = self._writer.register_schema(name, "ros2msg", text)
        profiles = [_profile(publisher)]
        written = yaml.safe_dump(profiles, sort_keys=False)
        self._channels[publisher.topic_name] = self._writer.register_channel(
            publisher.topic_name, "cdr", self._schemas[name], {"offered_qos_profiles": written}
        )
        about = {
            "name": publisher.topic_name, "type": name, "serialization_format": "cdr", "offered_qos_profiles": profiles,
            "type_description_hash": hash_of(publisher.kind),
        }  # fmt: skip
        self._topics[publisher.topic_name] = {"topic_metadata": about, "message_count": 0}

    def _metadata(self) -> dict[str, Any]:
        """Return rosbag2's metadata, by which it reads the QoS of the topics."""
        first, last = (self._times or [0])[0], (self._times or [0])[-1]
        span = {"starting_time": {"nanoseconds_since_epoch": first}, "duration": {"nanoseconds": last - first}}
        count = sum(self.counts.values())
        return {
            "version": VERSION, "storage_identifier": "mcap", "relative_file_paths": [], **span, "message_count": count,
            "topics_with_message_count": list(self._topics.values()), "compression_format": "", "compression_mode": "",
            "files": [], "custom_data": None, "ros_distro": "jazzy",
        }  # fmt: skip


def _profile(publisher: Publisher) -> dict[str, Any]:
    """Return the QoS of an output, as rosbag2 writes it."""
    return {
        "history": "keep_last", "depth": publisher.depth, "reliability": "reliable",
        "durability": "transient_local" if publisher.latched else "volatile", "deadline": {**FOREVER},
        "lifespan": {**FOREVER}, "liveliness": "automatic", "liveliness_lease_duration": {**FOREVER},
        "avoid_ros_namespace_conventions": False,
    }  # fmt: skip
