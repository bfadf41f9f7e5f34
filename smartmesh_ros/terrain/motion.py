"""Motion of the ground between maps.

Heights are extrapolated by the velocity and acceleration of each sample, both estimated from the maps so far. The
velocity is the difference quotient of the last two maps, valid at the midpoint between them, or comes with a map. The
acceleration is the difference quotient of velocities, limited by the acceleration before it. The limit avoids overshoot
where ground stops, jolts or jumps.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property
from typing import Literal, NamedTuple, get_args

import numpy as np

from smartmesh_ros.compiled import compiled
from smartmesh_ros.errors import InputError

MotionMode = Literal["hold", "extrapolate", "interpolate"]
# Meaning of a change of height: the ground moved, or a better estimate of static ground arrived.
Changes = Literal["motion", "correction"]


class Mode(IntEnum):
    """Motion modes as numbers for compiled functions."""

    HOLD = 0
    EXTRAPOLATE = 1
    INTERPOLATE = 2
    CORRECT = 3


# Age of the last map at which extrapolation ends, as a multiple of the age at which the next map is expected. Older
# ground returns to the last map at half its speed, because a sudden reset would teleport it. Raising this tolerates
# later maps, but overshoots further.
LATE_AFTER = 1.5
# Age of the last map at which the ground is at rest at the map's heights, as a multiple of the same age.
REST_AFTER = 3.0 * LATE_AFTER
# Limit of the acceleration, as a multiple of the acceleration before it.
AGREEMENT = 4.0
# Number of velocities stored for each sample. Three give two accelerations.
KEPT = 3
# Number of update intervals stored. The longest one defines when a map is late: several tolerate dropped maps and
# jitter, and ten suffice for bursts of five maps and the gaps between bursts.
INTERVALS_KEPT = 10

# Update times of a block of samples. ``time`` [s]: last update. ``opened`` [s]: first update that contributes to the
# newest velocity. ``lifetime`` [s]: longest expected time until the next update, 0 = at rest. ``delay`` [s]: expected
# age of an update on arrival. ``middle``, ``middle_1``, ``middle_2`` [s]: instants at which the velocities hold, newest
# first. ``known``: number of known velocities. ``newest``: index of the newest velocity in the ring buffer.
# ``intervals`` [s]: between the last ``count`` updates. ``updates``: number of updates so far.
CLOCK = np.dtype(
    (
        np.record,
        [
            ("time", np.float64),
            ("opened", np.float64),
            ("lifetime", np.float64),
            ("delay", np.float64),
            ("middle", np.float64),
            ("middle_1", np.float64),
            ("middle_2", np.float64),
            ("known", np.int64),
            ("newest", np.int64),
            ("intervals", np.float64, (INTERVALS_KEPT,)),
            ("count", np.int64),
            ("updates", np.int64),
        ],
    )
)
CLOCK_TIMES = ("time", "opened", "middle", "middle_1", "middle_2")  # fields that are instants


# A very short duration [s]. Instantaneous velocities are rises within it, divided by it.
INSTANT = 1e-9


@dataclass(frozen=True, kw_only=True)
class MotionConfig:
    """Motion of the ground between maps, which arrive at 10-60 Hz while physics runs faster.

    ``mode``: *hold* keeps the last map's heights, with its velocity; *extrapolate* also moves the heights with the
    velocity; *interpolate* moves from the second last to the last map, one map interval late.
    ``max_interval`` [s]: maps further apart than this give no velocity. The node does not extrapolate farther over a
    steady delay of maps either: the longer the extrapolation, the more it amplifies noise.
    ``max_velocity`` [m/s]: faster changes between two maps are jumps without velocity (a correction, a new crater).
    ``changes``: meaning of a change of height. *motion*: the ground moved, see ``mode``. *correction*: a better
    estimate of static ground arrived. Then the ground has no velocity.
    ``settle`` [s]: time in which a correction is blended in. By default a correction of 30 cm moves bodies on it by
    6 mm per step at 240 Hz; raising it makes that less.
    ``noise`` [m]: standard deviation of a map's heights, 0 = exact. In *correction* heights are fused over time; in
    *motion* velocities are denoised (see `noisy_motion`).
    ``min_interval`` [s]: maps that follow sooner are parts of one map: they correct the map before and give no velocity
    of their own. The default is a step at 240 Hz.
    """

    mode: MotionMode = "extrapolate"
    max_interval: float = 0.25
    max_velocity: float = 25.0
    changes: Changes = "motion"
    settle: float = 0.2
    noise: float = 0.0
    min_interval: float = 0.004

    def __post_init__(self) -> None:
        if self.mode not in get_args(MotionMode):
            raise InputError(
                "parameter", f"terrain motion {self.mode!r} is unknown; choose {', '.join(get_args(MotionMode))}"
            )
        if not self.max_interval > 0.0 or not self.max_velocity > 0.0:
            raise InputError("parameter", "terrain max_interval [s] and max_velocity [m/s] must be greater than zero")
        if self.changes not in get_args(Changes):
            raise InputError(
                "parameter", f"terrain changes {self.changes!r} is unknown; choose {', '.join(get_args(Changes))}"
            )
        if not 0.0 <= self.min_interval < self.max_interval:
            raise InputError("parameter", "terrain min_interval [s] must be at least zero and less than max_interval")
        if not (0.0 < self.settle < math.inf and 0.0 <= self.noise < math.inf):
            raise InputError("parameter", "terrain settle [s] must be above zero, and noise [m] at least zero")

    @property
    def corrects(self) -> bool:
        """True if a change of height is a correction."""
        return self.changes == "correction"

    @cached_property
    def code(self) -> int:
        """The `Mode` for compiled functions."""
        if self.corrects:
            return int(Mode.CORRECT)
        return int(Mode[self.mode.upper()])


class Phase(NamedTuple):
    """Coefficients of the motion at one instant.

    Height above the last map: ``velocity * along + acceleration * bend``. Its rate: ``velocity * rate + acceleration *
    bend_rate``. That rate changes by ``acceleration * curve`` per second and ends after a time ``left`` [s].
    ``inverse``, ``inverse_1`` [1/s]: reciprocals of the times between the velocities, newest first, zero = unknown.
    """

    along: float
    bend: float
    rate: float
    bend_rate: float
    curve: float
    left: float
    inverse: float
    inverse_1: float


AT_REST = Phase(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@compiled
def phase_of(time: float, last: float, lifetime: float, lag: float, mode: int, delay: float = 0.0) -> tuple[float, ...]:
    """Return the first six fields of `Phase` at ``time`` [s].

    ``last``: time of the last map [s]. ``lifetime``: expected time until the next map [s]; the motion continues while
    maps arrive in time. ``lag``: the velocity holds at this time before the last map [s]. ``delay``: expected age of
    the next map on arrival [s].
    """
    age = time - last
    late_after = LATE_AFTER * (lifetime + delay)
    if lifetime <= 0.0:
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    if mode == Mode.HOLD:
        return 0.0, 0.0, 1.0 if age <= late_after else 0.0, 0.0, 0.0, math.inf
    if mode == Mode.INTERPOLATE:
        span = 2.0 * lag if lag > 0.0 else lifetime  # time between the last two maps
        age -= delay
        return min(max(age - span, -span), 0.0), 0.0, 1.0 if 0.0 <= age < span else 0.0, 0.0, 0.0, math.inf
    if age <= late_after:
        age = max(age, -lifetime)
        return age, 0.5 * age * (age + 2.0 * lag), 1.0, age + lag, 1.0, math.inf
    bend = 0.5 * late_after * (late_after + 2.0 * lag)
    share = 1.0 - 0.5 * (age - late_after) / late_after
    if share <= 0.0:
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    return late_after * share, bend * share, -0.5, -0.5 * bend / late_after, 0.0, 2.0 * late_after * share


@compiled
def block_phase(clock, time, mode):
    """Return the `Phase` of a block at ``time`` [s]; ``clock``: a record of ``CLOCK``."""
    if clock.known == 0:
        return AT_REST
    along, bend, rate, bend_rate, curve, left = phase_of(
        time, clock.time, clock.lifetime, clock.time - clock.middle, mode, clock.delay
    )
    if clock.known < KEPT or mode != Mode.EXTRAPOLATE:
        return Phase(along, 0.0, rate, 0.0, 0.0, left, 0.0, 0.0)
    inverse, inverse_1 = 1.0 / (clock.middle - clock.middle_1), 1.0 / (clock.middle_1 - clock.middle_2)
    return Phase(along, bend, rate, bend_rate, curve, left, inverse, inverse_1)


@compiled
def agreed(change: float, before: float) -> float:
    """Return a ``change`` limited to AGREEMENT times the one ``before``; zero if their signs differ."""
    if change * before <= 0.0:
        return 0.0
    most = AGREEMENT * abs(before)
    return change if abs(change) <= most else math.copysign(most, change)


@compiled
def motion_of(
    velocity: float, velocity_1: float, velocity_2: float, phase: Phase, max_velocity: float
) -> tuple[float, float]:
    """Return the velocity [m/s] and acceleration [m/s^2] of a sample from its velocities, newest first [m/s].

    A velocity that is NaN (the sample is or was a hole) or above ``max_velocity`` (a jump) counts as no motion.
    """
    if not abs(velocity) <= max_velocity:
        return 0.0, 0.0
    if phase.inverse == 0.0 or not (abs(velocity_1) <= max_velocity and abs(velocity_2) <= max_velocity):
        return velocity, 0.0
    return velocity, agreed((velocity - velocity_1) * phase.inverse, (velocity_1 - velocity_2) * phase.inverse_1)


@compiled
def displacement(velocity: float, acceleration: float, phase: Phase) -> float:
    """Return the height of a sample above the last map [m]."""
    return velocity * phase.along + acceleration * phase.bend


@compiled
def rise_of(velocity: float, acceleration: float, phase: Phase, duration: float) -> float:
    """Return the rise of a sample [m] within a ``duration`` [s]."""
    lasts = min(duration, phase.left)
    return velocity * phase.rate * lasts + acceleration * lasts * (phase.bend_rate + 0.5 * phase.curve * lasts)
