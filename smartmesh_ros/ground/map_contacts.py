"""Contacts straight from the map, in PyBullet clients whose server runs in this process.

Each attached body or link has a ground proxy: a PyBullet body that stands for the ground near it. The C++ core, loaded
into PyBullet as a plugin, works out the contacts of the two from height maps and meshes, in each ``stepSimulation``.
Nothing here runs in a step.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import pybullet as pb

from smartmesh_ros.core import CORE
from smartmesh_ros.errors import InputError, as_float
from smartmesh_ros.ground.bullet import undone
from smartmesh_ros.ground.config import SleepConfig, require_time_step
from smartmesh_ros.ground.followers import Follower, Followers
from smartmesh_ros.ground.layout_probe import misread, number_of
from smartmesh_ros.ground.shown_ground import FAR_AWAY
from smartmesh_ros.terrain.grid import FloatArray, IntArray
from smartmesh_ros.terrain.terrain import Terrain


class SoilSupport(NamedTuple):
    """How the soil bears a body or link: the deepest ``sinkage`` [m], pressed ``area`` [m^2], and the force that its
    pressures have ``carried`` [N], without damping."""

    sinkage: float
    area: float
    carried: float


# Kinds of clients whose server runs in another process, whose memory the core does not see.
ELSEWHERE = (pb.SHARED_MEMORY, pb.UDP, pb.TCP)


def ground_in(client: Any) -> Any:
    """Return the core's ground in a client; raises `InputError` if there can be none, or the client has one already."""
    if wrong := misread():
        why = f"the core was built for another PyBullet: the two differ in {wrong}"
    elif client.getConnectionInfo().get("connectionMethod") in ELSEWHERE:
        why = "the server of this PyBullet client runs in another process; connect with pybullet.DIRECT or GUI"
    elif (number := number_of(client)) < 0:
        why = f"this PyBullet does not load the core {CORE.__file__}"
    else:
        return CORE.Ground(number)
    raise InputError("client", f"bodies cannot stand on the ground: {why}")


class MapContacts:
    """Contacts of the followers in one client with the map. Bodies are addressed by slot. ``core``: the core's ground
    in the client."""

    def __init__(self, client: Any, followers: Followers, terrain: Terrain) -> None:
        self._client = client
        self._followers = followers
        self.core = ground_in(client)
        self.core.set_tiles(terrain.core)
        self._shape: int | None = None
        self._visual: int | None = None

    def attach(self, follower: Follower) -> None:
        """Give a follower a proxy if it is solid; other followers are only read."""
        proxy = self._new_body() if follower.solid else -1
        try:
            self.core.attach(follower.slot, follower.body, follower.link, proxy, follower.shape)
        except ValueError as error:
            if follower.solid:
                self._client.removeBody(proxy)
            raise InputError("geometry", f"body {follower.body} cannot stand on the ground: {error}") from None
        if follower.solid:
            follower.collider = proxy
        self.note_kind(follower)
        if follower.belt.speed:
            self.drive(follower)

    def detach(self, slots: list[int]) -> None:
        """Remove the proxies of followers: all, or none if PyBullet fails."""
        with undone(lambda: self.attach_again(slots)):
            for slot in slots:
                follower = self._followers[slot]
                self.remove_proxy(follower)
                if self.core.is_there and self.core.has(slot):
                    self.core.detach(slot)

    def remove_proxy(self, follower: Follower) -> None:
        """Remove the proxy of a follower from PyBullet, if it is there."""
        if follower.collider is not None and self.core.is_ground(follower.collider):
            self._client.removeBody(follower.collider)
        follower.collider = None

    def attach_again(self, slots: list[int]) -> None:
        """Give those followers new proxies that are detached."""
        for slot in slots:
            if not self.core.has(slot):
                self.attach(self._followers[slot])

    def note_kind(self, follower: Follower) -> None:
        """Tell the core who moves a follower."""
        self.core.set_kind(follower.slot, follower.solid, follower.own, follower.remote)

    def begin(self, time: float, dt: float) -> bool:
        """Set the time [s] at the start of the next step of ``dt`` [s]; returns True if bodies may have been removed
        from PyBullet. Raises `InputError` if the client was reset or closed, or does not step ``dt``, and PyBullet's
        error if a step failed in the core."""
        if self.core.begin(time, as_float(dt)):
            return False
        self.require_client()
        require_time_step(self._client, dt)
        self.core.time, self.core.duration = time, dt
        return True

    def let_sleep(self, config: SleepConfig | None) -> None:
        """Wake all bodies; let those that are still sleep from now on, None = none."""
        self.require_client()
        it = config or SleepConfig(after=math.inf)
        if not isinstance(it, SleepConfig):
            raise InputError("parameter", f"rules of sleep are {config!r}; pass SleepConfig(...), or None for no sleep")
        self.core.set_sleep(it.after, it.distance, it.joint, it.ground, it.noise, it.most)

    def wake(self, slots: list[int] | None) -> None:
        """Wake followers, None = all. What touches them wakes in the next step."""
        if not self.core.is_there:
            return
        if slots is None:
            self.core.wake_all()
        for slot in slots or ():
            self.core.wake(slot)

    def drive(self, follower: Follower) -> None:
        """Move the surface of a follower by its belt."""
        self.core.drive(follower.slot, follower.belt.axis, follower.belt.speed)

    def memory(self, slots: list[int]) -> tuple[FloatArray, list[FloatArray]]:
        """Return what is known of the past of followers beside their contacts: for how long they were still and where,
        and their parts on the soil."""
        table, parts = self.core.memory(np.array(slots, np.int64))
        return table, parts

    def recall(self, slots: list[int], memory: tuple[FloatArray, list[FloatArray]]) -> None:
        """Take over what `memory` returned, in the same order. Raises `InputError` if it is none of these followers."""
        try:
            self.core.recall(np.array(slots, np.int64), *memory)
        except (TypeError, ValueError) as error:
            raise InputError("state", f"a saved state is none of these bodies: {error}") from None

    def require_client(self) -> None:
        """Raise `InputError` if the client was reset or closed, and PyBullet's error if a step failed in the core."""
        if fault := self.core.take_fault():
            raise pb.error(f"in a step of PyBullet a body had no contacts with the ground: {fault}")

    def states_of(self, slots: IntArray) -> FloatArray:
        """Return the states (n, 13) of followers, asleep or not, as they are now; NaN in slots that nobody has, and for
        bodies that are gone."""
        return np.asarray(self.core.read(slots))

    def close(self) -> None:
        """Leave the client, from which all followers are detached."""
        self.core.release()

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
