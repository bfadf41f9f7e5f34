"""Guests: bodies that other worlds simulate, as far as they are near bodies of this one.

A guest is a dynamic body with a patch of its own. It follows its owner: whenever a state comes, the guest is set to it,
moved on by its velocity to now. But states are late. While a guest touches another body, and until its owner can have
said what came of it, this world's physics stands: both worlds find the same impact from the same approach, so both
are right about it at once, and states from before it would undo it. Where a contact lasts, the guest is drawn to
the state of its owner by a share a step, so that both worlds agree on where things are pushed and piled.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pybullet as pb

from smartmesh_ros.errors import InputError
from smartmesh_ros.physics.bullet import BulletCalls
from smartmesh_ros.physics.guest_config import GuestConfig
from smartmesh_ros.physics.state_table import StateTable, blended, extrapolated, may_touch, near_any, require_valid
from smartmesh_ros.terrain.grid import BoolArray, FloatArray

if TYPE_CHECKING:
    from smartmesh_ros.physics.world import World

# Of a contact as PyBullet tells it: the other body, and the normal force.
_OTHER, _FORCE = 2, 9
# States that wait until they are old enough: a world that is behind by a quarter of a second has as many at 240 Hz.
MOST_PENDING = 64
# Times that differ by rounding only are equal [s].
INSTANT = 1e-9
NOBODY = np.zeros(0, bool)


@dataclass(eq=False)
class Guest:
    """A body of another world in this one. ``touched``: when it first and last touched another body since its owner's
    states were taken as they are [s], None = it has not."""

    row: int  # in its owner's states
    uid: int
    touched: tuple[float, float] | None = None


class _Received(NamedTuple):
    """States of all bodies of an owner, and the time that they hold for [s]."""

    states: StateTable
    time: float


@dataclass(eq=False)
class _Owner:
    """Another world: what it ``pending`` and is too young to be used, and what is used ``now``, None before the first;
    whether its ``guests`` have not been set to that yet; how ``delay`` it comes [s]; the names of its bodies, those
    ``shared`` with others, and by the rows of ``now`` which may not be guests for that. ``phase``: by how much its
    steps come after this world's, in steps, None before the first."""

    pending: deque[_Received] = field(default_factory=lambda: deque(maxlen=MOST_PENDING))
    now: _Received | None = None
    new: bool = False
    delay: float = 0.0
    guests: dict[str, Guest] = field(default_factory=dict)
    names: frozenset[str] = frozenset()
    shared: frozenset[str] = frozenset()
    barred: BoolArray = field(default_factory=lambda: np.zeros(0, bool))
    phase: float | None = None

    def to_own_steps(self, steps: float, config: GuestConfig) -> int:
        """The whole number of this world's steps that stands for a time of so many ``steps`` of the owner's."""
        if self.phase is None:
            self.phase = steps - round(steps)
        whole = round(steps - self.phase)
        self.phase += config.drift * (steps - whole - self.phase)
        if abs(self.phase) > config.slip:
            self.phase -= math.copysign(1.0, self.phase)
        return whole


class Guests:
    """The guests of one `World`, which calls `advance` before each step and `note_contacts` after it."""

    def __init__(self, world: World, config: GuestConfig) -> None:
        self.config = config
        self._world = world
        self._calls = BulletCalls(world.client)
        self._owners: dict[str, _Owner] = {}

    @property
    def counts(self) -> dict[str, tuple[int, int, float]]:
        """By owner: its bodies, how many are guests, and how late its states come [s]."""
        return {name: (len(known.names), len(known.guests), known.delay) for name, known in self._owners.items()}

    def owner_of(self, name: str) -> str:
        """The other world that simulates a body, empty if none that is known does."""
        return next((owner for owner, known in self._owners.items() if name in known.names), "")

    def take(self, owner: str, states: StateTable, time: float) -> list[InputError]:
        """Takes the states that all bodies of an owner have at ``time`` [s]. Raises `InputError` if one is impossible;
        returns the objections to bodies whose name is another's, which are left out."""
        require_valid(states)
        known = self._owners.setdefault(owner, _Owner())
        dt = self._world.config.physics.dt
        time = self._world.time + known.to_own_steps((time - self._world.time) / dt, self.config) * dt
        delay = max(self._world.time - time, 0.0)
        known.delay = max(delay, known.delay + self.config.forget * (delay - known.delay))
        same = bool(known.pending) and states.names is known.pending[-1].states.names
        known.pending.append(_Received(states, time))
        if same and not known.shared:
            return []
        known.names = frozenset(states.names)
        return self._share(owner, known)

    def forget(self, owner: str) -> None:
        """Takes the guests of an owner away, and what is known of it."""
        known = self._owners.pop(owner, None)
        if known is not None and known.guests:
            with self._world.together():
                for name in known.guests:
                    self._world.remove_guest(name)

    def clear(self) -> None:
        """Forgets all owners."""
        for owner in list(self._owners):
            self.forget(owner)

    def dropped(self, name: str) -> None:
        """Says that the world took a guest out by itself."""
        for known in self._owners.values():
            known.guests.pop(name, None)

    def advance(self) -> None:
        """Brings guests to where they are now, before a step."""
        latest = self._world.time - self.config.steps_apart * self._world.config.physics.dt
        for owner, known in self._owners.items():
            newest = None
            while known.pending and known.pending[0].time <= latest + INSTANT:
                newest = known.pending.popleft()
            if newest is not None:
                self._use(known, newest)
            if known.now is not None:
                self._add_and_remove(owner, known, known.now)
                self._follow(known, known.now)

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

    def _share(self, owner: str, known: _Owner) -> list[InputError]:
        """Finds the bodies whose names are also those of other worlds' bodies, or of this world's; objections to those
        that were not known yet."""
        rivals: dict[str, list[str]] = {}
        for other, of in self._owners.items():
            common = known.names & of.names if other != owner else frozenset()
            for name in common:
                rivals.setdefault(name, []).append(other)
            of.shared |= common
        for name, body in self._world.bodies.items():
            if name in known.names and not body.owner:
                rivals.setdefault(name, []).append("this node")
        before, known.shared = known.shared, frozenset(rivals)
        return [
            InputError(
                "two_owners",
                f"{name!r} is simulated by {' and by '.join([owner, *rivals[name]])}; remove it from all but one",
            )
            for name in sorted(known.shared - before)
        ]

    def _use(self, known: _Owner, newest: _Received) -> None:
        """Has guests follow newer states; those that are not among them any more as what they were are taken away."""
        states, before = newest.states, known.now
        known.now, known.new = newest, True
        if before is None or not states.same_bodies(before.states):
            rows = {name: row for row, name in enumerate(states.names)}
            with self._world.together():
                for name, guest in list(known.guests.items()):
                    row = rows.get(name)
                    assert before is not None
                    if row is None or not states.same_body(row, before.states, guest.row):
                        del known.guests[name]
                        self._world.remove_guest(name)
                    else:
                        guest.row = row
        known.barred = np.array([name in known.shared for name in states.names], bool) if known.shared else NOBODY

    def _add_and_remove(self, owner: str, known: _Owner, now: _Received) -> None:
        """Makes guests of the bodies that come near, and takes those away that go."""
        world, states, ground = self._world, now.states, self._world.ground
        margins = np.full(len(states.names), self.config.margin)
        margins[[guest.row for guest in known.guests.values()]] *= self.config.stay
        near = near_any(
            states.numbers, self._age(now), states.radii, ground.positions_w, ground.moved_w / world.config.physics.dt,
            ground.radii, world.followers.own, margins, self.config.horizon,
        )  # fmt: skip
        if known.barred.size:
            near &= ~known.barred
        if int(near.sum()) == len(known.guests) and all(near[guest.row] for guest in known.guests.values()):
            return
        going = [name for name, guest in known.guests.items() if not near[guest.row]]
        # A body that has just changed its owner may still be here as the guest of another, or as an own one.
        coming = [
            (row, name)
            for row in np.flatnonzero(near).tolist()
            if (name := states.names[row]) not in known.guests and name not in world.bodies
        ]
        if not going and not coming:
            return
        with world.together():
            for name in going:
                del known.guests[name]
                world.remove_guest(name)
            for row, name in coming:
                uid = world.add_guest(name, owner, states.shape(row), float(states.masses[row]))
                known.guests[name] = Guest(row, uid)
        known.new = True

    def _follow(self, known: _Owner, now: _Received) -> None:
        """Sets guests to their owner's states if there are new ones, or draws them there; or leaves them alone."""
        dt = self._world.config.physics.dt
        hold = known.delay + self.config.steps_apart * dt
        setting, drawing = [], []
        for guest in known.guests.values():
            if guest.touched is None:
                if known.new:
                    setting.append(guest)
                continue
            first, last = guest.touched
            if now.time >= last + hold:
                guest.touched = None
                setting.append(guest)
            elif now.time >= first + hold:
                drawing.append(guest)
        known.new = False
        if setting:
            self._put(setting, self._extrapolated(now, setting))
        if drawing:
            share = 1.0 - math.exp(-dt / max(self.config.settle, known.delay))
            states = self._calls.states([guest.uid for guest in drawing])
            self._put(drawing, blended(states, self._extrapolated(now, drawing), share))

    def _age(self, received: _Received) -> float:
        return min(self._world.time - received.time, self.config.max_extrapolation)

    def _extrapolated(self, now: _Received, guests: list[Guest]) -> FloatArray:
        """States of guests' owners, moved on to now (n, 13)."""
        return extrapolated(now.states.numbers[[guest.row for guest in guests]], self._age(now))

    def _put(self, guests: list[Guest], numbers: FloatArray) -> None:
        """Puts guests into states (n, 13)."""
        client = self._world.client._client
        for guest, row in zip(guests, numbers.tolist(), strict=True):
            pb.resetBasePositionAndOrientation(guest.uid, row[:3], row[3:7], client)
            pb.resetBaseVelocity(guest.uid, row[7:10], row[10:], client)
        self._world.note_guest_states([guest.uid for guest in guests], numbers)
