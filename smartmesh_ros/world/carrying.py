"""Decks that bodies of a world carry, by name."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from smartmesh_ros.errors import InputError
from smartmesh_ros.ground.ground import Ground
from smartmesh_ros.ground.quaternions import conjugate, product, rotate
from smartmesh_ros.ground.state import Quaternion, Vector
from smartmesh_ros.terrain.deck import Deck
from smartmesh_ros.terrain.terrain import Terrain
from smartmesh_ros.world.bodies import Body
from smartmesh_ros.world.link_frames import InertialFrame

LEVEL: Quaternion = (0.0, 0.0, 0.0, 1.0)


class Carrier(NamedTuple):
    """What carries a deck: a ``link`` of a ``body``, "" = its base, and the pose of the deck's frame in that of the
    link: position [m] and orientation (x, y, z, w)."""

    body: str
    link: str = ""
    position: Vector = (0.0, 0.0, 0.0)
    orientation: Quaternion = LEVEL


class Carrying:
    """What carries the decks of a world's terrain. ``carried``: by the names of the decks, which may come later, as the
    bodies may."""

    bodies: dict[str, Body]
    carried: dict[str, Carrier]
    client: Any
    ground: Ground
    say: Callable[[str], object]
    terrain: Terrain

    def carry(self, deck: str, carrier: Carrier | None) -> None:
        """Let a body carry a deck, whenever both are there; None = nobody, and the deck stays where it is. The body may
        be simulated or tracked; see `Ground.carry`. Raises `InputError` if the body has no such link."""
        if carrier is not None and carrier.body in self.bodies:
            _link_of(self.bodies[carrier.body], carrier.link)
        if deck in self.terrain.decks:
            self.ground.carry(deck, None)
        self.carried.pop(deck, None)
        if carrier is not None:
            self.carried[deck] = carrier
            self.bind_decks()

    def bind_decks(self) -> None:
        """Bind the decks to the bodies of these names that are there now. A body that has no such link carries nothing,
        and the user is told."""
        for name, carrier in list(self.carried.items()):
            deck, body = self.terrain.decks.get(name), self.bodies.get(carrier.body)
            if deck is None or (body is None and deck.body < 0):
                continue
            try:
                self._bind(name, deck, body, carrier)
            except InputError as error:
                self.say(f"nothing carries deck {name!r} any more: {error}")
                del self.carried[name]

    def _bind(self, name: str, deck: Deck, body: Body | None, carrier: Carrier) -> None:
        if body is None:
            self.ground.carry(name, None)
        elif body.uid != deck.body:
            link = _link_of(body, carrier.link)
            centre = body.inertial if link < 0 else InertialFrame(*self.client.getLinkState(body.uid, link)[2:4])
            back = conjugate(centre.orientation)
            arm = rotate(back, tuple(np.subtract(carrier.position, centre.position).tolist()))
            self.ground.carry(name, body.uid, link, arm, product(back, carrier.orientation))


def _link_of(body: Body, name: str) -> int:
    """Return PyBullet's index of a link; raises `InputError` if the body has none of that name."""
    if not name:
        return -1
    for index, link in body.links.items():
        if link == name:
            return index
    known = ", ".join(map(repr, body.links.values())) or "none"
    raise InputError("unknown_link", f"{body.name!r} has no link {name!r} that touches the ground; it has {known}")
