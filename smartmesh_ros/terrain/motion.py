"""Motion of the ground between maps.

Heights are extrapolated by the velocity and acceleration of each sample, both estimated from the maps so far. The
velocity is the difference quotient of the last two maps, valid at the midpoint between them, or comes with a map. The
acceleration is the difference quotient of velocities, limited by the acceleration before it. The limit avoids overshoot
where ground stops, jolts or jumps. ``core/map/motion.h`` has the law.

A correction of static ground has no velocity: the shown heights change linearly from the old estimate to the new one.
The caller that steps the physics sets the instant, so that the ground and the bodies on it move together.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property
from typing import Any, Literal, Self, get_args

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.core import CORE
from smartmesh_ros.errors import InputError, as_float, require, require_choice
from smartmesh_ros.terrain.checked_heights import checked_time
from smartmesh_ros.terrain.state_file import filled

MotionMode = Literal["hold", "extrapolate", "interpolate"]
# Meaning of a change of height: the ground moved, or a better estimate of static ground arrived.
Changes = Literal["motion", "correction"]


class Mode(IntEnum):
    """The motion modes, and CORRECT for corrections, as the core numbers them."""

    HOLD = 0
    EXTRAPOLATE = 1
    INTERPOLATE = 2
    CORRECT = 3


# Number of velocities stored for each sample. Three give two accelerations.
KEPT = 3
# Number of update intervals stored. The longest one defines when a map is late: several tolerate dropped maps and
# jitter, and ten suffice for bursts of five maps and the gaps between bursts.
INTERVALS_KEPT = 10

# Side of the square blocks of samples that share one clock [samples], a power of two, and its exponent.
BLOCK_SHIFT = 6
BLOCK = 1 << BLOCK_SHIFT
# Update times of a block of samples. ``time`` [s]: last update. ``opened`` [s]: first update that contributes to the
# newest velocity. ``lifetime`` [s]: longest expected time until the next update, 0 = at rest. ``delay`` [s]: expected
# age of an update on arrival. ``middle``, ``middle_1``, ``middle_2`` [s]: instants at which the velocities hold, newest
# first. ``since``, ``until`` [s]: between these instants the ground goes over from what was shown before the last map
# to the motion of that map. ``known``: number of known velocities. ``newest``: index of the newest velocity in the ring
# buffer. ``intervals`` [s]: between the last ``count`` updates. ``updates``: number of updates so far.
_NAMES, _TYPES, _PLACES = zip(*CORE.CLOCK, strict=True)
_CLOCK = np.dtype({"names": _NAMES, "formats": _TYPES, "offsets": _PLACES})
CLOCK: np.dtype[Any] = np.dtype((np.record, _CLOCK))
CLOCK_TIMES = ("time", "opened", "middle", "middle_1", "middle_2", "since", "until")  # fields that are instants


# Longest time in which ground may go over to the motion of a new map [map intervals]. Ground rests that much later.
MOST_SMOOTHING = 10.0

# A very short duration [s]. Instantaneous velocities are rises within it, divided by it.
INSTANT = 1e-9


@dataclass(frozen=True, kw_only=True)
class MotionConfig:
    """Motion of the ground between maps, which arrive at 10-60 Hz while physics runs faster.

    ``mode``: *hold* keeps the last map's heights, with its velocity; *extrapolate* also moves the heights with the
    velocity and acceleration; *interpolate* follows the maps one map interval late, on cubics through their heights and
    velocities.
    ``smoothing`` [map intervals]: time in which extrapolated ground goes over to the motion of a new map. At zero its
    height and velocity jump with each map, and so do the forces on bodies; raising it makes the forces smoother and the
    place of curved motion less exact.
    ``max_interval`` [s]: maps further apart than this give no velocity. The node does not extrapolate farther over a
    steady delay of maps either: the longer the extrapolation, the more it amplifies noise.
    ``max_velocity`` [m/s]: faster changes between two maps are jumps without velocity (a correction, a new crater).
    ``changes``: meaning of a change of height. *motion*: the ground moved, see ``mode``. *correction*: a better
    estimate of static ground arrived. Then the ground has no velocity.
    ``settle`` [s]: time in which a correction is blended in. By default a correction of 30 cm moves bodies on it by
    6 mm per step at 240 Hz; raising it makes that less.
    ``noise`` [m]: standard deviation of a map's heights, 0 = exact. In *correction* heights are fused over time; in
    *motion* velocities are denoised (see ``core/map/noisy_motion.cpp``).
    ``min_interval`` [s]: maps that follow sooner are parts of one map: they correct the map before and give no velocity
    of their own. The default is a step at 240 Hz.
    """

    mode: MotionMode = "extrapolate"
    smoothing: float = 0.0
    max_interval: float = 0.25
    max_velocity: float = 25.0
    changes: Changes = "motion"
    settle: float = 0.2
    noise: float = 0.0
    min_interval: float = 0.004

    def __post_init__(self) -> None:
        for name in ("smoothing", "max_interval", "max_velocity", "settle", "noise", "min_interval"):
            object.__setattr__(self, name, as_float(getattr(self, name)))  # what is no number becomes NaN
        require_choice(self.mode, get_args(MotionMode), "parameter", "terrain motion")
        for name, good, wanted in (
            ("smoothing", 0.0 <= self.smoothing <= MOST_SMOOTHING, f"0 to {MOST_SMOOTHING} [map intervals]"),
            ("max_interval", self.max_interval > 0.0, "greater than zero [s]"),
            ("max_velocity", self.max_velocity > 0.0, "greater than zero [m/s]"),
            ("min_interval", 0.0 <= self.min_interval < self.max_interval, "zero or more, below max_interval [s]"),
            ("settle", 0.0 < self.settle < math.inf, "above zero [s]"),
            ("noise", 0.0 <= self.noise < math.inf, "zero or more [m]"),
        ):
            require(good, "parameter", f"terrain {name}", getattr(self, name), wanted)
        require_choice(self.changes, get_args(Changes), "parameter", "terrain changes")

    @property
    def corrects(self) -> bool:
        """True if a change of height is a correction."""
        return self.changes == "correction"

    @property
    def blends(self) -> bool:
        """True if ground goes over to the motion of a new map in a while, and does not jump."""
        return not self.corrects and (self.mode == "interpolate" or (self.mode == "extrapolate" and self.smoothing > 0))

    @cached_property
    def code(self) -> int:
        """The `Mode` as a number."""
        if self.corrects:
            return int(Mode.CORRECT)
        return int(Mode[self.mode.upper()])


def checked_motion(motion: MotionConfig | None) -> MotionConfig:
    """Return a motion, by default the usual one; raises `InputError` if it is none."""
    if motion is not None and not isinstance(motion, MotionConfig):
        raise InputError("parameter", f"the motion of the ground is {motion!r}; pass MotionConfig(mode=...)")
    return motion or MotionConfig()


def next_revision() -> int:
    """Return a number higher than all revisions before, of the core's maps too."""
    return int(CORE.next_revision())


class MovingGround(ABC):
    """What height maps and meshes have in common: their motion between updates, and the clocks of these.

    ``version``: number of updates. ``revision``: changes with every update.
    """

    version: int
    core_reader: Any
    _motion: MotionConfig
    _velocities: NDArray[Any]
    _offsets: NDArray[Any]
    _rates: NDArray[Any]
    _clocks: NDArray[np.void]  # records of ``CLOCK``

    @abstractmethod
    def _set_motion(self) -> None:
        """Set the motion in the core."""

    @property
    @abstractmethod
    def revision(self) -> int:
        """Revision of the last change."""

    def become(self, other: Self) -> None:
        """Be another one, which must not be used any more."""
        vars(self).clear()
        vars(self).update(vars(other))

    @property
    def motion(self) -> MotionConfig:
        """Motion of the ground between updates."""
        return self._motion

    @motion.setter
    def motion(self, motion: MotionConfig) -> None:
        motion = checked_motion(motion)
        if (motion.code, motion.smoothing) != (self._motion.code, self._motion.smoothing):
            self._clocks["until"] = self._clocks["since"]  # what was shown by other settings is no part of the motion
        self._motion = motion
        self._set_motion()

    def _moving_state(self) -> dict[str, Any]:
        """Return what copies and saved states have of the motion."""
        # Arrays of zeros take no memory, and no bytes.
        moving = tuple(array if array.any() else None for array in (self._velocities, self._offsets, self._rates))
        shown = float(self.core_reader.shown)
        return {"moving": moving, "clocks": self._clocks, "version": self.version, "shown": shown}

    def _take_moving(self, state: dict[str, Any]) -> None:
        """Take the motion of such a state, but for what is shown; raises `InputError` if it is none of this ground."""
        for array, kept in zip((self._velocities, self._offsets, self._rates), state["moving"], strict=True):
            if kept is not None:
                filled(array, kept)
        self.version = state["version"]
        filled(self._clocks, state["clocks"])
        known = self._clocks
        if (
            not ((known["newest"] >= 0) & (known["newest"] < KEPT) & (known["known"] >= 0)).all()
            or not ((known["count"] >= 0) & (known["count"] <= INTERVALS_KEPT)).all()
        ):
            raise InputError("state", "a clock of a saved map names a velocity or an interval that is not there")

    @property
    def time(self) -> float:
        """Time of the newest update [s]."""
        return float(self._clocks["time"].max())

    @property
    def delay(self) -> float:
        """Expected age of an update on arrival [s]; extrapolation continues until the update is due."""
        return float(self._clocks["delay"].flat[0])

    @delay.setter
    def delay(self, delay: float) -> None:
        self._clocks["delay"] = checked_time(delay)

    def shift_time(self, by: float) -> None:
        """Add ``by`` [s] to all update times, after their clock was reset or lost time. Raises `InputError`."""
        by = checked_time(by)
        for name in CLOCK_TIMES:
            self._clocks[name] += by
