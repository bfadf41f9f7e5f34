"""Estimation of ground velocity from noisy heights: each velocity is shrunk by the share that noise explains.

Without this filter, noise of 1 mm at 60 Hz becomes velocity noise of 8 cm/s, and the ground throws bodies. Noise
differs between neighbouring samples, while motion hardly does. So the velocity of a sample is split into the mean of
the samples around it and the deviation from that mean. Each part is multiplied by the share of its power that noise of
the known variance does not explain, as in Lee's filter (*Digital Image Enhancement and Noise Filtering by Use of Local
Statistics*, 1980). Unlike there, the mean is shrunk too, so that static ground stays at rest.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from smartmesh_ros.compiled import compiled
from smartmesh_ros.terrain.correction import BLOCK_SHIFT
from smartmesh_ros.terrain.motion import KEPT, agreed

# Half width of the window [samples]. The mean over 25 samples has a fifth of the noise; raising it smooths more.
HALF_WINDOW = 2
# Scatter below this multiple of the noise variance counts as noise, because the estimate of the scatter of so few
# values is itself uncertain by two fifths. Raising it suppresses more noise and more small features.
SCATTER_MARGIN = 2.0


class NoiseVariances(NamedTuple):
    """Variances due to noise of the heights.

    ``velocity`` [m^2/s^2]: of a sample's velocity. ``change``, ``change_1`` [m^2/s^4]: of its acceleration, from the
    newest two velocities and from the two before.
    """

    velocity: float
    change: float
    change_1: float


class Spread(NamedTuple):
    """Sums over pairs of samples on opposite sides of a sample.

    ``pairs``: number of pairs. ``total``, ``squares``: sums of the pairs' means and of their squares, relative to the
    value of the sample itself.
    """

    pairs: int
    total: float
    squares: float


@compiled
def noise_variances(clock, noise):
    """Return the `NoiseVariances` of a block for ``noise`` of the heights [m]; zero for given velocities."""
    first = 2.0 * (clock.time - clock.middle)
    second = 2.0 * (clock.middle - clock.middle_1) - first
    third = 2.0 * (clock.middle_1 - clock.middle_2) - second
    if not first > 0.0:
        return NoiseVariances(0.0, 0.0, 0.0)
    return NoiseVariances(
        2.0 * (noise / first) ** 2,
        acceleration_variance(first, second, noise),
        acceleration_variance(second, third, noise),
    )


@compiled
def acceleration_variance(later: float, earlier: float, noise: float) -> float:
    """Return the variance of an acceleration [m^2/s^4] from three heights and the intervals between them [s]."""
    if not (later > 0.0 and earlier > 0.0):
        return math.inf
    a, b = noise / later, noise / earlier
    return (a * a + b * b + (a + b) ** 2) * (2.0 / (later + earlier)) ** 2


@compiled
def signal_share(power: float, noise: float) -> float:
    """Return the fraction of a ``power`` that ``noise`` does not explain."""
    return 1.0 - noise / power if power > noise else 0.0


@compiled
def denoised(value: float, around: Spread, variance: float) -> float:
    """Return a value shrunk towards zero by the noise of a ``variance``, estimated with the values around it."""
    if variance == 0.0:
        return value
    count = around.pairs
    beyond = 2.0 * around.total / (2 * count + 1)
    mean = value + beyond
    # The mean of a pair has half the noise of a value.
    scatter = 2.0 * (around.squares - around.total**2 / count) / (count - 1) if count > 1 else 0.0
    together = signal_share(mean * mean, variance / (2 * count + 1))
    return together * mean - signal_share(scatter, SCATTER_MARGIN * variance) * beyond


@compiled
def with_pair(around: Spread, one: float, other: float) -> Spread:
    """Return a spread with one more pair of values, both relative to the sample's own value."""
    mean = 0.5 * (one + other)
    return Spread(around.pairs + 1, around.total + mean, around.squares + mean * mean)


@compiled
def velocities_at(grid, row, column, newest):
    """Return the velocities of a sample, newest first [m/s]; NaN for jumps."""
    v0 = float(grid.velocities[newest, row, column])
    v1 = float(grid.velocities[(newest + KEPT - 1) % KEPT, row, column])
    v2 = float(grid.velocities[(newest + KEPT - 2) % KEPT, row, column])
    most = grid.max_velocity
    return (
        v0 if abs(v0) <= most else math.nan, v1 if abs(v1) <= most else math.nan, v2 if abs(v2) <= most else math.nan
    )  # fmt: skip


@compiled
def updated_together(grid, clock, row, column):
    """Return True if a sample is on the map and its block has the same update times as ``clock``."""
    rows, columns = grid.heights.shape
    if not (0 <= row < rows and 0 <= column < columns):
        return False
    other = grid.clocks[row >> BLOCK_SHIFT, column >> BLOCK_SHIFT]
    return other.time == clock.time and other.middle == clock.middle and other.newest == clock.newest


@compiled
def motion_in_noise(grid, row, column, clock, phase, variances):
    """Return the velocity [m/s] and acceleration [m/s^2] of a sample of a noisy map.

    Samples on opposite sides are used as a pair or not at all. Then a velocity that varies linearly across the window
    does not count as noise, and an edge or a hole does not shift the mean.
    """
    v0, v1, v2 = velocities_at(grid, row, column, clock.newest)
    if math.isnan(v0):
        return 0.0, 0.0
    change, change_1 = (v0 - v1) * phase.inverse, (v1 - v2) * phase.inverse_1
    bends = phase.inverse != 0.0 and not math.isnan(change + change_1)
    speeds, changes, changes_1 = Spread(0, 0.0, 0.0), Spread(0, 0.0, 0.0), Spread(0, 0.0, 0.0)
    for a in range(HALF_WINDOW + 1):
        for b in range(-HALF_WINDOW if a > 0 else 1, HALF_WINDOW + 1):
            if not (
                updated_together(grid, clock, row + a, column + b)
                and updated_together(grid, clock, row - a, column - b)
            ):
                continue
            p0, p1, p2 = velocities_at(grid, row + a, column + b, clock.newest)
            q0, q1, q2 = velocities_at(grid, row - a, column - b, clock.newest)
            if math.isnan(p0 + q0):
                continue
            speeds = with_pair(speeds, p0 - v0, q0 - v0)
            if bends and not math.isnan(p1 + p2 + q1 + q2):
                changes = with_pair(changes, (p0 - p1) * phase.inverse - change, (q0 - q1) * phase.inverse - change)
                changes_1 = with_pair(
                    changes_1, (p1 - p2) * phase.inverse_1 - change_1, (q1 - q2) * phase.inverse_1 - change_1
                )
    velocity = denoised(v0, speeds, variances.velocity)
    if not bends:
        return velocity, 0.0
    return velocity, agreed(
        denoised(change, changes, variances.change), denoised(change_1, changes_1, variances.change_1)
    )
