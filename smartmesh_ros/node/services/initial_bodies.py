"""Bodies named by parameters: spawned at the start or once the terrain covers their place, and again after a full
reset."""

from __future__ import annotations

from smartmesh_ros.errors import InputError
from smartmesh_ros.node.services.spawning import Entry, entry_from_text, spawn
from smartmesh_ros.node.session import Session


class InitialBodies:
    """Entries of ``bodies.spawn``, and entries added later. ``names``: of all entries, in the world or waiting."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self._entries: dict[str, Entry] = {}
        self._waiting: list[str] = []
        for text in session.settings.spawn:
            entry = entry_from_text(text)
            if entry.name in self._entries:
                raise InputError("spawn", f"bodies.spawn names {entry.name!r} twice; names must be distinct")
            self.add(entry)

    @property
    def names(self) -> set[str]:
        """Names of the initial bodies."""
        return set(self._entries)

    def add(self, entry: Entry) -> None:
        """Add an entry, or replace the entry of the same name, and spawn its body unless it must wait for terrain."""
        waiting = not spawn(self._session.world, entry)
        self._entries[entry.name] = entry
        self._waiting = [name for name in self._waiting if name != entry.name]
        if waiting:
            self._waiting.append(entry.name)

    def replace(self, entry: Entry) -> None:
        """Replace the entry of the same name without spawning: its body is in the world already, or waits."""
        self._entries[entry.name] = entry

    def on_terrain(self) -> None:
        """Spawn the bodies that waited for terrain."""
        waiting, self._waiting = self._waiting, []
        for name in waiting:
            try:
                if not spawn(self._session.world, self._entries[name]):
                    self._waiting.append(name)
            except InputError as error:
                self._session.refusals.add("bodies.spawn", error)

    def restore(self) -> None:
        """Spawn again the initial bodies that were removed."""
        for name in self._entries:
            if name not in self._session.world.bodies and name not in self._waiting:
                self._waiting.append(name)
        self.on_terrain()
