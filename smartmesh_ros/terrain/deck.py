"""Decks: tiles that ride on a moving frame, with all six degrees of freedom."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from smartmesh_ros.core import CORE
from smartmesh_ros.errors import InputError, as_float, require
from smartmesh_ros.terrain.checked_heights import checked_time, unmasked
from smartmesh_ros.terrain.grid import MAX_COORDINATE, FloatArray
from smartmesh_ros.terrain.tiles import MainMesh, Tiles

# Largest accepted difference between a quaternion's length and one.
QUATERNION_SLACK = 1e-3
LEVEL = (0.0, 0.0, 0.0, 1.0)
# Time for which a frame that was never moved has been at its place [s].
LONG_AGO = -1e9


def name_of_tile(deck: str, tile: str) -> str:
    """Return the name of a tile among all of a terrain: ``deck/tile``, or that of either if the other has none."""
    return "/".join(filter(None, (deck, tile)))


class Frame(NamedTuple):
    """A frame at an instant: ``position`` (3,) [m], ``rotation`` (3, 3) of its vectors into the world's, ``velocity``
    (3,) of its origin [m/s], and ``spin`` (3,), its angular velocity [rad/s], in the world."""

    position: FloatArray
    rotation: FloatArray
    velocity: FloatArray
    spin: FloatArray


class Deck(Tiles):
    """Tiles that ride on a frame: the deck of a ship, a lift, the bed of a truck, a bridge.

    The tiles are given in the frame's coordinates, and may move in it as all maps and meshes do. The frame is at rest
    at ``position`` [m] and ``orientation`` (x, y, z, w) in the terrain's frame until `move` moves it or a body carries
    it (`Ground.carry`).
    ``thickness`` [m]: a body whose middle is farther than this below the deck does not touch it. By default nothing
    passes below: the deck is solid down to any depth, as a height map at rest is.
    """

    _CORE = CORE.Deck

    def __init__(
        self,
        single: MainMesh | None = None,
        *,
        thickness: float = math.inf,
        position: ArrayLike = (0.0, 0.0, 0.0),
        orientation: ArrayLike = LEVEL,
    ) -> None:
        self.body, self.link, self._place = -1, -1, pose_of((0.0, 0.0, 0.0), LEVEL)
        self._last = -math.inf  # time of the last pose [s]; -infinity = it was never moved
        super().__init__(single)
        self.thickness = thickness
        self._put(-math.inf, pose_of(position, orientation))

    def __getstate__(self) -> dict[str, Any]:
        return {
            **super().__getstate__(), "thickness": self.thickness, "motion": self.core.memory(), "last": self._last,
            "carrier": (self.body, self.link, self._place),
        }  # fmt: skip

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Make a copy that moves on as the original does; nothing carries it."""
        self.take_state(state)
        self.ride(-1, -1, (0.0, 0.0, 0.0), LEVEL)

    def take_state(self, state: dict[str, Any]) -> None:
        """Be the deck of a state, with PyBullet's numbers of its carrier."""
        super().__setstate__(state)
        self.thickness, self._last = state["thickness"], float(state["last"])
        self.core.recall(state["motion"])
        body, link, place = state["carrier"]
        self.ride(body, link, place[:3], place[3:])

    def move(
        self,
        position: ArrayLike,
        orientation: ArrayLike = LEVEL,
        *,
        time: float,
        velocity: ArrayLike | None = None,
        spin: ArrayLike | None = None,
    ) -> None:
        """Note where the frame is at ``time`` [s]: its ``position`` [m] and ``orientation`` (x, y, z, w).

        From then on the frame moves with a constant acceleration and angular acceleration until the next call. Its
        motion is estimated from the last three poses; or from the last two velocities, if ``velocity`` [m/s] of the
        origin and ``spin`` [rad/s], both in the terrain's frame, are given. Accelerations that the change of velocity
        before does not confirm do not count, as of a frame that starts, stops or jolts. Without another call the frame
        slows down after 1.5 intervals, and rests after three more; the interval is the longest of the last ten between
        calls that were no pauses, of more than 0.25 s. A pose up to 1 us after the last replaces it: their times differ
        by rounding. Raises `InputError`, and changes nothing, if a number is impossible, or the time is before that of
        the last call.
        """
        time = checked_time(time)
        if time < self._last:
            raise InputError("time", f"the deck was moved at {self._last:g} s; a pose at {time:g} s is too late")
        if (velocity is None) != (spin is None):
            raise InputError("deck", "give both the velocity and the spin of a deck, or none of them")
        given = None
        if velocity is not None and spin is not None:
            given = np.concatenate([_vector(velocity, "the velocity"), _vector(spin, "the spin")])
        pose = pose_of(position, orientation)
        if math.isinf(self._last):
            self._put(time, pose, given)
            return
        self.core.move(time, pose, given)
        self._last = time

    def place(self, position: ArrayLike, orientation: ArrayLike = LEVEL, *, time: float) -> None:
        """Put the frame somewhere else at ``time`` [s], at rest."""
        self._put(checked_time(time), pose_of(position, orientation))

    def ride(self, body: int, link: int, position: ArrayLike, orientation: ArrayLike) -> None:
        """Let a PyBullet body or link carry the frame from now on, at a place in the frame of its centre of mass;
        ``body`` -1 = nobody. See `Ground.carry`."""
        place = pose_of(position, orientation)
        self.body, self.link, self._place = body, link, place
        self.core.carry(body, link, place)

    def frame(self, time: float) -> Frame:
        """Return the frame at ``time`` [s]."""
        found = np.asarray(self.core.frame(checked_time(time)))
        return Frame(found[0], found[1:4], found[4], found[5])

    def shift_time(self, by: float) -> None:
        """Add ``by`` [s] to the times of all maps and of the frame."""
        super().shift_time(by)
        self.shift_frame(by)

    def shift_frame(self, by: float) -> None:
        """Add ``by`` [s] to the times of the frame alone. Raises `InputError`."""
        by = checked_time(by)
        self._last += by
        self.core.shift_time(by)

    def moving(self, time: float) -> bool:
        """Return True if the frame may move at ``time`` [s]."""
        return bool(self.core.moves(checked_time(time)))

    @property
    def thickness(self) -> float:
        """How far below the deck the middle of a body is that still touches it [m], above zero; may be assigned."""
        return float(self.core.thickness)

    @thickness.setter
    def thickness(self, thickness: float) -> None:
        require(as_float(thickness) > 0.0, "thickness", "the thickness of a deck", thickness, "above zero [m]")
        self.core.thickness = float(thickness)

    def _put(self, time: float, pose: FloatArray, given: FloatArray | None = None) -> None:
        self._last = time
        self.core.put(max(time, LONG_AGO), pose, given)


def _floats(values: ArrayLike, what: str) -> FloatArray:
    """Return real numbers as an array; of what is none, an array without numbers."""
    array = unmasked(values, what)
    return np.ascontiguousarray(array if array.dtype.kind in "fiu" else (), np.float64)


def _vector(values: ArrayLike, what: str) -> FloatArray:
    found = _floats(values, what)
    good = found.shape == (3,) and np.abs(found).max() <= MAX_COORDINATE  # False for NaN
    require(bool(good), "deck", f"{what} of a deck", values, "three finite numbers")
    return found


def pose_of(position: ArrayLike, orientation: ArrayLike) -> FloatArray:
    """Return a pose (7,) of a deck; raises `InputError` if it is none."""
    quaternion = _floats(orientation, "the orientation")
    good = quaternion.shape == (4,) and abs(float(np.linalg.norm(quaternion)) - 1.0) <= QUATERNION_SLACK
    require(good, "quaternion", "the orientation of a deck", orientation, "a unit quaternion (x, y, z, w)")
    return np.concatenate([_vector(position, "the position"), quaternion])
