"""What the ground does between maps: the only place where ground is moved on in time.

A sample moves on with its velocity and acceleration, both told by the maps so far. Velocity is the difference of the
last two maps, which holds for the middle of the time between them, or is given with a map. Acceleration is the change
of velocity; it counts only as far as the change before agrees with it, so that ground that stops, jolts or jumps is not
carried past its velocity.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntEnum
from typing import Literal, NamedTuple, get_args

import numpy as np

from smartmesh_ros.compiled import compiled
from smartmesh_ros.errors import InputError

MotionMode = Literal["hold", "extrapolate", "interpolate"]
# What a change of height means: the ground moved, or stood still and is known better now.
Changes = Literal["motion", "correction"]


class Mode(IntEnum):
    """Motion modes as compiled functions know them."""

    HOLD = 0
    EXTRAPOLATE = 1
    INTERPOLATE = 2
    CORRECT = 3


# The source is late, not gone, until an age of LATE_AFTER map intervals; extrapolation then runs back to the last map
# at half the ground's speed, so that nothing is ever teleported.
LATE_AFTER = 1.5
# After an age of REST_AFTER map intervals the ground is at rest at the last map's heights.
REST_AFTER = 3.0 * LATE_AFTER
# The acceleration of the ground counts up to this multiple of the one before it.
AGREEMENT = 4.0
# Velocities that are kept of each sample: the newest and the two before it tell two accelerations.
KEPT = 3
# Times between updates that are looked back on. More than one, so that drops and jitter do not make the source late;
# enough for bursts of five and the gaps between them.
INTERVALS_KEPT = 10

# When a block of samples was updated. ``time`` [s]: last update; ``opened`` [s]: the first one that the newest
# velocity is told by; ``lifetime`` [s]: longest time to expect until the next, 0 = at rest; ``middle``, ``middle_1``,
# ``middle_2`` [s]: instants that the velocities hold for, newest first; ``known``: how many of them are known;
# ``newest``: where in the ring of KEPT velocities the newest is; ``intervals`` [s]: between the last ``count`` updates.
CLOCK = np.dtype(
    [
        ("time", np.float64),
        ("opened", np.float64),
        ("lifetime", np.float64),
        ("middle", np.float64),
        ("middle_1", np.float64),
        ("middle_2", np.float64),
        ("known", np.int64),
        ("newest", np.int64),
        ("intervals", np.float64, (INTERVALS_KEPT,)),
        ("count", np.int64),
    ]
)
CLOCK_TIMES = ("time", "opened", "middle", "middle_1", "middle_2")  # its fields that are instants


@dataclass(frozen=True, kw_only=True)
class MotionConfig:
    """How a map that arrives at 10-60 Hz moves under faster physics.

    ``mode``: *hold* keeps the last map's heights and carries its velocity; *extrapolate* also moves the heights on;
    *interpolate* runs from the map before to the last one, one map late.
    ``max_interval`` [s]: maps further apart than this say nothing about velocity.
    ``max_velocity`` [m/s]: ground that moves faster between two maps has jumped (a correction, a new crater).
    ``changes``: what a change of height means. *motion*: the ground moved, as ``mode`` says. *correction*: it stood
    still and is known better now; then it has no velocity, and ``settle`` [s] is how long the old heights take to
    become the new ones: a correction of 30 cm moves what stands on it by 6 mm in a step of 240 Hz.
    ``noise`` [m]: standard deviation of the heights of a map, 0 = exact. In *correction* heights are fused over time;
    in *motion* velocities count as far as they stand out of what the noise makes (see `noisy_motion`).
    ``min_interval`` [s]: maps that come sooner after each other are one that came in parts: they correct the one
    before and have no velocity of their own. By default that is a step of 240 Hz.
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
        """Whether a change of height is a correction."""
        return self.changes == "correction"

    @property
    def code(self) -> int:
        """What the ground does, as compiled functions know it."""
        if self.corrects:
            return int(Mode.CORRECT)
        return int(Mode[self.mode.upper()])


class Phase(NamedTuple):
    """How far ground is along its motion: it is ``velocity * along + acceleration * bend`` higher than the map, and
    rises at ``velocity * rate + acceleration * bend_rate``, which goes on for a time ``left`` [s] and changes by
    ``acceleration * curve`` a second. ``inverse``, ``inverse_1`` [1/s]: one over the times between the velocities,
    newest first, zero where they are not known."""

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
def phase_of(time: float, last: float, lifetime: float, lag: float, mode: int) -> tuple[float, ...]:
    """The first six of `Phase` at ``time`` [s], of ground whose ``last`` map is due again after ``lifetime`` [s], and
    whose velocity holds for ``lag`` [s] before that map. As long as maps come in time the ground is taken to go on."""
    age = time - last
    late_after = LATE_AFTER * lifetime
    if lifetime <= 0.0:
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    if mode == Mode.HOLD:
        return 0.0, 0.0, 1.0 if age <= late_after else 0.0, 0.0, 0.0, math.inf
    if mode == Mode.INTERPOLATE:
        span = 2.0 * lag if lag > 0.0 else lifetime  # from the map before to the last one
        return min(max(age - span, -span), 0.0), 0.0, 1.0 if age < span else 0.0, 0.0, 0.0, math.inf
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
    """The `Phase` of a block, a record of ``CLOCK``, at ``time`` [s]."""
    if clock.known == 0:
        return AT_REST
    along, bend, rate, bend_rate, curve, left = phase_of(
        time, clock.time, clock.lifetime, clock.time - clock.middle, mode
    )
    if clock.known < KEPT or mode != Mode.EXTRAPOLATE:
        return Phase(along, 0.0, rate, 0.0, 0.0, left, 0.0, 0.0)
    inverse, inverse_1 = 1.0 / (clock.middle - clock.middle_1), 1.0 / (clock.middle_1 - clock.middle_2)
    return Phase(along, bend, rate, bend_rate, curve, left, inverse, inverse_1)


@compiled
def agreed(change: float, before: float) -> float:
    """A ``change`` as far as the one ``before`` agrees: none if it points the other way."""
    if change * before <= 0.0:
        return 0.0
    most = AGREEMENT * abs(before)
    return change if abs(change) <= most else math.copysign(most, change)


@compiled
def motion_of(
    velocity: float, velocity_1: float, velocity_2: float, phase: Phase, max_velocity: float
) -> tuple[float, float]:
    """Velocity [m/s] and acceleration [m/s^2] of a sample. Its velocities newest first [m/s]; NaN (it is or was a hole)
    or faster than ``max_velocity`` (it has jumped) is no motion."""
    if not abs(velocity) <= max_velocity:
        return 0.0, 0.0
    if phase.inverse == 0.0 or not (abs(velocity_1) <= max_velocity and abs(velocity_2) <= max_velocity):
        return velocity, 0.0
    return velocity, agreed((velocity - velocity_1) * phase.inverse, (velocity_1 - velocity_2) * phase.inverse_1)


@compiled
def displacement(velocity: float, acceleration: float, phase: Phase) -> float:
    """How much higher than its map a sample of such a motion is [m]."""
    return velocity * phase.along + acceleration * phase.bend


@compiled
def rise_of(velocity: float, acceleration: float, phase: Phase, duration: float) -> float:
    """How much a sample of such a motion rises in a ``duration`` [s] [m]."""
    lasts = min(duration, phase.left)
    return velocity * phase.rate * lasts + acceleration * lasts * (phase.bend_rate + 0.5 * phase.curve * lasts)
