"""Outputs of a replay in an MCAP file, as rosbag2 writes them. Needs ``pip install rosbags``."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Literal

from rosbags.interfaces import Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

from smartmesh_ros.errors import InputError
from smartmesh_ros.node.inputs.optional_messages import class_of
from smartmesh_ros.tools.replay.bag import type_of
from smartmesh_ros.tools.replay.definitions import definition_of, hash_of
from smartmesh_ros.tools.replay.transport import Publisher

# Version of the bag format that Jazzy writes.
VERSION: Literal[9] = 9
# A duration without end.
FOREVER = QosTime(9223372036, 854775807)


class McapFile:
    """A new file at ``path``, which is there after the block, unless that raises. ``counts``: of its messages by topic.
    Raises `InputError` if there is something else than a file, or, at the end of the block, if it cannot be written."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.counts: Counter[str] = Counter()
        self._connections: dict[str, Any] = {}
        self._failure: OSError | None = None

    def __enter__(self) -> McapFile:
        if self.path.exists() and not self.path.is_file():  # a device, too, would be replaced
            kind = "a folder" if self.path.is_dir() else "no file"
            raise InputError("file", f"{self.path} is {kind}; name a file")
        # A bag is a folder; the file that it holds takes its place in the end.
        with self._naming():
            self._folder = TemporaryDirectory(prefix=f".{self.path.stem}.", dir=self.path.parent)
            bag = Path(self._folder.name) / self.path.stem
            self._writer = Writer(bag, version=VERSION, storage_plugin=StoragePlugin.MCAP)
            self._writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
            self._writer.open()
        self._file = bag / f"{bag.name}.mcap"
        return self

    def __exit__(self, raised: type[BaseException] | None, *_: object) -> None:
        with self._naming(), self._folder:
            if self._failure is not None:
                raise self._failure
            self._writer.close()
            if raised is None:
                self._file.replace(self.path)

    @contextmanager
    def _naming(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:  # of a full disk, above all
            raise InputError("file", f"{self.path} cannot be written: {error.strerror}") from None

    def note(self, key: str, value: str) -> None:
        """Add an entry to rosbag2's ``custom_data``."""
        self._writer.set_custom_data(key, value)

    def write(self, publisher: Publisher, time: float, data: bytes) -> None:
        """Write the bytes of an output's message, published at ``time`` [s]. Raises `OSError` if that fails, which ends
        a replay; the collider would count an `InputError`, and go on."""
        topic = publisher.topic_name
        if topic not in self._connections:
            self._connections[topic] = add_topic(self._writer, topic, type_of(publisher.kind), [_qos(publisher)])
        self.counts[topic] += 1
        try:
            self._writer.write(self._connections[topic], round(time * 1e9), data)
        except OSError as error:
            self._failure = error
            raise


def add_topic(writer: Writer, topic: str, type_name: str, qos: list[Qos]) -> Any:
    """Add a topic with its definition to a bag; return its connection."""
    kind = class_of(type_name)
    return writer.add_connection(
        topic, type_name, msgdef=definition_of(kind), rihs01=hash_of(kind) or "none", offered_qos_profiles=qos
    )


def _qos(publisher: Publisher) -> Qos:
    depth, durability = publisher.qos.depth, QosDurability[publisher.qos.durability.name]
    return Qos(
        QosHistory.KEEP_LAST, depth, QosReliability.RELIABLE, durability, FOREVER, FOREVER,
        QosLiveliness.AUTOMATIC, FOREVER, avoid_ros_namespace_conventions=False,
    )  # fmt: skip
