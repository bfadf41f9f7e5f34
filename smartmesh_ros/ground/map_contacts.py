"""Contacts straight from the map, in PyBullet clients whose server runs in this process.

Each attached body or link has a ground proxy: a PyBullet body that stands for the ground near it. The C++ core, loaded
into PyBullet as a plugin, works out the contacts of the two from height maps and meshes, in each ``stepSimulation``.
Nothing here runs in a step.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple, Protocol

import numpy as np
import pybullet as pb

from smartmesh_ros.core import CORE
from smartmesh_ros.errors import InputError
from smartmesh_ros.ground.bullet import undone
from smartmesh_ros.ground.config import SleepConfig, require_time_step
from smartmesh_ros.ground.followers import Follower, Followers
from smartmesh_ros.ground.layout_probe import misread, number_of
from smartmesh_ros.ground.shown_ground import FAR_AWAY, ShownGround
from smartmesh_ros.ground.state import BODY_COLUMNS, Vector
from smartmesh_ros.terrain.grid import FloatArray, IntArray
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.terrain import Terrain


class SteppedSoil(Protocol):
    """Soil that takes part in the steps of a ground, such as `Soil`."""

    core: Any  # of the C++ core

    @property
    def map(self) -> HeightMap:
        """The tile that gives way."""

    def take_kinds(self) -> None:
        """Take which soil each sample of the map is."""

    def show(self) -> int:
        """Write what was pressed into the map; returns the number of changed samples."""

    def state(self) -> dict[str, Any]:
        """Return all that it goes on from beside its map."""

    def become(self, terrain: Terrain, state: dict[str, Any], tile: str) -> None:
        """Be the soil of such a state on a tile; raises `InputError` and changes nothing if it is none."""


class SoilSupport(NamedTuple):
    """How the soil bears a body or link: the deepest ``sinkage`` [m], pressed ``area`` [m^2], and the force that its
    pressures have ``carried`` [N], without damping."""

    sinkage: float
    area: float
    carried: float


# Kinds of clients whose server runs in another process, whose memory the core does not see.
ELSEWHERE = (pb.SHARED_MEMORY, pb.UDP, pb.TCP)


def missing_for(client: Any) -> str:
    """Return why a client cannot have ground proxies, empty if it can."""
    if wrong := misread():
        return f"the core was built for another PyBullet: the two differ in {wrong}"
    if client.getConnectionInfo().get("connectionMethod") in ELSEWHERE:
        return "the server of this PyBullet client runs in another process; connect with pybullet.DIRECT or GUI"
    if number_of(client) < 0:
        return f"this PyBullet does not load the core {CORE.__file__}"
    return ""


def ground_in(client: Any) -> Any:
    """Return the core's ground in a client; raises `InputError` if there can be none, or the client has one already."""
    if why := missing_for(client):
        raise InputError("client", f"bodies cannot stand on the ground: {why}")
    try:
        return CORE.Ground(number_of(client))
    except RuntimeError as error:
        raise InputError("client", str(error)) from None


class MapContacts:
    """Contacts of the followers in one client with the map. Bodies are addressed by slot."""

    def __init__(self, client: Any, followers: Followers, terrain: Terrain) -> None:
        self._client = client
        self._followers = followers
        self._terrain = terrain
        self._core = ground_in(client)
        self._core.set_tiles(terrain.core)
        self._uids: dict[int, int] = {}  # of the proxies, by slot
        self._proxies: set[int] = set()  # the same numbers
        self._shape: int | None = None
        self._visual: int | None = None

    def attach(self, follower: Follower) -> None:
        """Give a follower a proxy if it is solid; other followers are only read."""
        proxy = self._new_body() if follower.solid else -1
        try:
            self._core.attach(follower.slot, follower.body, follower.link, proxy, follower.shape)
        except ValueError as error:
            if follower.solid:
                self._client.removeBody(proxy)
            raise InputError("geometry", f"body {follower.body} cannot stand on the ground: {error}") from None
        if follower.solid:
            self._uids[follower.slot] = follower.collider = proxy
            self._proxies.add(proxy)
        self.note_kind(follower.slot)
        if follower.belt.speed:
            self.drive(follower)

    def detach(self, slots: list[int]) -> None:
        """Remove the proxies of followers: all, or none if PyBullet fails."""
        gone: list[int] = []
        with undone(lambda: self._attach_again(gone)):
            for slot in slots:
                if self._core.is_there:
                    if slot in self._uids:
                        self._client.removeBody(self._uids[slot])
                    self._core.detach(slot)
                self._proxies.discard(self._uids.pop(slot, -1))
                self._followers[slot].collider = None
                gone.append(slot)

    def note_kind(self, slot: int) -> None:
        """Tell the core who moves a follower."""
        it = self._followers.table[slot]
        self._core.set_kind(slot, bool(it["solid"]), bool(it["own"]), bool(it["remote"]))

    def begin(self, time: float, dt: float) -> bool:
        """Set the time [s] at the start of the next step of ``dt`` [s]; returns True if bodies were removed from
        PyBullet. Raises `InputError` if the client was reset or closed, or does not step ``dt``, and PyBullet's error
        if a step failed in the core."""
        if self._core.begin(time, dt):
            return False
        self.require_client()
        require_time_step(self._client, dt)
        self._core.time, self._core.duration = time, dt
        return bool(self._core.find_gone())

    def update(self) -> None:
        """Do before a step what each step does at its start."""
        self._core.update()

    @property
    def rescues(self) -> int:
        """How often bodies were put back onto the ground."""
        return int(self._core.rescues)

    def find_below(self) -> list[int]:
        """Return the slots of those bodies whose middle is below the ground, of those that are put back onto it."""
        found: list[int] = self._core.find_below()
        return found

    def find_nowhere(self, farthest: float) -> list[int]:
        """Return the slots of those awake bodies that are at no place or farther away than ``farthest`` [m]."""
        found: list[int] = self._core.find_nowhere(farthest)
        return found

    def check_falls(self, time: float, depth: float) -> tuple[list[int], list[int]]:
        """Look whether there is ground over or under the awake bodies of this world's own at ``time`` [s]; returns the
        slots of those that began to fall, and of those that are ``depth`` [m] below the ground that they left. Of a
        robot, its first attached link counts."""
        begun, lost = self._core.check_falls(time, depth)
        return begun, lost

    def falling(self) -> list[int]:
        """Return the slots of the bodies that fall."""
        found: list[int] = self._core.find_falling()
        return found

    def last_ground(self, slot: int) -> Vector:
        """Return the place [m] where a follower left the ground, or where it was first looked at."""
        x, y, z = self._core.last_ground(slot)
        return x, y, z

    def let_sleep(self, config: SleepConfig | None) -> None:
        """Wake all bodies; let those that are still sleep from now on, None = none."""
        self.require_client()
        it = config or SleepConfig(after=math.inf)
        self._core.set_sleep(it.after, it.distance, it.joint, it.ground, it.noise, it.most)

    def wake(self, slots: list[int] | None) -> None:
        """Wake followers, None = all. What touches them wakes in the next step."""
        if not self._core.is_there:
            return
        if slots is None:
            self._core.wake_all()
        for slot in slots or ():
            self._core.wake(slot)

    def find_gone(self) -> list[int]:
        """Return the slots whose bodies were removed from PyBullet."""
        gone: list[int] = self._core.find_gone()
        return gone

    def is_asleep(self, slot: int) -> bool:
        """Return True if a follower sleeps."""
        return bool(self._core.is_asleep(slot))

    def asleep(self) -> list[int]:
        """Return the slots of the sleeping followers."""
        found: list[int] = self._core.find_asleep()
        return found

    def deepest_contact(self, slot: int) -> tuple[Vector, Vector, float] | None:
        """Return the point on the ground [m], the normal and the depth [m] of the deepest contact of a follower now,
        also of one that physics does not move; None if it touches none."""
        found: tuple[Vector, Vector, float] | None = self._core.deepest_contact(slot)
        return found

    def drive(self, follower: Follower) -> None:
        """Move the surface of a follower by its belt."""
        self._core.drive(follower.slot, follower.belt.axis, follower.belt.speed)

    def shown(self, rate: float) -> ShownGround:
        """Return the ground as PyBullet draws it and its rays meet it, not drawn yet."""
        return ShownGround(self._client, self._core, self._terrain, rate)

    def set_soil(self, soil: Any) -> None:
        """Take contacts from a core's soil where its map is; None = from the map itself."""
        self.require_client()
        self._core.set_soil(soil)

    def on_soil(self, slot: int) -> FloatArray:
        """Return sinkage [m], area [m^2] and carried force [N] of each part of a follower on the soil (n, 3)."""
        return np.asarray(self._core.on_soil(slot))

    def memory(self, slots: list[int]) -> dict[str, Any]:
        """Return what is known of the past of followers beside their contacts: for how long they were still and where,
        and their parts on the soil."""
        table = self._core.memory_of(np.array(slots, np.int64))
        return {"slots": table, "parts": [self._core.parts_memory(slot) for slot in slots]}

    def recall(self, slots: list[int], memory: dict[str, Any]) -> None:
        """Take over what `memory` returned, in the same order. Raises `InputError` if it is none of these followers."""
        try:
            self._core.recall(np.array(slots, np.int64), memory["slots"])
            for slot, parts in zip(slots, memory["parts"], strict=True):
                self._core.recall_parts(slot, parts)
        except (TypeError, ValueError) as error:
            raise InputError("state", f"a saved state is none of these bodies: {error}") from None

    def forget(self) -> None:
        """Forget the past of all bodies: contacts, their impulses and order, rest. Poses and velocities stay."""
        self.require_client()
        self._core.take_restored()
        self._core.forget()

    @property
    def time(self) -> float:
        """Time at the start of the next step [s]."""
        return float(self._core.time)

    @time.setter
    def time(self, time: float) -> None:
        self._core.time = time

    def require_client(self) -> None:
        """Raise `InputError` if the client was reset or closed, and PyBullet's error if a step failed in the core."""
        if not self._core.is_there:
            raise InputError("client", "the PyBullet client was reset or closed: close this ground, and make another")
        if fault := self._core.take_fault():
            raise pb.error(f"in a step of PyBullet a body had no contacts with the ground: {fault}")

    def is_ground(self, body: int) -> bool:
        """Return True if a PyBullet body is a proxy."""
        return body in self._proxies

    def states_of(self, slots: IntArray) -> FloatArray:
        """Return the states (n, 13) of followers, asleep or not, as they are now; NaN for bodies that are gone."""
        states = np.empty((self._followers.capacity, BODY_COLUMNS))
        self._core.read(slots, states)
        return np.asarray(states[slots])

    def close(self) -> None:
        """Remove all proxies."""
        self.detach(list(self._uids))
        self._core.release()

    def _attach_again(self, slots: list[int]) -> None:
        for slot in slots:
            self.attach(self._followers[slot])

    def _new_body(self) -> int:
        """Create the PyBullet body of a proxy, whose shape the core replaces."""
        client = self._client
        if self._shape is None or self._visual is None:
            self._shape = client.createCollisionShape(pb.GEOM_SPHERE, radius=1e-3)
            self._visual = client.createVisualShape(pb.GEOM_BOX, halfExtents=[0.0] * 3)  # so that no picture has it
        uid = int(client.createMultiBody(0.0, self._shape, self._visual, FAR_AWAY, useMaximalCoordinates=1))
        # PyBullet multiplies the coefficients of the two bodies, so 1 leaves the body's own coefficients in effect.
        with undone(lambda: client.removeBody(uid)):
            client.changeDynamics(uid, -1, lateralFriction=1.0, restitution=1.0)
        return uid
