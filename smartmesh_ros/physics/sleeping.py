"""Puts bodies at rest to sleep, without a collider, and wakes them before anything can touch or move them.

A sleeping body costs PyBullet a hundredth of one that lies awake on a collider, but it needs its collider back before
it is touched: PyBullet wakes it in the step of the contact, and it would fall. So a body is woken when anything awake
comes near, when the ground under it changes, when a neighbour is taken away, and by `wake`. It wakes with all sleeping
bodies that it may touch, and falls asleep only together with all bodies that it may touch.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pybullet as pb

from smartmesh_ros.compiled import compiled
from smartmesh_ros.patches.slot_rows import with_rows
from smartmesh_ros.physics.followers import Followers
from smartmesh_ros.physics.neighbours import BOX_COLUMNS, islands, mark_connected, mark_near, write_boxes
from smartmesh_ros.physics.resting_ground import RestingGround
from smartmesh_ros.physics.sleep_config import SleepConfig
from smartmesh_ros.terrain.grid import BoolArray, FloatArray, IntArray
from smartmesh_ros.terrain.terrain import Terrain

# PyBullet's flags. A rigid body heeds the second call alone, a robot both; neither then sleeps by PyBullet's own rule.
_SLEEP = pb.ACTIVATION_STATE_ENABLE_SLEEPING | pb.ACTIVATION_STATE_SLEEP
_WAKE = (pb.ACTIVATION_STATE_WAKE_UP, pb.ACTIVATION_STATE_DISABLE_SLEEPING)
# Columns of the table of anchors (S, 8): position [m] and orientation (x, y, z, w) that a still body stays near, and
# the time since when [s].
SINCE = 7


@compiled
def note_motion(
    chosen: IntArray, states: FloatArray, shapes: Any, anchors: FloatArray, time: float, distance: float
) -> None:
    """Move the anchors (S, 8) of the bodies in the slots ``chosen`` (n,) that moved farther than ``distance`` [m] from
    theirs. ``states`` (S, 13)."""
    for k in range(len(chosen)):
        i = chosen[k]
        if not strayed(states[i], anchors[i], shapes.table[i].radius) <= distance:
            anchors[i, :7] = states[i, :7]
            anchors[i, SINCE] = time


@compiled
def strayed(state: FloatArray, anchor: FloatArray, radius: float) -> float:
    """Bound on the distance [m] of any point of a body (13,) with a bounding ``radius`` [m] from its place at the
    anchor (8,); NaN if there is none."""
    square, cosine = 0.0, 0.0
    for axis in range(3):
        square += (state[axis] - anchor[axis]) ** 2
    for axis in range(3, 7):
        cosine += state[axis] * anchor[axis]
    sine = math.sqrt(max(1.0 - cosine * cosine, 0.0))  # of half the angle between the two orientations
    return math.sqrt(square) + 2.0 * sine * radius


@compiled
def mark_reached(
    movers: IntArray, states: FloatArray, positions: FloatArray, moved: FloatArray, anchors: FloatArray,
    radii: FloatArray, boxes: FloatArray, elapsed: float, config: tuple[float, float, float, float, float],
    order: IntArray, widest: float, found: BoolArray,
) -> bool:  # fmt: skip
    """Mark in ``found`` (S,) the sleeping bodies that the bodies in the slots ``movers`` (n,) may touch in the coming
    step; returns True if there are any.

    ``states`` (S, 13), ``boxes`` (S, 6): at the last update, ``elapsed`` [s] ago; ``positions``, ``moved`` (S, 3) [m]:
    now, and in the coming step. ``config``: time now, `SleepConfig.after`, ``distance``, ``near``, ``near_share``.
    ``order``, ``widest``: as in `mark_near`. Bodies that are still do not count.
    """
    time, after, distance, near, near_share = config
    any_found = False
    box = np.empty(6)
    for k in range(len(movers)):
        i = movers[k]
        away = step = spin = 0.0
        for axis in range(3):
            away += (positions[i, axis] - anchors[i, axis]) ** 2
            step += moved[i, axis] ** 2
            spin += states[i, 10 + axis] ** 2
        if time - anchors[i, SINCE] >= after and away <= distance * distance and step <= distance * distance:
            continue
        turned = min(math.sqrt(spin) * elapsed, 2.0) * radii[i]
        for axis in range(3):
            went = positions[i, axis] - states[i, axis]
            box[axis] = boxes[i, axis] + went - turned
            box[axis + 3] = boxes[i, axis + 3] + went + turned
        reach = near + math.sqrt(step)
        if mark_near(box, reach, radii[i], order, widest, boxes, radii, near_share, found):
            any_found = True
    return any_found


class Sleeping:
    """Which bodies of one world sleep. Followers are addressed by slot; the links of a robot sleep together.

    ``may_sleep`` is asked once a PyBullet body could fall asleep. ``release`` takes the colliders from followers, and
    returns what is to be remembered of their contacts; ``contacts`` holds these by slot.
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
        self._client = client
        self._followers = followers
        self._may_sleep = may_sleep
        self._release = release
        self._ground = RestingGround(terrain, config.noise)
        self._boxes: FloatArray = np.empty((0, BOX_COLUMNS))
        self._anchors: FloatArray = np.empty((0, SINCE + 1))
        self._owners: IntArray = np.empty(0, np.int64)  # PyBullet bodies
        self._order: IntArray = np.empty(0, np.int64)  # sleeping bodies by their lowest x
        self._widest = 0.0
        self._ordered_for = -1
        self._watched = 0  # place in the sleeping bodies of the next one to read

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
        self._forget(np.array([slot]))

    def wake(self, slots: IntArray) -> None:
        """Wake bodies, with all that they may touch. Each must be still for `SleepConfig.after` before it sleeps."""
        self._anchors[slots] = np.nan
        if not self._followers.table["awake"][slots].all():
            marked = np.zeros(self._followers.capacity, np.bool_)
            marked[slots] = True
            self._wake_marked(marked)

    def wake_all(self) -> None:
        """Wake all bodies; each must be still for `SleepConfig.after` again before it sleeps."""
        self._wake_slots(self._followers.asleep)
        self._anchors[:] = np.nan

    def wake_near(self, slot: int) -> None:
        """Wake the bodies that may touch a follower."""
        if not self._followers.asleep.size or np.isnan(self._boxes[slot, 0]):
            return
        self._sort()
        marked = np.zeros(self._followers.capacity, np.bool_)
        config, radii = self.config, self._followers.radii
        mark_near(
            self._boxes[slot], config.near, radii[slot], self._order, self._widest, self._boxes, radii,
            config.near_share, marked,
        )  # fmt: skip
        self._wake_marked(marked)

    def wake_on_changed_ground(self, time: float, duration: float, tolerance: float) -> None:
        """Wake the bodies whose ground has changed, or will within the ``duration`` [s] from ``time`` [s] on."""
        asleep = self._followers.asleep
        changed = self._ground.changed(asleep, self._boxes, time, duration, self.config.ground * tolerance)
        if changed.size:
            self.wake(changed)
        self._ground.keep_corrections()

    def wake_moved(self, duration: float) -> None:
        """Wake bodies that moved although they sleep, because their user moved them through PyBullet. Reads as many as
        are due in a ``duration`` [s]."""
        asleep = self._followers.asleep
        if not asleep.size:
            return
        count = min(math.ceil(len(asleep) * duration / self.config.watch), len(asleep))
        chosen = asleep[np.arange(self._watched, self._watched + count) % len(asleep)]
        self._watched = (self._watched + count) % len(asleep)
        chosen = chosen[[self._followers[slot].link < 0 for slot in chosen.tolist()]]
        positions = [self._client.getBasePositionAndOrientation(owner)[0] for owner in self._owners[chosen].tolist()]
        away = np.abs(np.array(positions).reshape(-1, 3) - self._followers.states[chosen, :3]).max(axis=1)
        moved = chosen[away > self.config.near]
        if moved.size:
            self.wake(moved)

    def note_motion(self, time: float) -> None:
        """Note where the awake bodies are; their states are those of ``time`` [s]."""
        followers, awake = self._followers, self._followers.awake
        write_boxes(awake, followers.shapes, followers.states, self._boxes)
        note_motion(awake, followers.states, followers.shapes, self._anchors, time, self.config.distance)

    def wake_reached(self, time: float, elapsed: float) -> bool:
        """Wake the bodies that something awake may touch in the step from ``time`` [s] on; returns True if there were
        any. ``elapsed`` [s]: since the last update."""
        followers, config = self._followers, self.config
        if not followers.asleep.size:
            return False
        self._sort()
        marked = np.zeros(followers.capacity, np.bool_)
        if not mark_reached(
            followers.awake, followers.states, followers.positions_w, followers.moved_w, self._anchors,
            followers.radii, self._boxes, elapsed,
            (time, config.after, config.distance, config.near, config.near_share), self._order, self._widest, marked,
        ):  # fmt: skip
            return False
        self._wake_marked(marked)
        return True

    def put_to_sleep(self, time: float, duration: float, tolerance: float) -> None:
        """Put the islands to sleep that are still, on ground that will not move in the ``duration`` [s] from ``time``
        [s] on."""
        followers, config, awake = self._followers, self.config, self._followers.awake
        still = time - self._anchors[awake, SINCE] >= config.after
        if not (still & followers.table["solid"][awake]).any():
            return
        groups = islands(awake, self._owners, self._boxes, followers.radii, config.near, config.near_share)
        solid = awake[still & followers.table["solid"][awake] & _all_of(still, groups)]
        if not solid.size:
            return
        groups = groups[np.searchsorted(awake, solid)]
        few = _first_groups(groups, config.most)
        solid, groups = solid[few], groups[few]
        limit = config.ground * tolerance
        ready = self._ground.calm(solid, self._boxes, time, duration, limit) & self._willing(solid)
        chosen = solid[_all_of(ready, groups)]
        self._ground.forget(np.setdiff1d(solid, chosen))
        self._put(chosen)

    def _willing(self, slots: IntArray) -> BoolArray:
        """Ask for each PyBullet body whether it may sleep (n,)."""
        owners = self._owners[slots].tolist()
        answers = {owner: self._may_sleep(owner) for owner in set(owners)}
        return np.array([answers[owner] for owner in owners], bool)

    def _put(self, slots: IntArray) -> None:
        """Put bodies to sleep."""
        if not slots.size:
            return
        for owner in set(self._owners[slots].tolist()):
            self._client.changeDynamics(owner, -1, activationState=_SLEEP)
        self.contacts.update(self._release(slots))
        self._followers.states[slots, 7:13] = 0.0
        self._followers.set_awake(slots, awake=False)

    def _wake_marked(self, marked: BoolArray) -> None:
        """Wake the marked bodies (S,), with all links of their robots and all that they may touch."""
        followers, config = self._followers, self.config
        asleep = followers.asleep
        if not marked[asleep].any():
            return
        self._sort()
        known = 0
        while known < int(np.count_nonzero(marked)):  # robots connect what their links do not
            known = int(np.count_nonzero(marked))
            mark_connected(
                self._order, self._widest, self._boxes, followers.radii, config.near, config.near_share, marked
            )
            marked[asleep] |= np.isin(self._owners[asleep], self._owners[asleep[marked[asleep]]])
        self._wake_slots(asleep[marked[asleep]])

    def _wake_slots(self, slots: IntArray) -> None:
        """Wake bodies, after moving them with the corrections that they slept through."""
        owners, corrections = self._owners[slots], self._ground.corrections(slots)
        for owner in set(owners.tolist()):
            if lift := float(corrections[owners == owner].mean()):
                (x, y, z), orientation = self._client.getBasePositionAndOrientation(owner)
                self._client.resetBasePositionAndOrientation(owner, (x, y, z + lift), orientation)
            for state in _WAKE:
                self._client.changeDynamics(owner, -1, activationState=state)
        self._forget(slots)
        self._followers.set_awake(slots, awake=True)

    def _forget(self, slots: IntArray) -> None:
        """Discard what is known of bodies that woke or go."""
        self._ground.forget(slots)
        for slot in slots.tolist():
            self.contacts.pop(slot, None)
        self._anchors[slots] = np.nan

    def _sort(self) -> None:
        """Sort the sleeping bodies by their lowest x, if the sleeping ones have changed."""
        if self._ordered_for != self._followers.wakes:
            self._ordered_for, asleep = self._followers.wakes, self._followers.asleep
            boxes, radii = self._boxes[asleep], self._followers.radii[asleep]
            self._order = asleep[np.argsort(boxes[:, 0], kind="stable")]
            extent = float((boxes[:, 3] - boxes[:, 0]).max(initial=0.0))
            self._widest = extent + self.config.near_share * float(radii.max(initial=0.0))


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
