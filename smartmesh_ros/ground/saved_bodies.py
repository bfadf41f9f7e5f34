"""The state of a PyBullet world and of the ground in it, saved and restored in place."""

from __future__ import annotations

import math
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pybullet as pb

from smartmesh_ros.errors import InputError
from smartmesh_ros.ground.attached_bodies import AttachedBodies
from smartmesh_ros.ground.bullet import undone
from smartmesh_ros.ground.followers import Belt
from smartmesh_ros.soil.soil import Soil
from smartmesh_ros.terrain import state_file
from smartmesh_ros.terrain.terrain import STATE_TYPES, Terrain

KIND = "Ground"
TYPES = {**STATE_TYPES, Belt.__name__: Belt}


class SavedBodies(AttachedBodies):
    """Bodies on a terrain whose state can be saved and restored; see `Ground`."""

    def save_state(self, file: str | os.PathLike[str] | None = None) -> bytes:
        """Return the state of PyBullet's world and of the ground, and write it to a ``file`` unless it is None.

        It has what PyBullet's ``saveBullet`` has, poses, velocities, contacts and their impulses, and the terrain with
        its motion, decks and soil, moving surfaces, the time, and for how long bodies were still. The world is put into
        this state, so that it goes on to the bit as one that is restored from it; what slept wakes, and sleeps again
        after a few steps. Not in it are what PyBullet saves nowhere: targets of joint motors, constraints,
        `changeDynamics`, and settings. Raises `InputError` if contacts do not come from the map, or the file cannot be
        written.
        """
        with self._hidden():
            self._require_exact()
            self.drop_gone()
            data = state_file.to_bytes(KIND, {**self.laid(), **self._memory(), "links": self._links})
        if file is not None:
            state_file.write(data, file)
        self.restore_state(data)
        return data

    def restore_state(self, state: bytes | str | os.PathLike[str]) -> float:
        """Put PyBullet's world and the ground into a ``state``, bytes or a file, and return its time [s].

        The same bodies must be there, attached in the same order, as after the same script. Tiles that are there take
        the restored ground in place. PyBullet's ``enableFileCaching`` is on from then on, as by default. Raises
        `InputError` and changes nothing if the state is none, was damaged, was saved by another version, or has other
        bodies.
        """
        self._require_exact()
        tree = state_file.from_bytes(state_file.read(state), KIND, TYPES)
        self.drop_gone()
        self._require_same(tree)
        with self._hidden():
            self._replace(tree)
        return float(tree["time"])

    def _replace(self, tree: dict[str, Any]) -> None:
        """Take a state that was read; on an error everything is as before."""
        before = self._memory()
        laid = tree["terrain"], tree["soil"], tree["tile"]
        with state_file.foreign_refused(), undone(lambda: self._recall(before)), self.other_terrain(*laid):
            self._recall(tree)

    @contextmanager
    def other_terrain(self, terrain: Terrain, soil: dict[str, Any] | None, tile: str) -> Iterator[Soil | None]:
        """Take the terrain and the soil on a ``tile`` of a state for the block, which gets the soil; they are as before
        if it raises."""
        found = self.soil
        known = {} if found is None else dict(vars(found))
        with self.terrain.unchanged(), undone(lambda: None if found is None else vars(found).update(known)):
            self.terrain.become(terrain)
            if soil is None:
                yield None
            elif found is None:
                yield Soil.from_state(self.terrain, soil, tile)
            else:
                found.become(self.terrain, soil, tile)
                yield found

    def forget(self) -> None:
        """Forget the past of all bodies but poses and velocities: contacts, their impulses and order, rest, and how the
        soil was sheared; what sleeps wakes. Worlds that are equal then evolve equally, even with different pasts."""
        self.contacts.require_client()
        self.contacts.core.forget()
        self._printed = math.nan

    def laid(self) -> dict[str, Any]:
        """Return the terrain and the soil on it, as `other_terrain` takes them."""
        self.check_soil()
        soil = None if self.soil is None else self.soil.state()
        return {"terrain": self.terrain, "soil": soil, "tile": self.tile_of_soil}

    @property
    def tile_of_soil(self) -> str:
        """Name of the tile that gives way, empty if none does."""
        tiles = self.terrain.tiles.items()
        return next((name for name, mesh in tiles if self.soil is not None and self.soil.map is mesh), "")

    @property
    def _links(self) -> list[tuple[int, int]]:
        return [(follower.body, follower.link) for follower in self.followers]

    def _memory(self) -> dict[str, Any]:
        """Return what PyBullet and the core know of the bodies."""
        return {
            "time": self.clock,
            "bullet": np.frombuffer(_saved_bullet(self._client), np.uint8),
            "belts": [follower.belt for follower in self.followers],
            "memory": self.contacts.memory([follower.slot for follower in self.followers]),
        }

    def _recall(self, known: dict[str, Any]) -> None:
        """Let PyBullet and the core know what `_memory` returned, and nothing else of the past."""
        contacts = self.contacts
        contacts.core.time = known["time"]
        contacts.core.set_soil(None)  # restoring finds contacts, which must not press the soil
        # The order of contacts depends on earlier positions of the bodies, which the first restoring replaces.
        _restore_bullet(self._client, known["bullet"])
        contacts.core.forget()
        _restore_bullet(self._client, known["bullet"])
        contacts.core.set_soil(None if self.soil is None else self.soil.core)
        for follower, belt in zip(self.followers, known["belts"], strict=True):
            follower.belt = belt
            if follower.solid:
                contacts.drive(follower)
        contacts.recall([follower.slot for follower in self.followers], known["memory"])
        self._printed = math.nan  # the next update writes prints of the soil, as if there had been none

    def _require_exact(self) -> None:
        """Raise `InputError` if a state of these contacts cannot be saved."""
        self.contacts.require_client()

    @contextmanager
    def _hidden(self) -> Iterator[None]:
        """Draw no ground in the block, whose bodies are no part of a state."""
        rate = self.drawn
        self.hide()
        try:
            yield
        finally:
            if rate:
                self.show(rate)

    def _require_same(self, tree: dict[str, Any]) -> None:
        """Raise `InputError` if a state is that of other bodies."""
        if tree["links"] != self._links:
            count, own = len(tree["links"]), len(self._links)
            raise InputError(
                "state",
                f"the state has {count} attached bodies and links, and this ground has {own} or others; make "
                "and attach the same, in the same order",
            )
        if (tree["soil"] is None) != (self.soil is None):
            wants = "soil, so call set_soil before" if self.soil is None else "no soil, so call set_soil(None) before"
            raise InputError("state", f"the state has {wants}")


def _saved_bullet(client: Any) -> bytes:
    """Return PyBullet's world as ``saveBullet`` writes it."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "world.bullet")
        client.saveBullet(str(file))
        return file.read_bytes()


def _restore_bullet(client: Any, world: np.ndarray) -> None:
    """Restore what `_saved_bullet` returned; raises `InputError` if PyBullet has other bodies."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "world.bullet")
        file.write_bytes(world.tobytes())
        client.setPhysicsEngineParameter(enableFileCaching=0)  # PyBullet would keep each file for ever
        try:
            client.restoreState(fileName=str(file))
        except pb.error as error:
            raise InputError(
                "state",
                f"PyBullet cannot restore its part of the state ({error}): it has other bodies than when it was saved",
            ) from None
        finally:
            client.setPhysicsEngineParameter(enableFileCaching=1)
