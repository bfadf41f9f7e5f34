"""The bodies of a PyBullet world that stand on a terrain, and what they collide with there."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable
from numbers import Integral
from typing import Any

import numpy as np

from smartmesh_ros.core.body_shape import BodyShape
from smartmesh_ros.errors import InputError, as_float, listed, require
from smartmesh_ros.ground.body_shapes import require_body, shapes_of
from smartmesh_ros.ground.bullet import BulletCalls, NoClient, connected_client, undone
from smartmesh_ros.ground.config import SleepConfig, time_step_of
from smartmesh_ros.ground.followers import Belt, Follower, Followers
from smartmesh_ros.ground.map_contacts import MapContacts, SoilSupport
from smartmesh_ros.ground.shapes import Solid
from smartmesh_ros.ground.shown_ground import ShownGround
from smartmesh_ros.ground.shown_patches import ShownPatches
from smartmesh_ros.ground.state import Vector
from smartmesh_ros.soil.soil import Soil
from smartmesh_ros.stopwatch import Stopwatch
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.terrain.terrain import MainMesh, Terrain

log = logging.getLogger("smartmesh_ros")


class AttachedBodies:
    """Bodies and links on a terrain, in a client of PyBullet; see `Ground`."""

    def __init__(
        self,
        client: Any,
        terrain: MainMesh | Terrain,
        stopwatch: Stopwatch | None = None,
    ) -> None:
        self._client = connected_client(client)
        self._calls = BulletCalls(self._client)
        self._terrain = Terrain.of(terrain)
        self.stopwatch = Stopwatch.of(stopwatch)
        self.followers = Followers()
        self.note_gone: Callable[[Follower], object] = lambda _: None  # of a world of bodies
        self._soil: Soil | None = None
        self._shown: ShownGround | None = None
        self._printed = math.nan  # time at which prints of the soil were written into its map [s]
        self.contacts = self._new_contacts()
        self.patches = ShownPatches(self.terrain, self.followers, self.stopwatch)

    def __getstate__(self) -> dict[str, Any]:
        """Return what a copy of the ground, or one in another process, is made of: its terrain and settings. PyBullet's
        world and what is attached there cannot be copied. Raises `InputError` if there is soil, whose state would be
        lost."""
        if self.soil is not None:
            raise InputError("soil", "a ground with soil cannot be copied; take the soil off by set_soil(None) before")
        return {"_terrain": self.terrain}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Make a ground that answers questions about its terrain, and refuses what needs a client."""
        nobody: Any = NoClient(
            "this ground is a copy, and PyBullet's world cannot be copied: make Ground(client, ground.terrain) and "
            "attach its bodies"
        )
        vars(self).update(state, _client=nobody, _calls=nobody, patches=nobody, contacts=nobody)
        self.followers, self.stopwatch, self._soil, self._shown = Followers(), Stopwatch(), None, None
        self._printed = math.nan

    @property
    def terrain(self) -> Terrain:
        """The ground itself: replace the heights of its maps, or put and remove tiles and decks."""
        return self._terrain

    @property
    def soil(self) -> Soil | None:
        """The soil that bodies stand on; see `set_soil`."""
        return self._soil

    def attach(
        self,
        body: int,
        link: int | None = None,
        *,
        radius: float | None = None,
        solid: bool = True,
        shape: Solid | BodyShape | None = None,
    ) -> Follower:
        """Put each link of ``body`` that has a collision shape onto the ground, or one ``link`` (-1 = the base).

        Contacts are those of the shapes that PyBullet collides. Patches, and what lifts a body out of the ground, take
        the base or link for these, too, or for a given ``shape`` about the centre of mass (or one that was read
        before), or a bounding sphere of a ``radius`` [m]. ``solid=False`` computes patches without contacts. Returns
        the follower of the link, or of the first one; ``followers.of(body)`` lists all. Raises `InputError`, and
        attaches nothing, if there is no such body or link, if the body is soft or a robot that was loaded with
        ``useMaximalCoordinates``, if a link that moves has a shape that is not convex, or if a link has no shape or is
        attached already.
        """
        self.contacts.require_client()
        require_body(self._client, body, link)
        if self.is_ground(body):
            raise InputError("unknown_body", f"body {body} is a piece of this ground; attach what stands on it")
        self.drop_gone()
        shapes = shapes_of(self._client, body, link, shape, radius)
        made = [Follower(body, each, record, solid, own=solid) for each, record in shapes.items()]
        self.followers.require_new(body, list(shapes))
        if not len(self.followers):
            self.contacts.begin(self.clock, time_step_of(self._client))
        with undone(lambda: self._take_off([follower.slot for follower in made if follower.slot >= 0])):
            for follower in made:
                self.followers.add(follower)
                self.contacts.attach(follower)
        return made[0]

    def is_ground(self, body: object) -> bool:
        """Return True if a PyBullet body stands for the ground, such as the other body of a contact point."""
        try:
            return isinstance(body, Integral) and bool(self.contacts.core.is_ground(body))
        except TypeError:  # larger than PyBullet's numbers
            return False

    def detach(self, body: int) -> None:
        """Take ``body`` and its links off the ground. A body that is removed from PyBullet is taken off by itself."""
        self._take_off(list(self.followers.of(body)))

    def drop_gone(self) -> None:
        """Take off what was removed from PyBullet, whose number another body may have by now, and tell ``note_gone``.
        Pieces of the ground that were removed are put back."""
        contacts = self.contacts
        if not contacts.core.has_gone:
            return
        gone = contacts.core.find_gone(False)
        for follower in [each for each in self.followers if each.slot in gone]:
            self.note_gone(follower)
            contacts.remove_proxy(follower)
            self.followers.remove(follower.slot)
        for slot in gone:
            contacts.core.detach(slot)
        if bare := contacts.core.find_gone(True):
            bodies = listed(sorted({str(self.followers[slot].body) for slot in bare}))
            log.warning("the ground under body %s was removed from PyBullet, and is put back; see detach", bodies)
            contacts.detach(bare)
            contacts.attach_again(bare)

    def _take_off(self, slots: list[int]) -> None:
        """Detach all of these followers, or none if PyBullet fails."""
        self.contacts.detach(slots)
        for slot in slots:
            self.followers.remove(slot)

    def drive(self, body: int, link: int, axis: Vector, speed: float) -> None:
        """Move the surface of an attached ``body``'s ``link`` (-1 = the base) at a ``speed`` [m/s] from now on, as that
        of a track; zero stops it.

        Where the ground touches it with a normal n, the surface moves along n x ``axis``, a vector in the frame of the
        link's centre of mass: a positive speed drives as a wheel that turns about the axis. The body wakes, and does
        not sleep while its surface moves. Raises `InputError` if there is no such link, or for impossible numbers.
        """
        belt, follower = Belt(axis, speed), self.followers.at(body, link)
        if follower is None or not follower.solid:
            raise InputError(
                "unknown_body", f"body {body}, link {link} has no contacts with the ground; attach it first"
            )
        self.contacts.require_client()
        if follower.belt != belt:
            self.wake(body)
            follower.belt = belt
            self.contacts.drive(follower)

    def set_owner(self, slot: int, *, own: bool, remote: bool) -> None:
        """Note whether this world moves a follower, and whether another node simulates it."""
        follower = self.followers[slot]
        follower.own, follower.remote = follower.own and own, remote
        self.contacts.note_kind(follower)

    def let_sleep(self, config: SleepConfig | None = SleepConfig()) -> None:  # noqa: B008 - it is frozen
        """Wake all bodies, and let those at rest sleep from now on; None = nobody.

        A sleeping body keeps its contacts, and costs little. It wakes with all that it touches, in the step in which
        something touches or moves it: other bodies, attached or not; constraints; poses, velocities, forces and joint
        commands that are set through PyBullet; another ground. A multibody that a constraint holds to something else
        stays awake. PyBullet's ``changeDynamics`` and collision filters wake nobody, nor do changes of constraints of
        rigid bodies: call `wake` after them.
        """
        self.contacts.let_sleep(config)

    def wake(self, body: int | None = None) -> None:
        """Wake a body, or all (None), with what it touches. It must be still for `SleepConfig.after` before it
        sleeps."""
        self.contacts.wake(None if body is None else self.followers.of(body))

    def is_asleep(self, body: int) -> bool:
        """Return True if an attached body sleeps with all its links."""
        slots = self.followers.of(body)
        return bool(slots) and all(map(self.contacts.core.is_asleep, slots))

    def note_remote_states(self, bodies: list[int], states: FloatArray) -> None:
        """Note that bodies of other nodes are about to be set to states (n, 13). They sleep only while their owners say
        that they are at rest."""
        slots = np.array([self.followers.of(body)[0] for body in bodies], np.int64)
        jumps = np.linalg.norm(states[:, :3] - self.contacts.states_of(slots)[:, :3], axis=1)
        radii = [self.followers[slot].radius for slot in slots.tolist()]
        active = slots[states[:, 7:13].any(axis=1) | ~(jumps <= radii)]
        self.contacts.wake(active.tolist())

    def close(self) -> None:
        """Detach all bodies, and leave the client to another ground."""
        self.hide()
        for follower in list(self.followers):
            self.detach(follower.body)
        self.contacts.close()

    def show(self, rate: float = 10.0) -> None:
        """Draw the ground in PyBullet's window and pictures, where its rays meet it: now, and with later steps and
        updates at most ``rate`` [Hz] times a second of simulated time. Nothing touches what is drawn.

        Maps are drawn with their holes and the colours of their friction; those of more than 256 samples a side at
        every 2nd, 3rd, ... sample. Raises `InputError` if the rate is no number above zero.
        """
        require(0.0 < as_float(rate) < math.inf, "rate", "the rate of drawing", rate, "finite and above zero [Hz]")
        self.contacts.require_client()
        if self._shown is None:
            self._shown = ShownGround(self._client, self.contacts.core, self.terrain, rate)
        self._shown.rate = rate
        self._shown.draw(self.clock)

    def hide(self) -> None:
        """Remove what `show` draws."""
        if self._shown is not None:
            self._shown.hide()

    @property
    def drawn(self) -> float:
        """Rate at which the ground is drawn [Hz]; 0 = it is not."""
        return 0.0 if self._shown is None else self._shown.rate

    @property
    def shown(self) -> dict[str, int]:
        """PyBullet's bodies of the drawn tiles, by the tiles' names: the ids that rays report."""
        return {} if self._shown is None else self._shown.bodies

    def set_soil(self, soil: Soil | None) -> None:
        """Let bodies stand on a soil of one of the terrain's height maps from now on; None =
        on the map itself. Raises `InputError` and changes nothing if the soil is of another map."""
        if soil is not None and not isinstance(soil, Soil):
            raise InputError("soil", f"the soil is {soil!r}; pass Soil(ground.terrain, ...)")
        if soil is not None and not self._has(soil.map):
            raise InputError("soil", "the map of the soil is no tile of this ground's terrain")
        self.wake()
        self.contacts.core.set_soil(None if soil is None else soil.core)
        self._soil = soil

    def check_soil(self) -> None:
        """Take the soil away if its map is gone; wake what rests on it if other soils lie there."""
        if self.soil is None:
            return
        if not self._has(self.soil.map):
            log.warning("the map of the soil is no tile any more: bodies stand on the maps themselves")
            self.set_soil(None)
        elif self.soil.take_kinds():
            self.wake()

    def on_soil(self) -> dict[str, SoilSupport]:
        """Return how the soil bore each body and link on it in the last step, by the names of the followers."""
        core = self.contacts.core
        parts = {follower.name: np.asarray(core.on_soil(follower.slot)) for follower in self.followers}
        return {
            name: SoilSupport(float(found[:, 0].max()), float(found[:, 1].sum()), float(found[:, 2].sum()))
            for name, found in parts.items()
            if len(found)
        }

    @property
    def rescues(self) -> int:
        """How often bodies were put back onto the ground: that were spawned or teleported below it, covered by a map,
        or pushed there by another body. It is the last resort."""
        return int(self.contacts.core.rescues)

    @property
    def clock(self) -> float:
        """Time [s] at the start of the next step. PyBullet's steps advance it, whoever calls them."""
        return float(self.contacts.core.time)

    def _has(self, mesh: MainMesh) -> bool:
        """Return True if a mesh is a tile of the terrain."""
        return any(tile is mesh for tile in self.terrain.tiles.values())

    def _new_contacts(self) -> MapContacts:
        return MapContacts(self._client, self.followers, self.terrain)
