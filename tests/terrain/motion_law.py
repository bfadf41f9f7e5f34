"""The law by which the ground moves between exact maps, in plain Python: what the core's reader must give to the bit.

The reasons for it are in core/map/motion.h and core/map/motion.cpp. What noise changes of it is in test_motion.py.
"""

import math
from typing import Any, NamedTuple

from smartmesh_ros.terrain.motion import BLOCK_SHIFT, KEPT, Mode

LATE_AFTER, REST_AFTER, AGREEMENT, SMOOTH = 1.5, 4.5, 4.0, 0.25


class Phase(NamedTuple):
    """Coefficients of the motion at one instant.

    Height above the last map: ``velocity * along + acceleration * bend``. Its rate: ``velocity * rate + acceleration *
    bend_rate``. That rate changes by ``acceleration * curve`` per second and ends after a time ``left`` [s].
    ``inverse``, ``inverse_1`` [1/s]: reciprocals of the times between the velocities, newest first, zero = unknown.
    ``lag``, ``third`` [s]: weights of a third-order velocity, zero = second order.
    """

    along: float = 0.0
    bend: float = 0.0
    rate: float = 0.0
    bend_rate: float = 0.0
    curve: float = 0.0
    left: float = 0.0
    inverse: float = 0.0
    inverse_1: float = 0.0
    lag: float = 0.0
    third: float = 0.0


class Blend(NamedTuple):
    """Weights of a deviation and of its rate [s], and their rises within a time ahead."""

    offset: float = 0.0
    rate: float = 0.0
    offset_change: float = 0.0
    rate_change: float = 0.0


AT_REST = Phase()


def extrapolated(age: float, late_after: float, lag: float) -> Phase:
    """The phase at an ``age`` [s] of ground that returns from the age ``late_after`` [s] on."""
    if age <= late_after:
        return Phase(age, 0.5 * age * (age + 2.0 * lag), 1.0, age + lag, 1.0, math.inf)
    bend = 0.5 * late_after * (late_after + 2.0 * lag)
    share = 1.0 - 0.5 * (age - late_after) / late_after
    if share <= 0.0:
        return AT_REST
    return Phase(late_after * share, bend * share, -0.5, -0.5 * bend / late_after, 0.0, 2.0 * late_after * share)


def phase_of(time: float, last: float, lifetime: float, lag: float, mode: int, delay: float = 0.0) -> Phase:
    """The phase of ground whose last map came at ``last`` [s] and whose next one is due after ``lifetime`` [s]. The
    velocity holds ``lag`` [s] before the last map. ``delay`` [s]: expected age of the next map on arrival."""
    age, due = time - last, lifetime + delay
    if lifetime <= 0.0:
        return AT_REST
    if mode == Mode.HOLD:
        return Phase(rate=1.0 if age <= LATE_AFTER * due else 0.0, left=math.inf)
    if mode == Mode.INTERPOLATE:
        return extrapolated(max(age - due, -due), (LATE_AFTER - 1.0) * due, lag)
    return extrapolated(max(age, -lifetime), LATE_AFTER * due, lag)


def block_phase(clock: Any, time: float, mode: int) -> Phase:
    """The phase of a block with this record of ``CLOCK``."""
    if clock.known == 0:
        return AT_REST
    lag, lifetime = clock.time - clock.middle, clock.lifetime
    phase = phase_of(time, clock.time, lifetime, lag, mode, clock.delay)
    if mode == Mode.INTERPOLATE and lifetime > 0.0:
        age = max(time, clock.since) - clock.until
        phase = extrapolated(age, (LATE_AFTER - 1.0) * (lifetime + clock.delay), lag)
    if clock.known < KEPT or mode == Mode.HOLD:
        return phase._replace(bend=0.0, bend_rate=0.0, curve=0.0)
    phase = phase._replace(
        inverse=1.0 / (clock.middle - clock.middle_1), inverse_1=1.0 / (clock.middle_1 - clock.middle_2)
    )
    if mode == Mode.INTERPOLATE:
        third = lag * (clock.middle - clock.middle_1) / (lag + (clock.middle_1 - clock.middle_2))
        phase = phase._replace(lag=lag, third=third)
    return phase


def blend_of(clock: Any, time: float, ahead: float) -> Blend:
    """The weights at ``time`` [s]: cubics from one to zero between the clock's ``since`` and ``until``."""
    span = clock.until - clock.since
    if not span > 0.0 or time >= clock.until:
        return Blend()
    now = max(time - clock.since, 0.0) / span
    then = min(now + ahead / span, 1.0)
    if not now < 1.0:
        return Blend()
    step, middle, left = then - now, 0.5 * (now + then), 1.0 - now
    return Blend(
        left * left * (1.0 + 2.0 * now), span * now * left * left,
        step * (6.0 * middle * (middle - 1.0) + 0.5 * step * step),
        span * step * (1.0 + middle * (3.0 * middle - 4.0) + 0.25 * step * step),
    )  # fmt: skip


def agreed(change: float, before: float) -> float:
    """A change limited to AGREEMENT times the one before; zero if their signs differ."""
    if change * before <= 0.0:
        return 0.0
    most = AGREEMENT * abs(before)
    return change if abs(change) <= most else math.copysign(most, change)


def motion_of(
    velocity: float, velocity_1: float, velocity_2: float, phase: Phase, max_velocity: float
) -> tuple[float, float]:
    """Velocity [m/s] and acceleration [m/s^2] of a sample from its velocities, newest first [m/s]. A velocity that is
    NaN (the sample is or was a hole) or above ``max_velocity`` (a jump) counts as no motion."""
    if not abs(velocity) <= max_velocity:
        return 0.0, 0.0
    if phase.inverse == 0.0 or not (abs(velocity_1) <= max_velocity and abs(velocity_2) <= max_velocity):
        return velocity, 0.0
    change, change_1 = (velocity - velocity_1) * phase.inverse, (velocity_1 - velocity_2) * phase.inverse_1
    limited = agreed(change, change_1)
    since_then = change * phase.lag + (change - change_1) * phase.third
    if phase.third == 0.0 or (change != limited and abs(since_then) > SMOOTH * abs(velocity)):
        return velocity, limited
    return velocity + (since_then - limited * phase.lag), limited


def displacement(velocity: float, acceleration: float, phase: Phase) -> float:
    """Height of a sample above the last map [m]."""
    return velocity * phase.along + acceleration * phase.bend


def rise_of(velocity: float, acceleration: float, phase: Phase, duration: float) -> float:
    """Rise of a sample [m] within a duration [s]."""
    lasts = min(duration, phase.left)
    return velocity * phase.rate * lasts + acceleration * lasts * (phase.bend_rate + 0.5 * phase.curve * lasts)


def remaining(clock: Any, shown: float, settle: float) -> float:
    """Share of a block's correction that is not blended in yet."""
    elapsed = shown - clock.middle
    return 1.0 - max(elapsed, 0.0) / settle if elapsed < settle else 0.0


def sample_at(grid: Any, row: int, column: int, time: float, ahead: float) -> tuple[float, float]:
    """Height [m] of a sample of a height map at ``time`` [s] and its rise [m] within the time ``ahead`` [s]."""
    height = grid.z + float(grid.heights[row, column])
    offset, rate = float(grid.offsets[row, column]), float(grid.rates[row, column])
    clock = grid.clocks[row >> BLOCK_SHIFT, column >> BLOCK_SHIFT]
    if grid.mode == Mode.CORRECT:
        return height + remaining(clock, grid.shown, grid.settle) * offset, 0.0
    if clock.known == 0:
        return height, 0.0
    phase, blend = block_phase(clock, time, grid.mode), Blend()
    if grid.mode == Mode.INTERPOLATE or (grid.mode == Mode.EXTRAPOLATE and grid.smoothing > 0.0):
        blend = blend_of(clock, time, ahead)
    ring = [float(grid.velocities[(clock.newest - back) % KEPT, row, column]) for back in range(KEPT)]
    motion = motion_of(ring[0], ring[1], ring[2], phase, grid.max_velocity)
    deviation = blend.offset * offset + blend.rate * rate
    rise = rise_of(*motion, phase, ahead) + (blend.offset_change * offset + blend.rate_change * rate)
    return height + displacement(*motion, phase) + deviation, rise
