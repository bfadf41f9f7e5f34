"""The pool of colliders: allocates them to followers, parks those not in use, and removes what is parked for long."""

from __future__ import annotations

import math
from collections import defaultdict
from dataclasses import dataclass
from typing import Any

import numpy as np
import pybullet as pb

from smartmesh_ros.patches.slot_rows import with_rows
from smartmesh_ros.physics.colliders.field import FieldMemory
from smartmesh_ros.physics.colliders.kinds import KINDS, Key, Kind
from smartmesh_ros.physics.colliders.pairs import Pairs
from smartmesh_ros.physics.colliders.table import COLLIDER, COLLIDERS, VELOCITIES
from smartmesh_ros.physics.followers import Follower

# Parking place of unused colliders [m]: far below the terrain, and apart from one another.
PARK_DEPTH, PARK_STEP = -1.0e5, 1.0e3
LARGEST_FIELD = 4096  # upper bound on the samples of a field
UPRIGHT = (0.0, 0.0, 0.0, 1.0)
STILL = (0.0, 0.0, 0.0)


@dataclass(eq=False)
class Collider:
    """A collider: its ``key``, PyBullet's ``shape``, and the index of its ``first`` height in the `FieldMemory`.
    ``uid``: its PyBullet body, None while it has none. ``unused_since`` [s]: when it was last parked."""

    key: Key
    shape: int
    first: int
    uid: int | None = None
    unused_since: float = 0.0


class ColliderPool:
    """Boxes and fields, by their place in the pool. Followers are addressed by slot.

    PyBullet leaks when shapes are created and removed, so shapes are never removed: a collider that its follower no
    longer needs waits, parked, for the next follower. A parked body costs PyBullet 0.4 to 2.4 us in each step, so
    `trim` removes the bodies of all but a few; creating one again takes 75 us. A follower keeps a collider of each kind
    for a while, because changing which pairs may touch costs more than moving a collider away and back.

    ``table``: records of ``COLLIDER`` by place. ``held`` (S, kinds): places of the colliders that followers hold, -1 =
    none; ``active`` (S,): the one in use.
    """

    def __init__(self, client: Any, pairs: Pairs) -> None:
        self._client = client
        self._client_id: int = getattr(client, "_client", 0)
        self._pairs = pairs
        self._visual: int | None = None
        self._shapes: dict[Key, int] = {}  # shared shapes
        self._free: dict[tuple[Kind, Key], list[int]] = defaultdict(list)
        self._trimmed = -math.inf  # time of the last trim [s]
        self.colliders: list[Collider] = []
        self.table = np.zeros(0, COLLIDER)
        self.memory = FieldMemory(np.empty(0), np.empty(0), np.empty(LARGEST_FIELD))
        self.held = np.empty((0, len(KINDS)), np.int64)
        self.active = np.empty(0, np.int64)

    def reserve(self, slots: int) -> None:
        """Make room for followers in ``slots`` slots."""
        self.held, self.active = with_rows(self.held, slots, -1), with_rows(self.active, slots, -1)

    def uid(self, place: int) -> int:
        """Return the PyBullet body of a collider that a follower holds."""
        uid = self.colliders[place].uid
        assert uid is not None
        return uid

    def renew(self, slots: list[int]) -> None:
        """Place the colliders of followers anew at the next update, dropping their cached contacts."""
        places = self.held[slots].ravel()
        places = places[places >= 0]
        self.table["there"][places] = self.table["turned"][places] = 0

    def fit(self, follower: Follower, kind: Kind, support: Any, resolution: float, time: float) -> None:
        """Give a follower a collider of the size that its support needs."""
        key = KINDS[kind].key_of(support, follower.radius, resolution, round_=follower.round)
        self._give_back(follower, kind, time)
        free = self._free[kind, key]
        place = free.pop() if free else self._new(kind, key)
        collider, record = self.colliders[place], self.table[place]
        if collider.uid is None:
            collider.uid = self._create_body(place, collider.shape)
        record["there"], record["turned"], record["time"] = 0, 0, time
        self._pairs.join(collider.uid, follower.body, follower.link)
        self.held[follower.slot, kind] = place

    def release(self, follower: Follower, time: float) -> None:
        """Return all colliders of a follower to the pool."""
        for kind in Kind:
            self._give_back(follower, kind, time)

    def put_away(self, follower: Follower, time: float) -> None:
        """Park the collider that a follower uses."""
        place = int(self.active[follower.slot])
        collider, record = self.colliders[place], self.table[place]
        pb.resetBasePositionAndOrientation(self.uid(place), park(place), UPRIGHT, self._client_id)
        pb.resetBaseVelocity(self.uid(place), STILL, STILL, self._client_id)
        record["there"] = 0
        for name in VELOCITIES:
            record[name] = 0.0
        collider.unused_since = time
        self.active[follower.slot] = -1
        follower.collider = None

    def activate(self, follower: Follower, place: int) -> None:
        """Note which of its colliders a follower uses from now on."""
        self.active[follower.slot] = place
        follower.collider = self.uid(place)

    def trim(self, followers: Any, time: float) -> None:
        """Return colliders that their followers have not used for `ColliderConfig.keep` to the pool, and remove the
        bodies of those in the pool beyond the share `ColliderConfig.spare` of those in use."""
        if 0.0 <= time - self._trimmed < COLLIDERS.keep:
            return
        self._trimmed = time
        unused = (self.held >= 0) & (self.held != self.active[:, None])
        for slot, kind in np.argwhere(unused).tolist():
            if not 0.0 <= time - self.colliders[self.held[slot, kind]].unused_since < COLLIDERS.keep:
                self._give_back(followers[slot], Kind(kind), time)
        spare = [place for free in self._free.values() for place in free if self.colliders[place].uid is not None]
        excess = len(spare) - math.ceil(COLLIDERS.spare * np.count_nonzero(self.active >= 0))
        for place in sorted(spare, key=lambda place: self.colliders[place].unused_since)[: max(excess, 0)]:
            self._remove_body(self.colliders[place])

    def _new(self, kind: Kind, key: Key) -> int:
        """Create a collider, still without a body, and return its place."""
        functions, place = KINDS[kind], len(self.colliders)
        if functions.shared:
            if key not in self._shapes:
                self._shapes[key] = functions.make(self._client, key)
            shape = self._shapes[key]
        else:
            shape = functions.make(self._client, key)
        first = len(self.memory.heights)
        self.colliders.append(Collider(key, shape, first))
        self.table = with_rows(self.table, place + 1, np.zeros(1, COLLIDER)[0])
        record = self.table[place]
        functions.describe(record, key)
        record["first"] = first
        unknown = np.full(int(record["rows"] * record["columns"]), np.nan)
        heights, at_contact = (np.concatenate([known, unknown]) for known in self.memory[:2])
        self.memory = self.memory._replace(heights=heights, at_contact=at_contact)
        return place

    def _create_body(self, place: int, shape: int) -> int:
        """Create the PyBullet body of a collider. It is a multibody, because contacts ignore the velocity of a fixed
        rigid body."""
        if self._visual is None:
            # Without a visual shape PyBullet creates one of a whole field, which takes a few MiB.
            self._visual = self._client.createVisualShape(pb.GEOM_BOX, halfExtents=[1e-3] * 3)
        uid = int(self._client.createMultiBody(0.0, shape, self._visual, basePosition=park(place)))
        # PyBullet multiplies the coefficients of the two bodies, so 1 leaves the body's own coefficients in effect.
        self._client.changeDynamics(uid, -1, lateralFriction=1.0, restitution=1.0)
        self._pairs.claim(uid)
        return uid

    def _remove_body(self, collider: Collider) -> None:
        """Remove the PyBullet body of a parked collider; its shape stays."""
        assert collider.uid is not None
        self._pairs.retire(collider.uid)
        self._client.removeBody(collider.uid)
        collider.uid = None

    def _give_back(self, follower: Follower, kind: Kind, time: float) -> None:
        """Return a collider that a follower no longer needs to the pool."""
        place = int(self.held[follower.slot, kind])
        if place < 0:
            return
        if self.active[follower.slot] == place:
            self.put_away(follower, time)
        self.held[follower.slot, kind] = -1
        collider = self.colliders[place]
        self._pairs.part(self.uid(place), follower.body, follower.link)
        self._free[kind, collider.key].append(place)


def park(place: int) -> tuple[float, float, float]:
    """Parking place of a collider [m]."""
    return place * PARK_STEP, 0.0, PARK_DEPTH
