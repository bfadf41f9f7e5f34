"""Decks, which ride on TF frames, odometry topics or bodies."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import NamedTuple

from nav_msgs.msg import Odometry

from smartmesh_ros.errors import naming
from smartmesh_ros.ground.state import BodyState
from smartmesh_ros.ground.transform import Transform, fixed_to
from smartmesh_ros.node.inputs import conversions
from smartmesh_ros.node.inputs.body_inputs import BEST_EFFORT
from smartmesh_ros.node.inputs.cdr_reader import Stamped
from smartmesh_ros.node.inputs.source_clocks import SourceClocks
from smartmesh_ros.node.inputs.transform_input import TransformInput
from smartmesh_ros.node.session import Session
from smartmesh_ros.node.timing.stamps import stamp_seconds
from smartmesh_ros.terrain.deck import Deck, name_of_tile
from smartmesh_ros.terrain.tiles import Tiles
from smartmesh_ros.world.driving import Carrier

SOURCE = "decks"


class Target(NamedTuple):
    """Where a terrain message belongs: to a ``tile`` of the terrain, or of a deck, by the ``name`` of all, and the
    ``frame`` that its header may have, "" = the terrain's."""

    tiles: Tiles
    tile: str
    name: str
    frame: str = ""


class DeckInputs:
    """Moves the decks of the parameter ``decks``. A deck is ground from its first pose on, or once its body is
    there. ``decks``: by name."""

    def __init__(self, session: Session, transforms: TransformInput) -> None:
        self._session, self._transforms = session, transforms
        self._entries = {entry.deck: entry for entry in session.settings.decks}
        self.decks: Mapping[str, Deck] = {
            name: Deck(thickness=entry.thickness) for name, entry in self._entries.items()
        }
        self._clocks = SourceClocks(session)
        for name, entry in self._entries.items():
            if entry.source == "frame":
                transforms.follow(SOURCE, entry.name, partial(self._follow, name))
            if entry.source == "odometry":
                with naming(SOURCE):
                    session.listen(Odometry, entry.name, partial(self._on_odometry, name), BEST_EFFORT, private=False)
            self._carry(name)

    def take_restored(self) -> None:
        """Moves the decks that the terrain has under the names of the entries from now on. Others have no pose yet.
        Counts and logs which body lacks the link that is to carry a deck."""
        session, world = self._session, self._session.world
        self.decks = {name: world.terrain.decks.get(name, deck) for name, deck in self.decks.items()}
        session.deck_times = {name: heard for name, heard in session.deck_times.items() if name in world.terrain.decks}
        for name in self._entries:
            with session.enduring(SOURCE):
                self._carry(name)

    def _carry(self, name: str) -> None:
        """Let the body of a deck's entry carry the deck. Raises `InputError` if it lacks the link."""
        entry = self._entries[name]
        if entry.source == "body":
            self._session.world.carry(name, Carrier(entry.name, entry.link, *entry.pose))

    def target(self, start: Stamped) -> Target:
        """Return where a terrain message belongs: to the deck that its tile names, alone or before a slash, or whose
        frame it is in; else to the terrain."""
        tile = start.name
        name, _, inner = tile.partition("/")
        for deck, entry in self._entries.items():
            if deck == name:
                return Target(self.decks[deck], inner, tile, entry.frame)
            if start.frame_id and start.frame_id == entry.frame:
                return Target(self.decks[deck], tile, name_of_tile(deck, tile), entry.frame)
        return Target(self._session.world.terrain, tile, tile)

    def refresh(self) -> None:
        """Puts decks into the terrain whose bodies are there."""
        for name, entry in self._entries.items():
            if entry.source == "body" and entry.name in self._session.world.bodies:
                self._enter(name)

    def _follow(self, name: str, pose: Transform, stamp: float | None, restarted: bool) -> None:
        if restarted:
            self._clocks.pop(_source(name), None)
        self._move(name, BodyState(*pose), stamp, stated=False)

    def _on_odometry(self, name: str, message: Odometry) -> None:
        stamp = stamp_seconds(message.header.stamp)
        transform = self._transforms.to_terrain(message.header.frame_id, stamp)
        state = conversions.odometry_from(message)
        self._move(name, state if transform is None else transform.apply(state), stamp, stated=True)

    def _move(self, name: str, state: BodyState, stamp: float | None, *, stated: bool) -> None:
        """Move a deck with the frame that is in a ``state`` at a ``stamp`` [s]. Raises `InputError`."""
        entry, deck = self._entries[name], self.decks[name]
        own = fixed_to(state, entry.pose)
        velocity, spin = (own.linear, own.angular) if stated else (None, None)
        with self._clocks.placing(_source(name), stamp) as placed:
            if placed.fresh:  # times before it were those of another clock
                deck.place(own.position, own.orientation, time=placed.time)
            elif placed.lost:
                deck.shift_frame(-placed.lost)
            deck.move(own.position, own.orientation, time=placed.time, velocity=velocity, spin=spin)
        self._session.deck_times[name] = self._session.clock.steady()
        self._enter(name)

    def _enter(self, name: str) -> None:
        terrain = self._session.world.terrain
        if name not in terrain.decks:
            terrain.put(name, self.decks[name])


def _source(deck: str) -> str:
    """Return the name of a deck as a source of stamps."""
    return f"deck {deck!r}"
