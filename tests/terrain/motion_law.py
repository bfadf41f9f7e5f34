"""The law by which the ground moves between maps, in plain Python: what the core's reader must give to the bit.

The reasons for it are in core/map/motion.h, core/map/motion.cpp and core/map/noisy_motion.h.
"""

import math
from typing import Any, NamedTuple

from smartmesh_ros.terrain.motion import BLOCK_SHIFT, KEPT, Mode

LATE_AFTER, REST_AFTER, AGREEMENT, SMOOTH = 1.5, 4.5, 4.0, 0.25
HALF_WINDOW, SCATTER_MARGIN = 2, 2.0


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


def acceleration_variance(later: float, earlier: float, noise: float) -> float:
    """Variance of an acceleration [m^2/s^4] from three heights and the intervals between them [s]."""
    if not (later > 0.0 and earlier > 0.0):
        return math.inf
    a, b, c = noise / later, noise / earlier, 2.0 / (later + earlier)
    return (a * a + b * b + (a + b) * (a + b)) * (c * c)


def noise_variances(clock: Any, noise: float) -> tuple[float, float, float]:
    """Variances of a velocity and of the accelerations from the newest two velocities and from the two before; zero
    for given velocities."""
    first = 2.0 * (clock.time - clock.middle)
    second = 2.0 * (clock.middle - clock.middle_1) - first
    third = 2.0 * (clock.middle_1 - clock.middle_2) - second
    if not first > 0.0:
        return 0.0, 0.0, 0.0
    speed = noise / first
    return (
        2.0 * (speed * speed), acceleration_variance(first, second, noise), acceleration_variance(second, third, noise)
    )  # fmt: skip


def signal_share(power: float, noise: float) -> float:
    """Share of a power that noise does not explain."""
    return 1.0 - noise / power if power > noise else 0.0


def denoised(value: float, pairs: list[tuple[float, float]], variance: float) -> float:
    """A value shrunk by the noise of a ``variance``. ``pairs``: values on opposite sides, relative to it."""
    if variance == 0.0:
        return value
    count, total, squares = len(pairs), 0.0, 0.0
    for one, other in pairs:
        mean = 0.5 * (one + other)
        total += mean
        squares += mean * mean
    beyond = 2.0 * total / (2 * count + 1)
    mean = value + beyond
    scatter = 2.0 * (squares - total * total / count) / (count - 1) if count > 1 else 0.0
    together = signal_share(mean * mean, variance / (2 * count + 1))
    return together * mean - signal_share(scatter, SCATTER_MARGIN * variance) * beyond


def motion_in_noise(grid: Any, row: int, column: int, clock: Any, phase: Phase) -> tuple[float, float]:
    """Velocity [m/s] and acceleration [m/s^2] of a sample of a noisy height map."""
    ring = [(clock.newest - back) % KEPT for back in range(KEPT)]

    def read(r: int, c: int) -> list[float]:
        values = (float(grid.velocities[slot, r, c]) for slot in ring)
        return [value if abs(value) <= grid.max_velocity else math.nan for value in values]

    def together(r: int, c: int) -> bool:
        if not (0 <= r < grid.heights.shape[0] and 0 <= c < grid.heights.shape[1]):
            return False
        other = grid.clocks[r >> BLOCK_SHIFT, c >> BLOCK_SHIFT]
        return bool((other.time, other.middle, other.newest) == (clock.time, clock.middle, clock.newest))

    v0, v1, v2 = read(row, column)
    if math.isnan(v0):
        return 0.0, 0.0
    change, change_1 = (v0 - v1) * phase.inverse, (v1 - v2) * phase.inverse_1
    bends = phase.inverse != 0.0 and not math.isnan(change + change_1)
    speeds, changes, changes_1 = [], [], []
    for a in range(HALF_WINDOW + 1):
        for b in range(-HALF_WINDOW if a > 0 else 1, HALF_WINDOW + 1):
            if not (together(row + a, column + b) and together(row - a, column - b)):
                continue
            p0, p1, p2 = read(row + a, column + b)
            q0, q1, q2 = read(row - a, column - b)
            if math.isnan(p0 + q0):
                continue
            speeds.append((p0 - v0, q0 - v0))
            if bends and not math.isnan(p1 + p2 + q1 + q2):
                changes.append(((p0 - p1) * phase.inverse - change, (q0 - q1) * phase.inverse - change))
                changes_1.append(((p1 - p2) * phase.inverse_1 - change_1, (q1 - q2) * phase.inverse_1 - change_1))
    of_velocity, of_change, of_change_1 = noise_variances(clock, grid.noise)
    velocity = denoised(v0, speeds, of_velocity)
    if not bends:
        return velocity, 0.0
    return velocity, agreed(denoised(change, changes, of_change), denoised(change_1, changes_1, of_change_1))


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
    if grid.noise > 0.0:
        motion = motion_in_noise(grid, row, column, clock, phase)
    else:
        ring = [float(grid.velocities[(clock.newest - back) % KEPT, row, column]) for back in range(KEPT)]
        motion = motion_of(ring[0], ring[1], ring[2], phase, grid.max_velocity)
    deviation = blend.offset * offset + blend.rate * rate
    rise = rise_of(*motion, phase, ahead) + (blend.offset_change * offset + blend.rate_change * rate)
    return height + displacement(*motion, phase) + deviation, rise
