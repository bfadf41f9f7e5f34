"""Guests: remote bodies, simulated by another node, that are near bodies of this world.

A guest is a dynamic body with a patch of its own, and follows its owner: each received state is extrapolated to the
current time and set. States arrive late, however. While a guest touches another body, and until its owner's states can
include the result, this world's physics is kept. Both worlds compute the same impact from the same approach, so both
results are right, and states from before the impact would undo it. In a lasting contact the guest converges to its
owner's state by a share in every step, so that both worlds agree where things are pushed and piled.
"""

from __future__ import annotations

import math

import numpy as np
import pybullet as pb

from smartmesh_ros.core import CORE
from smartmesh_ros.errors import InputError
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.world.guest_owner import Guest, GuestOwner, Received
from smartmesh_ros.world.population import Population
from smartmesh_ros.world.settings import GuestConfig
from smartmesh_ros.world.state_table import StateTable, require_valid

# Indices into a contact point of PyBullet: the other body, and the normal force.
_OTHER, _FORCE = 2, 9
# Largest difference of equal times, due to rounding [s].
INSTANT = 1e-9


class Guests:
    """The guests (remote bodies) of one world, which calls `advance` before each step and `note_contacts` after it."""

    def __init__(self, world: Population, config: GuestConfig) -> None:
        self.config = config
        self._world = world
        self._owners: dict[str, GuestOwner] = {}

    @property
    def counts(self) -> dict[str, tuple[int, int, float]]:
        """By owner: number of its bodies, number of guests among them, and delay of its states [s]."""
        return {name: (len(known.names), len(known.guests), known.delay) for name, known in self._owners.items()}

    def owner_of(self, name: str) -> str:
        """Return the other world that simulates a body, empty if no known one does."""
        return next((owner for owner, known in self._owners.items() if name in known.names), "")

    def take(self, owner: str, states: StateTable, time: float) -> list[InputError]:
        """Receive the states of all bodies of an owner at ``time`` [s].

        Raises `InputError` if a state is impossible. Returns an error for each body whose name another world uses as
        well; these bodies are ignored.
        """
        require_valid(states)
        known = self._owners.setdefault(owner, GuestOwner())
        dt = self._world.dt
        time = self._world.time + known.to_own_steps((time - self._world.time) / dt, self.config) * dt
        delay = max(self._world.time - time, 0.0)
        known.delay = max(delay, known.delay + self.config.forget * (delay - known.delay))
        same = states.names == known.listed
        known.pending.append(Received(states, time))
        if same and not known.shared:
            return []
        known.listed, known.names = states.names, frozenset(states.names)
        return self._share(owner, known)

    def forget(self, owner: str) -> None:
        """Remove the guests of an owner and its states."""
        known = self._owners.get(owner)
        if known is not None:
            self._remove(known, list(known.guests))
            del self._owners[owner]

    def clear(self) -> None:
        """Forget all owners."""
        for owner in list(self._owners):
            self.forget(owner)

    def dropped(self, name: str) -> None:
        """Note that the world removed a guest by itself."""
        for known in self._owners.values():
            known.guests.pop(name, None)

    def advance(self) -> None:
        """Add, remove and move guests before a step."""
        if not self._owners:
            return
        latest = self._world.time - self.config.steps_apart * self._world.dt
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
        """Note which guests touched another body in the last step."""
        guests = {guest.uid: guest for known in self._owners.values() for guest in known.guests.values()}
        if not guests:
            return
        world, client = self._world, self._world.client._client
        near = CORE.may_touch(world.ground.contacts.core.bodies(), world.dt, self.config.touching)
        for slot in np.flatnonzero(near).tolist():
            uid = world.followers[slot].body
            points = pb.getContactPoints(uid, physicsClientId=client)
            if any(point[_FORCE] > 0.0 and self._moves(point[_OTHER]) for point in points):
                first, _ = guests[uid].touched or (world.time, 0.0)
                guests[uid].touched = first, world.time

    def _moves(self, body: int) -> bool:
        """Return True if a PyBullet body is attached and moves by physics."""
        followers = self._world.followers
        return any(followers[slot].solid for slot in followers.of(body))

    def _share(self, owner: str, known: GuestOwner) -> list[InputError]:
        """Find the bodies whose names are also used by other worlds or by this one; returns an error for each new
        one."""
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

    def _use(self, known: GuestOwner, newest: Received) -> None:
        """Use newer states; guests that are missing from them, or whose shape or mass changed, are removed."""
        states, before = newest.states, known.now
        if before is not None and not states.same_bodies(before.states):
            rows = {name: row for row, name in enumerate(states.names)}
            kept = {
                name
                for name, guest in known.guests.items()
                if name in rows and states.same_body(rows[name], before.states, guest.row)
            }
            self._remove(known, [name for name in known.guests if name not in kept])
            for name, guest in known.guests.items():
                guest.row = rows[name]
        known.now, known.new = newest, True

    def _add_and_remove(self, owner: str, known: GuestOwner, now: Received) -> None:
        """Add guests for bodies that come near, and remove guests that are far away."""
        world, states = self._world, now.states
        margins = np.full(len(states.names), self.config.margin)
        margins[[guest.row for guest in known.guests.values()]] *= self.config.stay
        remote, attached = (states.numbers, states.radii, margins), world.ground.contacts.core.bodies()
        near = CORE.near_any(remote, self._age(now), attached, self.config.horizon)
        going = [name for name, guest in known.guests.items() if not near[guest.row] or name in known.shared]
        # A body that has just changed its owner may still be here as a guest of the previous owner, or as an own body.
        coming = [
            (row, name)
            for row in np.flatnonzero(near).tolist()
            if (name := states.names[row]) not in world.bodies and name not in known.shared
        ]
        if not going and not coming:
            return
        self._remove(known, going)
        for row, name in coming:
            uid = world.add_guest(name, owner, states.shape(row), float(states.masses[row]))
            known.guests[name] = Guest(row, uid)
        known.new = True

    def _remove(self, known: GuestOwner, names: list[str]) -> None:
        for name in names:
            self._world.remove_guest(name)
            known.guests.pop(name, None)

    def _follow(self, known: GuestOwner, now: Received) -> None:
        """Set guests to their owner's states if there are new ones; in a lasting contact blend them instead; otherwise
        do nothing."""
        world = self._world
        hold = known.delay + self.config.steps_apart * world.dt
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
            share = 1.0 - math.exp(-world.dt / max(self.config.settle, known.delay))
            slots = np.array([world.followers.of(guest.uid)[0] for guest in drawing])
            states = world.ground.contacts.states_of(slots)
            self._put(drawing, CORE.blended(states, self._extrapolated(now, drawing), share))

    def _age(self, received: Received) -> float:
        return min(self._world.time - received.time, self.config.max_extrapolation)

    def _extrapolated(self, now: Received, guests: list[Guest]) -> FloatArray:
        """Return the owners' states of guests, extrapolated to the current time (n, 13)."""
        moved: FloatArray = CORE.extrapolated(now.states.numbers[[guest.row for guest in guests]], self._age(now))
        return moved

    def _put(self, guests: list[Guest], numbers: FloatArray) -> None:
        """Set guests to states (n, 13)."""
        client = self._world.client._client
        self._world.ground.note_remote_states([guest.uid for guest in guests], numbers)
        for guest, row in zip(guests, numbers.tolist(), strict=True):
            pb.resetBasePositionAndOrientation(guest.uid, row[:3], row[3:7], client)
            pb.resetBaseVelocity(guest.uid, row[7:10], row[10:], client)
