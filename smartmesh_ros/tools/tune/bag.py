"""A bag's topics and records. Every error lists the contents of the bag."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import yaml

from smartmesh_ros.errors import InputError
from smartmesh_ros.tools.testing.bags import Record, read


class Bag:
    """A recorded bag, sqlite3 or MCAP: the folder that holds ``metadata.yaml``. Raises `InputError` if it is none.

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


def _words(error: Exception) -> str:
    return f"{type(error).__name__}: {error}".split("\n")[0]
