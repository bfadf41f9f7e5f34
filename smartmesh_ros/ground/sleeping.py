"""Puts bodies at rest to sleep, without contacts, and wakes them before anything can touch or move them.

A sleeping body has no contacts with the ground, and costs a hundredth of one that lies awake. It needs its contacts
back before it is touched: PyBullet wakes it in the step of the contact, and it would fall. So a body is woken when
anything awake comes near, when the ground under it changes, when a neighbour is taken away, and by `wake`. It wakes
with all sleeping bodies that it may touch, and falls asleep only together with all bodies that it may touch.

PyBullet stops a body first, while the ground still holds it; a robot needs some steps to stop. The update after that
takes the ground away.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from smartmesh_ros.core import CORE, as_bytes
from smartmesh_ros.ground.bullet_sleep import STEPS_TO_STOP, BulletSleep, SleepContacts, is_fixed
from smartmesh_ros.ground.config import SleepConfig
from smartmesh_ros.ground.followers import Followers
from smartmesh_ros.ground.resting_ground import RestingGround
from smartmesh_ros.patches.supports import with_rows
from smartmesh_ros.terrain.grid import BoolArray, FloatArray, IntArray
from smartmesh_ros.terrain.terrain import Terrain

# Gravity for which `SleepConfig.after` is meant [m/s^2]. Under a weaker one all that falls or rolls is slower.
EARTH = 9.81
NOBODY = np.empty(0, np.int64)
# Columns of a table of boxes (S, 6): lowest and highest x, y, z [m].
BOX_COLUMNS = 6
# Column of the table of anchors (S, 8), after the pose that a still body stays near: the time since when [s].
SINCE = 7


class Sleeping:
    """Which bodies of one world sleep. Followers are addressed by slot; the links of a robot sleep together.

    ``contacts``: by slot, of sleeping bodies in the last step before they fell asleep.
    """

    def __init__(self, client: Any, followers: Followers, terrain: Terrain) -> None:
        self.contacts: dict[int, SleepContacts] = {}
        self._config = SleepConfig()
        self._may_sleep: Callable[[int], bool] | None = None
        self._gravity = EARTH
        self._stopped: dict[int, float] = {}  # PyBullet bodies that are about to fall asleep, and since when [s]
        self._client = client
        self._bullet = BulletSleep(client, followers)
        self._followers = followers
        self._ground = RestingGround(terrain)
        self._boxes: FloatArray = np.empty((0, BOX_COLUMNS))
        self._anchors: FloatArray = np.empty((0, SINCE + 1))
        self._search: Any = None  # the core's, among the sleeping bodies
        self._searches = -1  # value of `Followers.wakes` for which it was made
        followers.tables.append(self)

    def configure(self, may_sleep: Callable[[int], bool] | None, config: SleepConfig) -> None:
        """Wake all bodies, and let those sleep from now on for whose PyBullet body ``may_sleep`` returns True; None =
        no body. It is asked once a body could fall asleep."""
        self.wake(None)
        self._may_sleep, self._config = may_sleep, config

    @property
    def _after(self) -> float:
        """Time for which a body must be still [s]: `SleepConfig.after`, or longer under a gravity weaker than the
        Earth's, because a body falls by the same distance in this time."""
        return self._config.after * math.sqrt(EARTH / min(self._gravity, EARTH)) if self._gravity else math.inf

    @property
    def stopping(self) -> BoolArray:
        """Whether each follower (S,) is about to fall asleep: PyBullet has stopped it."""
        return np.isin(self._followers.bodies, list(self._stopped))

    def grow(self, slots: int) -> None:
        """Make room for ``slots`` slots."""
        self._boxes = with_rows(self._boxes, slots, np.nan)
        self._anchors = with_rows(self._anchors, slots, np.nan)
        self._ground.grow(slots)

    def clear(self, slot: int) -> None:
        """Forget a follower that is about to be removed. `wake_near` comes before."""
        self._stopped.pop(self._followers[slot].body, None)
        self._forget(np.array([slot]))

    def wake(self, slots: IntArray | None) -> None:
        """Wake bodies, None = all, with all that they may touch. Each must be still for `SleepConfig.after` before it
        sleeps."""
        if slots is None:
            self._start(set(self._stopped))
            self._wake_slots(self._followers.asleep)
            self._anchors[:] = np.nan
            return
        self._anchors[slots] = np.nan
        self._start(self._stopped.keys() & set(self._followers.bodies[slots].tolist()))
        if not self._followers.table["awake"][slots].all():
            marked = np.zeros(self._followers.capacity, np.bool_)
            marked[slots] = True
            self._wake_marked(marked)

    def stand_still(self, duration: float) -> None:
        """Note that time advanced by ``duration`` [s] without a step: none of the bodies that are about to fall asleep
        does so before the next update. If the clock was set back, all wake."""
        if duration < 0.0:
            self.wake(None)
        self._start(set(self._stopped))

    def wake_changed(self, time: float, duration: float, gravity: float) -> None:
        """Wake the bodies whose ground has changed, or will within the ``duration`` [s] from ``time`` [s] on, and those
        that somebody moved."""
        self._gravity = gravity
        if self._may_sleep is None:
            return
        self.wake(self._ground.changed(self._followers.asleep, self._boxes, time, duration, self._config))
        self._ground.keep_corrections()
        self._move_with_corrections()
        self.wake(self._bullet.moved(duration, self._config.watch))

    def settle(self, time: float, dt: float, steps: int) -> None:
        """Wake the bodies that something awake may touch at ``time`` [s], and put the islands to sleep that are still,
        on ground that will not move in the next ``steps`` of ``dt`` [s]; the states of the awake are those of
        ``time``."""
        if self._may_sleep is None or not self._followers.awake.size:
            return
        self._note_motion(time)
        if self.wake_reached(time, 0.0):
            self._note_motion(time)
        self._put_to_sleep(time, dt, steps)

    def wake_near(self, slot: int) -> None:
        """Wake the bodies that may touch a follower."""
        if not self._followers.asleep.size or np.isnan(self._boxes[slot, 0]):
            return
        marked = np.zeros(self._followers.capacity, np.bool_)
        self._sleepers().mark_near(slot, marked)
        self._wake_marked(marked)

    def _move_with_corrections(self) -> None:
        """Move sleeping bodies with the corrections of the ground under them that exceed `SleepConfig.ground` and have
        not woken them."""
        asleep = self._followers.asleep
        lifted = asleep[np.abs(self._ground.corrections(asleep)) > self._config.ground]
        if lifted.size:
            self._lift(asleep[np.isin(self._followers.bodies[asleep], self._followers.bodies[lifted])])

    def _lift(self, slots: IntArray) -> None:
        """Move bodies with the corrections under them, robots as a whole."""
        owners, corrections = self._followers.bodies[slots], self._ground.corrections(slots)
        for owner in set(owners[corrections != 0.0].tolist()):
            own = slots[owners == owner]
            lift = float(corrections[owners == owner].mean())
            if not is_fixed(self._client, owner):
                self._bullet.lift(owner, lift)
                self._followers.states[own, 2] += lift
                self._boxes[own, 2] += lift
                self._boxes[own, 5] += lift
            self._ground.note_moved(own)

    def _note_motion(self, time: float) -> None:
        """Note where the awake bodies are."""
        followers = self._followers
        shapes = as_bytes(followers.shape_table.table)
        distance = self._config.distance
        CORE.note_motion(followers.awake, shapes, followers.states, self._boxes, self._anchors, time, distance)

    def wake_reached(self, time: float, elapsed: float) -> bool:
        """Wake the bodies that something awake may touch in the step from ``time`` [s] on; returns True if there were
        any. ``elapsed`` [s]: since the last update."""
        followers, config = self._followers, self._config
        if not followers.asleep.size:
            return False
        marked = np.zeros(followers.capacity, np.bool_)
        if not self._sleepers().mark_reached(
            followers.awake, followers.states, followers.positions_w, followers.moved_w, self._anchors,
            (time, self._after, config.distance), elapsed, marked,
        ):  # fmt: skip
            return False
        self._wake_marked(marked)
        return True

    def _put_to_sleep(self, time: float, dt: float, steps: int) -> None:
        slots, groups = self._ready(time, dt * steps)
        ready = set(self._followers.bodies[slots].tolist())
        self._start(self._stopped.keys() - ready)
        for owner in ready - self._stopped.keys():
            self._bullet.stop(owner)
            self._stopped[owner] = time
        stopped = {owner for owner in ready if time - self._stopped[owner] > (STEPS_TO_STOP - 0.5) * dt}
        if stopped:
            self._put(slots[_all_of(np.isin(self._followers.bodies[slots], list(stopped)), groups)])

    def _ready(self, time: float, duration: float) -> tuple[IntArray, IntArray]:
        """Return the bodies that may fall asleep, and the island of each (n,)."""
        followers, config, awake = self._followers, self._config, self._followers.awake
        still = time - self._anchors[awake, SINCE] >= self._after
        solid = still & followers.table["solid"][awake]
        if not solid.any():
            return NOBODY, NOBODY
        groups = CORE.islands(awake, followers.bodies, self._boxes, followers.radii, config.near, config.near_share)
        solid &= _all_of(still, groups)
        if not solid.any():
            return NOBODY, NOBODY
        few = _first_groups(groups[solid], config.most)
        slots, groups = awake[solid][few], groups[solid][few]
        ready = self._willing(slots) & self._ground.calm(slots, self._boxes, time, duration, config.ground)
        ready = _all_of(ready, groups)
        self._ground.forget(slots[~ready])
        return slots[ready], groups[ready]

    def _willing(self, slots: IntArray) -> BoolArray:
        """Return for each body (n,) whether its PyBullet body rests on something, with all its joints, and may sleep.
        The owner of a remote body knows on what it rests."""
        owners, may_sleep = self._followers.bodies[slots], self._may_sleep
        assert may_sleep is not None
        remote = set(owners[self._followers.table["remote"][slots]].tolist())
        answers = {
            owner: self._followers.stands_still(owner)
            and self._bullet.joints_rest(owner, self._config.joint)
            and (owner in remote or self._bullet.supported(owner))
            and may_sleep(owner)
            for owner in set(owners.tolist())
        }
        return np.array([answers[owner] for owner in owners.tolist()], bool)

    def _put(self, slots: IntArray) -> None:
        """Put bodies to sleep that PyBullet has stopped."""
        if not slots.size:
            return
        self.contacts |= self._bullet.contacts_before_sleep(slots)
        for owner in set(self._followers.bodies[slots].tolist()):
            self._bullet.freeze(owner)
            del self._stopped[owner]
        self._bullet.watch(slots)
        self._followers.states[slots, 7:13] = 0.0
        self._followers.set_awake(slots, awake=False)

    def _start(self, owners: set[int]) -> None:
        """Wake PyBullet bodies that are about to fall asleep."""
        for owner in owners:
            self._bullet.start(owner)
            del self._stopped[owner]

    def _wake_marked(self, marked: BoolArray) -> None:
        """Wake the marked bodies (S,), with all links of their robots and all that they may touch."""
        asleep = self._followers.asleep
        if not marked[asleep].any():
            return
        known = 0
        while known < int(np.count_nonzero(marked)):  # robots connect what their links do not
            known = int(np.count_nonzero(marked))
            self._sleepers().mark_connected(marked)
            marked[asleep] |= np.isin(self._followers.bodies[asleep], self._followers.bodies[asleep[marked[asleep]]])
        self._wake_slots(asleep[marked[asleep]])

    def _wake_slots(self, slots: IntArray) -> None:
        """Wake bodies, after moving them with the corrections that they slept through."""
        self._lift(slots)
        owners = set(self._followers.bodies[slots].tolist())
        self._forget(slots)
        self._followers.set_awake(slots, awake=True)
        self._stopped |= dict.fromkeys(owners, math.inf)  # if PyBullet fails, the next update starts the others
        self._start(owners)

    def _forget(self, slots: IntArray) -> None:
        """Discard what is known of bodies that woke or go."""
        self._ground.forget(slots)
        for slot in slots.tolist():
            self.contacts.pop(slot, None)
        self._anchors[slots] = np.nan

    def _sleepers(self) -> Any:
        """Return the search for sleeping bodies that others may touch, a new one if the sleeping ones have changed."""
        if self._searches != self._followers.wakes:
            self._searches, config = self._followers.wakes, self._config
            self._search = CORE.Sleepers(
                self._followers.asleep, self._boxes, self._followers.radii, config.near, config.near_share
            )
        return self._search


def _first_groups(groups: IntArray, most: int) -> BoolArray:
    """Return which items (n,) are in the first groups that have at most ``most`` items together; at least one group."""
    numbers, counts = np.unique(groups, return_counts=True)
    fits = np.cumsum(counts) <= most
    fits[0] = True
    return np.isin(groups, numbers[fits])


def _all_of(marks: BoolArray, groups: IntArray) -> BoolArray:
    """Return for each item (n,) whether all items of its group are marked; ``groups`` (n,)."""
    unmarked = np.unique(groups[~marks])
    return ~np.isin(groups, unmarked)
