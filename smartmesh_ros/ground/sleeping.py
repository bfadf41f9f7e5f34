"""Puts bodies at rest to sleep, without a collider, and wakes them before anything can touch or move them.

A sleeping body costs PyBullet a hundredth of one that lies awake on a collider, but it needs its collider back before
it is touched: PyBullet wakes it in the step of the contact, and it would fall. So a body is woken when anything awake
comes near, when the ground under it changes, when a neighbour is taken away, and by `wake`. It wakes with all sleeping
bodies that it may touch, and falls asleep only together with all bodies that it may touch.

PyBullet stops a body first, while its collider still holds it; a robot needs some steps to stop. The update after that
takes the collider away.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from smartmesh_ros.core import CORE, as_bytes
from smartmesh_ros.ground.bullet import BulletCalls
from smartmesh_ros.ground.bullet_sleep import STEPS_TO_STOP, BulletSleep, is_fixed
from smartmesh_ros.ground.followers import Followers
from smartmesh_ros.ground.resting_ground import RestingGround
from smartmesh_ros.ground.sleep_config import SleepConfig
from smartmesh_ros.patches.slot_rows import with_rows
from smartmesh_ros.terrain.grid import BoolArray, FloatArray, IntArray
from smartmesh_ros.terrain.terrain import Terrain

# Gravity for which `SleepConfig.after` is meant [m/s^2]. Under a weaker one all that falls, rolls or tips over is
# slower.
EARTH = 9.81
# Largest motion of a sleeping body that is rounding [m].
ROUNDING = 1e-6
# Columns of a table of boxes (S, 6): lowest and highest x, y, z [m].
BOX_COLUMNS = 6
# Columns of the table of anchors (S, 8): position [m] and orientation (x, y, z, w) that a still body stays near, and
# the time since when [s].
SINCE = 7


class Sleeping:
    """Which bodies of one world sleep. Followers are addressed by slot; the links of a robot sleep together.

    ``may_sleep`` is asked once a PyBullet body could fall asleep. ``release`` takes the colliders from followers, and
    returns what is to be remembered of their contacts; ``contacts`` holds these by slot. ``stopped``: PyBullet bodies
    that are about to fall asleep, and since when [s]. ``gravity`` [m/s^2].
    """

    def __init__(
        self,
        client: Any,
        followers: Followers,
        terrain: Terrain,
        config: SleepConfig,
        *,
        may_sleep: Callable[[int], bool],
        release: Callable[[IntArray], dict[int, Any]],
    ) -> None:
        self.config = config
        self.contacts: dict[int, Any] = {}
        self.stopped: dict[int, float] = {}
        self.gravity = EARTH
        self._client = client
        self._bullet = BulletSleep(client)
        self._calls = BulletCalls(client)
        self._followers = followers
        self._may_sleep = may_sleep
        self._release = release
        self._ground = RestingGround(terrain, config.noise)
        self._boxes: FloatArray = np.empty((0, BOX_COLUMNS))
        self._anchors: FloatArray = np.empty((0, SINCE + 1))
        self._owners: IntArray = np.empty(0, np.int64)  # PyBullet bodies
        self._search: Any = None  # the core's, among the sleeping bodies
        self._searches = -1  # value of `Followers.wakes` for which it was made
        self._watched = 0  # place in the sleeping bodies of the next one to read
        self._fresh: IntArray = np.empty(0, np.int64)  # bodies that fell asleep in the last update

    @property
    def after(self) -> float:
        """Time for which a body must be still [s]: `SleepConfig.after`, or longer under a gravity weaker than the
        Earth's, because a body falls by the same distance in this time."""
        return self.config.after * math.sqrt(EARTH / min(self.gravity, EARTH)) if self.gravity else math.inf

    @property
    def stopping(self) -> BoolArray:
        """Whether each follower (S,) is about to fall asleep: PyBullet has stopped it."""
        return np.isin(self._owners, list(self.stopped))

    def reserve(self, slots: int) -> None:
        """Make room for bodies in ``slots`` slots."""
        self._boxes = with_rows(self._boxes, slots, np.nan)
        self._anchors = with_rows(self._anchors, slots, np.nan)
        self._owners = with_rows(self._owners, slots, -1)
        self._ground.reserve(slots)

    def add(self, slot: int) -> None:
        """Note a new follower."""
        self._anchors[slot] = np.nan
        self._owners[slot] = self._followers[slot].body

    def remove(self, slot: int) -> None:
        """Forget a follower that is about to be removed, and wake what may touch it."""
        self.wake_near(slot)
        self.stopped.pop(int(self._owners[slot]), None)
        self._forget(np.array([slot]))

    def wake(self, slots: IntArray) -> None:
        """Wake bodies, with all that they may touch. Each must be still for `SleepConfig.after` before it sleeps."""
        self._anchors[slots] = np.nan
        self._start(self.stopped.keys() & set(self._owners[slots].tolist()))
        if not self._followers.table["awake"][slots].all():
            marked = np.zeros(self._followers.capacity, np.bool_)
            marked[slots] = True
            self._wake_marked(marked)

    def wake_all(self) -> None:
        """Wake all bodies; each must be still for `SleepConfig.after` again before it sleeps."""
        self.keep_awake()
        self._wake_slots(self._followers.asleep)
        self._anchors[:] = np.nan

    def keep_awake(self) -> None:
        """Let none of the bodies that are about to fall asleep do so before the next update."""
        self._start(set(self.stopped))

    def wake_near(self, slot: int) -> None:
        """Wake the bodies that may touch a follower."""
        if not self._followers.asleep.size or np.isnan(self._boxes[slot, 0]):
            return
        marked = np.zeros(self._followers.capacity, np.bool_)
        self._sleepers().mark_near(slot, marked)
        self._wake_marked(marked)

    def wake_on_changed_ground(self, time: float, duration: float) -> None:
        """Wake the bodies whose ground has changed, or will within the ``duration`` [s] from ``time`` [s] on."""
        asleep = self._followers.asleep
        changed = self._ground.changed(asleep, self._boxes, time, duration, self.config.ground)
        if changed.size:
            self.wake(changed)
        self._ground.keep_corrections()
        self._move_with_corrections(self.config.ground)

    def _move_with_corrections(self, limit: float) -> None:
        """Move sleeping bodies with the corrections of the ground under them that exceed ``limit`` [m] and have not
        woken them."""
        asleep = self._followers.asleep
        lifted = asleep[np.abs(self._ground.corrections(asleep)) > limit]
        if lifted.size:
            self._lift(asleep[np.isin(self._owners[asleep], self._owners[lifted])])

    def _lift(self, slots: IntArray) -> None:
        """Move bodies with the corrections under them, robots as a whole."""
        owners, corrections = self._owners[slots], self._ground.corrections(slots)
        for owner in set(owners[corrections != 0.0].tolist()):
            own = slots[owners == owner]
            lift = float(corrections[owners == owner].mean())
            if not is_fixed(self._client, owner):
                self._bullet.lift(owner, lift)
                self._followers.states[own, 2] += lift
                self._boxes[own, 2] += lift
                self._boxes[own, 5] += lift
            self._ground.note_moved(own)

    def wake_moved(self, duration: float) -> None:
        """Wake bodies that moved although they sleep, because their user moved them through PyBullet, or PyBullet woke
        them. Reads those that fell asleep in the last update, and of the others as many as are due in a ``duration``
        [s]."""
        asleep = self._followers.asleep
        if not asleep.size:
            return
        count = min(math.ceil(len(asleep) * duration / self.config.watch), len(asleep))
        due = asleep[np.arange(self._watched, self._watched + count) % len(asleep)]
        self._watched = (self._watched + count) % len(asleep)
        chosen = np.concatenate([np.intersect1d(self._fresh, asleep), due])
        self._fresh = chosen[:0]
        moved = [slot for slot in chosen.tolist() if self._moved(slot)]
        if moved:
            self.wake(np.array(moved))

    def _moved(self, slot: int) -> bool:
        """Return True if a sleeping body or link is not where it fell asleep."""
        follower, known = self._followers[slot], self._followers.states[slot]
        body, link = follower.body, follower.link
        found = self._calls.states([body]) if link < 0 else self._calls.link_states(body, [link])
        return not CORE.strayed(found[0], known, follower.radius) <= ROUNDING  # True for NaN

    def note_motion(self, time: float) -> None:
        """Note where the awake bodies are; their states are those of ``time`` [s]."""
        followers = self._followers
        shapes = as_bytes(followers.shape_table.table)
        distance = self.config.distance
        CORE.note_motion(followers.awake, shapes, followers.states, self._boxes, self._anchors, time, distance)

    def wake_reached(self, time: float, elapsed: float) -> bool:
        """Wake the bodies that something awake may touch in the step from ``time`` [s] on; returns True if there were
        any. ``elapsed`` [s]: since the last update."""
        followers, config = self._followers, self.config
        if not followers.asleep.size:
            return False
        marked = np.zeros(followers.capacity, np.bool_)
        if not self._sleepers().mark_reached(
            followers.awake, followers.states, followers.positions_w, followers.moved_w, self._anchors,
            (time, self.after, config.distance), elapsed, marked,
        ):  # fmt: skip
            return False
        self._wake_marked(marked)
        return True

    def put_to_sleep(self, time: float, dt: float, steps: int) -> None:
        """Put the islands to sleep that are still, on ground that will not move in the ``steps`` of ``dt`` [s] from
        ``time`` [s] on."""
        slots, groups = self._ready(time, dt * steps)
        ready = set(self._owners[slots].tolist())
        self._start(self.stopped.keys() - ready)
        for owner in ready - self.stopped.keys():
            self._bullet.stop(owner)
            self.stopped[owner] = time
        stopped = {owner for owner in ready if time - self.stopped[owner] > (STEPS_TO_STOP - 0.5) * dt}
        if stopped:
            self._put(slots[all_of(np.array([owner in stopped for owner in self._owners[slots].tolist()]), groups)])

    def _ready(self, time: float, duration: float) -> tuple[IntArray, IntArray]:
        """Return the bodies that may fall asleep, and the island of each (n,)."""
        followers, config, awake = self._followers, self.config, self._followers.awake
        still = time - self._anchors[awake, SINCE] >= self.after
        if not (still & followers.table["solid"][awake]).any():
            return awake[:0], awake[:0]
        groups = CORE.islands(awake, self._owners, self._boxes, followers.radii, config.near, config.near_share)
        solid = awake[still & followers.table["solid"][awake] & all_of(still, groups)]
        if not solid.size:
            return awake[:0], awake[:0]
        groups = groups[np.searchsorted(awake, solid)]
        few = first_groups(groups, config.most)
        solid, groups = solid[few], groups[few]
        limit = config.ground
        ready = self._willing(solid) & self._ground.calm(solid, self._boxes, time, duration, limit)
        ready = all_of(ready, groups)
        self._ground.forget(solid[~ready])
        return solid[ready], groups[ready]

    def _willing(self, slots: IntArray) -> BoolArray:
        """Return for each body (n,) whether its PyBullet body rests on something, with all its joints, and may sleep.
        The owner of a remote body knows on what it rests."""
        owners = self._owners[slots]
        remote = set(owners[self._followers.table["remote"][slots]].tolist())
        answers = {
            owner: self._bullet.joints_rest(owner, self.config.joint)
            and (owner in remote or self._bullet.supported(owner))
            and self._may_sleep(owner)
            for owner in set(owners.tolist())
        }
        return np.array([answers[owner] for owner in owners.tolist()], bool)

    def _put(self, slots: IntArray) -> None:
        """Put bodies to sleep that PyBullet has stopped."""
        if not slots.size:
            return
        self.contacts.update(self._release(slots))
        for owner in set(self._owners[slots].tolist()):
            self._bullet.freeze(owner)
            del self.stopped[owner]
        self._fresh = slots
        self._followers.states[slots, 7:13] = 0.0
        self._followers.set_awake(slots, awake=False)

    def _start(self, owners: set[int]) -> None:
        """Wake PyBullet bodies that are about to fall asleep."""
        for owner in owners:
            self._bullet.start(owner)
            del self.stopped[owner]

    def _wake_marked(self, marked: BoolArray) -> None:
        """Wake the marked bodies (S,), with all links of their robots and all that they may touch."""
        asleep = self._followers.asleep
        if not marked[asleep].any():
            return
        known = 0
        while known < int(np.count_nonzero(marked)):  # robots connect what their links do not
            known = int(np.count_nonzero(marked))
            self._sleepers().mark_connected(marked)
            marked[asleep] |= np.isin(self._owners[asleep], self._owners[asleep[marked[asleep]]])
        self._wake_slots(asleep[marked[asleep]])

    def _wake_slots(self, slots: IntArray) -> None:
        """Wake bodies, after moving them with the corrections that they slept through."""
        self._lift(slots)
        for owner in set(self._owners[slots].tolist()):
            self._bullet.start(owner)
        self._forget(slots)
        self._followers.set_awake(slots, awake=True)

    def _forget(self, slots: IntArray) -> None:
        """Discard what is known of bodies that woke or go."""
        self._ground.forget(slots)
        for slot in slots.tolist():
            self.contacts.pop(slot, None)
        self._anchors[slots] = np.nan

    def _sleepers(self) -> Any:
        """Return the search for sleeping bodies that others may touch, a new one if the sleeping ones have changed."""
        if self._searches != self._followers.wakes:
            self._searches, config = self._followers.wakes, self.config
            self._search = CORE.Sleepers(
                self._followers.asleep, self._boxes, self._followers.radii, config.near, config.near_share
            )
        return self._search


def first_groups(groups: IntArray, most: int) -> BoolArray:
    """Return which items (n,) are in the first groups that have at most ``most`` items together; at least one group."""
    numbers, counts = np.unique(groups, return_counts=True)
    fits = np.cumsum(counts) <= most
    fits[0] = True
    return np.isin(groups, numbers[fits])


def all_of(marks: BoolArray, groups: IntArray) -> BoolArray:
    """Return for each item (n,) whether all items of its group are marked; ``groups`` (n,)."""
    unmarked = np.unique(groups[~marks])
    return ~np.isin(groups, unmarked)
