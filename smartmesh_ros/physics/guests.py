"""Guests: bodies that other worlds simulate, as far as they are near bodies of this one.

A guest is a dynamic body with a patch of its own. It follows its owner: whenever a state comes, the guest is set to it,
moved on by its velocity to now. But states are late. While a guest touches another body, and until its owner can have
said what came of it, this world's physics stands: both worlds find the same impact from the same approach, so both
are right about it at once, and states from before it would undo it. Where a contact lasts, the guest is drawn to
the state of its owner by a share a step, so that both worlds agree on where things are pushed and piled.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pybullet as pb

from smartmesh_ros.errors import InputError
from smartmesh_ros.physics.bullet import BulletCalls
from smartmesh_ros.physics.state_table import StateTable, drawn_to, may_touch, moved_on, near_any, require_sound
from smartmesh_ros.terrain.grid import BoolArray, FloatArray

if TYPE_CHECKING:
    from smartmesh_ros.physics.world import World

# Of a contact as PyBullet tells it: the other body, and the normal force.
_OTHER, _FORCE = 2, 9


@dataclass(frozen=True, kw_only=True)
class GuestConfig:
    """How guests come, follow and go.

    ``margin`` [m]: bodies of others that come so near to an own one, surface to surface, become guests; more than a
    body goes in the time that a state is late. ``stay``: they remain guests up to so many margins, so that none comes
    and goes at every step. ``apart``: worlds find the same contact up to so many steps apart. ``settle`` [s]: in
    lasting contact the distance to the owner's state shrinks to 1/e in this time, or in the time that its states are
    late if that is longer: what pulls faster than it is told swings. ``farthest`` [s]: a state is moved on no farther
    than this, since a velocity says nothing of what comes later. ``touching`` [m]: bodies are asked for contacts where
    the balls around them are so near, which PyBullet's own contacts reach. ``forget``: a delay that was longer is
    forgotten by this share at each state.
    """

    margin: float = 1.0
    stay: float = 1.5
    apart: int = 2
    settle: float = 0.03
    farthest: float = 0.2
    touching: float = 0.02
    forget: float = 0.05

    def __post_init__(self) -> None:
        if not (math.isfinite(self.margin) and self.margin > 0.0):
            raise InputError("parameter", f"the margin of guests is {self.margin} m; it must be greater than zero")


@dataclass(eq=False)
class Guest:
    """A body of another world in this one. ``touched``: when it first and last touched another body since its owner's
    states were taken as they are [s], None = it has not."""

    row: int  # in its owner's states
    uid: int
    touched: tuple[float, float] | None = None


@dataclass(eq=False)
class _Owner:
    """Another world: its last ``states``, the ``time`` they hold for [s], how ``late`` they come [s], whether they are
    ``new`` to its ``guests`` by name, the ``rows`` of its bodies by name, and which of them are ``barred`` from being
    guests, since others have bodies of those ``shared`` names too."""

    states: StateTable
    time: float
    late: float
    new: bool
    guests: dict[str, Guest]
    rows: dict[str, int]
    barred: BoolArray
    shared: set[str]


class Guests:
    """The guests of one `World`, which calls `come` before each step and `note_contacts` after it."""

    def __init__(self, world: World, config: GuestConfig) -> None:
        self.config = config
        self._world = world
        self._calls = BulletCalls(world.client)
        self._owners: dict[str, _Owner] = {}

    @property
    def counts(self) -> dict[str, tuple[int, int, float]]:
        """By owner: its bodies, how many are guests, and how late its states come [s]."""
        return {name: (len(o.states.names), len(o.guests), o.late) for name, o in self._owners.items()}

    def owner_of(self, name: str) -> str:
        """The other world that simulates a body, empty if none that is known does."""
        return next((owner for owner, known in self._owners.items() if name in known.rows), "")

    def take(self, owner: str, states: StateTable, time: float) -> list[InputError]:
        """Takes the states that all bodies of an owner have at ``time`` [s]. Raises `InputError` if one is impossible;
        returns the objections to bodies whose name is another's, which are left out."""
        require_sound(states)
        known = self._owners.get(owner)
        late = max(self._world.time - time, 0.0)
        if known is not None:
            late = max(late, known.late + self.config.forget * (late - known.late))
        if known is None or not states.same_bodies(known.states):
            self._dismiss_changed(known, states)
            rows = {name: row for row, name in enumerate(states.names)}
            guests, shared = ({}, set()) if known is None else (known.guests, known.shared)
            for name, guest in guests.items():
                guest.row = rows[name]
            barred = np.zeros(len(rows), bool)
            known = self._owners[owner] = _Owner(states, time, late, True, guests, rows, barred, shared)
            return self._bar(owner, known)
        known.states, known.time, known.late, known.new = states, time, late, True
        return self._bar(owner, known) if known.shared else []

    def forget(self, owner: str) -> None:
        """Takes the guests of an owner away, and what is known of it."""
        known = self._owners.pop(owner, None)
        if known is not None and known.guests:
            with self._world.together():
                for name in known.guests:
                    self._world.dismiss(name)

    def clear(self) -> None:
        """Forgets all owners."""
        for owner in list(self._owners):
            self.forget(owner)

    def dropped(self, name: str) -> None:
        """Says that the world took a guest out by itself."""
        for known in self._owners.values():
            known.guests.pop(name, None)

    def come(self) -> None:
        """Brings guests to where they are now, before a step."""
        for owner, known in self._owners.items():
            self._invite_and_dismiss(owner, known)
            if known.guests:
                self._follow(known)

    def note_contacts(self) -> None:
        """Notes which guests touched another body in the step that was made."""
        guests = {guest.uid: guest for known in self._owners.values() for guest in known.guests.values()}
        if not guests:
            return
        world, ground = self._world, self._world.ground
        index, positions = world.followers, ground.positions_w
        near = may_touch(
            positions, ground.moved_w, ground.radii, index.guest, index.own | index.guest, self.config.touching
        )
        client = world.client._client
        for follower in np.flatnonzero(near).tolist():
            uid = ground.followers[follower].body
            points = pb.getContactPoints(uid, physicsClientId=client)
            if any(point[_FORCE] > 0.0 and point[_OTHER] in index.moving for point in points):
                first, _ = guests[uid].touched or (world.time, 0.0)
                guests[uid].touched = first, world.time

    def _bar(self, owner: str, known: _Owner) -> list[InputError]:
        """Bars the bodies whose names are also those of other worlds' bodies, or of this world's."""
        rivals: dict[str, list[str]] = {}
        for name in known.states.names:
            body = self._world.bodies.get(name)
            others = ["this node"] if body is not None and not body.owner else []
            for other, of in self._owners.items():
                if other != owner and name in of.rows:
                    others.append(other)
                    of.barred[of.rows[name]] = True
                    of.shared.add(name)
            if others:
                rivals[name] = others
        known.barred[:] = [name in rivals for name in known.states.names]
        before, known.shared = known.shared, set(rivals)
        return [
            InputError(
                "two_owners",
                f"{name!r} is simulated by {' and by '.join([owner, *others])}; remove it from all but one of them",
            )
            for name, others in rivals.items()
            if name not in before
        ]

    def _dismiss_changed(self, known: _Owner | None, states: StateTable) -> None:
        """Takes away those guests that are not among the ``states`` any more as what they were."""
        if known is None or not known.guests:
            return
        rows = {name: row for row, name in enumerate(states.names)}
        old = known.states
        with self._world.together():
            for name, guest in list(known.guests.items()):
                row = rows.get(name)
                if row is None or not (
                    old.kinds[guest.row] == states.kinds[row]
                    and old.masses[guest.row] == states.masses[row]
                    and (old.dimensions[guest.row] == states.dimensions[row]).all()
                ):
                    del known.guests[name]
                    self._world.dismiss(name)

    def _invite_and_dismiss(self, owner: str, known: _Owner) -> None:
        """Makes guests of the bodies that come near, and takes those away that go."""
        world, states, ground = self._world, known.states, self._world.ground
        margins = np.full(len(states.names), self.config.margin)
        margins[[guest.row for guest in known.guests.values()]] *= self.config.stay
        near = near_any(
            states.numbers, self._age(known), states.radii, ground.positions_w, ground.radii, world.followers.own,
            margins,
        ) & ~known.barred  # fmt: skip
        if int(near.sum()) == len(known.guests) and all(near[guest.row] for guest in known.guests.values()):
            return
        with world.together():
            for name, guest in list(known.guests.items()):
                if not near[guest.row]:
                    del known.guests[name]
                    world.dismiss(name)
            for row in np.flatnonzero(near).tolist():
                name = states.names[row]
                if name not in known.guests:
                    uid = world.invite(name, owner, states.shape(row), float(states.masses[row]))
                    known.guests[name] = Guest(row, uid)
        known.new = True

    def _follow(self, known: _Owner) -> None:
        """Sets guests to their owner's states if there are new ones, or draws them there; or leaves them alone."""
        dt = self._world.config.physics.dt
        hold = known.late + self.config.apart * dt
        setting, drawing = [], []
        for guest in known.guests.values():
            if guest.touched is None:
                if known.new:
                    setting.append(guest)
                continue
            first, last = guest.touched
            if known.time >= last + hold:
                guest.touched = None
                setting.append(guest)
            elif known.time >= first + hold:
                drawing.append(guest)
        known.new = False
        if setting:
            self._put(setting, self._now(known, setting))
        if drawing:
            share = 1.0 - math.exp(-dt / max(self.config.settle, known.late))
            states = self._calls.states([guest.uid for guest in drawing])
            self._put(drawing, drawn_to(states, self._now(known, drawing), share))

    def _age(self, known: _Owner) -> float:
        return max(min(self._world.time - known.time, self.config.farthest), -self.config.farthest)

    def _now(self, known: _Owner, guests: list[Guest]) -> FloatArray:
        """States of guests' owners, moved on to now (n, 13)."""
        return moved_on(known.states.numbers[[guest.row for guest in guests]], self._age(known))

    def _put(self, guests: list[Guest], numbers: FloatArray) -> None:
        """Puts guests into states (n, 13)."""
        client = self._world.client._client
        for guest, row in zip(guests, numbers.tolist(), strict=True):
            pb.resetBasePositionAndOrientation(guest.uid, row[:3], row[3:7], client)
            pb.resetBaseVelocity(guest.uid, row[7:10], row[10:], client)
        self._world.put([guest.uid for guest in guests], numbers)
