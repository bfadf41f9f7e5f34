"""A bag's topics and records. Every error lists the contents of the bag."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import yaml

from smartmesh_ros.errors import InputError
from smartmesh_ros.tools.testing.bags import Record, read


class Topic(NamedTuple):
    """A topic of a bag: its name, its type (``package/msg/Name``) and how many messages it has."""

    name: str
    type_name: str
    messages: int


class Bag:
    """A recorded bag, sqlite3 or MCAP: the folder that holds ``metadata.yaml``. Raises `InputError` if it is none."""

    def __init__(self, path: Path) -> None:
        self.path = path if path.is_dir() else path.parent
        self.topics = _topics(self.path)

    @property
    def contents(self) -> str:
        """The topics of the bag, as a text."""
        lines = [f"  {topic.name}  {topic.type_name}  {topic.messages} messages" for topic in self.topics]
        return "\n".join([f"The bag {self.path} has", *lines]) if lines else f"The bag {self.path} has no topic."

    def of_type(self, type_name: str) -> list[str]:
        """Return the topics of a type that have messages."""
        return [topic.name for topic in self.topics if topic.type_name == type_name and topic.messages]

    def require(self, topic: str, type_name: str, what: str) -> str:
        """Return a topic after checking that it has messages of a type; raise `InputError` with the bag's contents if
        not. ``what`` names the parameter or option that needs the topic."""
        found = [known for known in self.topics if known.name == topic]
        if not found:
            raise self.refusal("topic", f"{what}: there is no topic {topic}")
        if found[0].type_name != type_name:
            raise self.refusal("topic", f"{what}: {topic} has {found[0].type_name}, and must have {type_name}")
        if not found[0].messages:
            raise self.refusal("topic", f"{what}: {topic} has no message")
        return topic

    def refusal(self, reason: str, message: str) -> InputError:
        """Return an error with the contents of the bag."""
        return InputError(reason, f"{message}\n{self.contents}")

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


def _topics(path: Path) -> list[Topic]:
    metadata = path / "metadata.yaml"
    if not metadata.is_file():
        there = ", ".join(sorted(file.name for file in path.iterdir())[:20]) if path.is_dir() else "no such folder"
        raise InputError("bag", f"{path} is no bag: it has no metadata.yaml (there is: {there or 'nothing'})")
    try:
        information = yaml.safe_load(metadata.read_text())["rosbag2_bagfile_information"]
        entries = information["topics_with_message_count"]
        return [
            Topic(entry["topic_metadata"]["name"], entry["topic_metadata"]["type"], int(entry["message_count"]))
            for entry in entries
        ]
    except (KeyError, TypeError, ValueError, yaml.YAMLError) as error:
        raise InputError("bag", f"{metadata} is not that of a bag: {_words(error)}") from None


def _words(error: Exception) -> str:
    return f"{type(error).__name__}: {error}".split("\n")[0]
