"""How far bodies press the soil down in an update.

The samples under a body take the form of its underside, moved down and leant so that the pressures of the samples, each
by its own sinkage and sinking speed, have the force and the moments of the body's contacts.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from smartmesh_ros.compiled import compiled
from smartmesh_ros.soil.balancing import SAMPLE, balance, lean_over, loaded, pressed_to
from smartmesh_ros.soil.feet import (
    SPHERE,
    Rotation,
    Triple,
    covered_share,
    half_lengths,
    normal_at,
    patch_width,
    reach,
    rotation_of,
    slope_of,
    underside,
)
from smartmesh_ros.soil.law import plastic_after, shear_at
from smartmesh_ros.soil.layer import COHESION, DAMPING, ELASTIC, EXPONENT, FRICTION, KC, KPHI, SHEAR, SoilLayer
from smartmesh_ros.terrain.moving_grid import MovingGrid, sample_at, to_grid

# Largest friction coefficient of a body. Cohesion makes that of light bodies large without limit.
MOST_GRIP = 2.0
# Smaller loads count as none [N].
LEAST_LOAD = 1e-6
# First row and column of no samples.
NOWHERE = 2**31


class Press(NamedTuple):
    """Settings of an update: its ``time`` and duration ``dt`` [s], its ``number``, `SoilConfig.load_time` [s],
    `SoilConfig.lean_time` [s] and `SoilConfig.fastest` [m/s]."""

    time: float
    dt: float
    number: int
    load_time: float
    lean_time: float
    fastest: float


class PlacedShape(NamedTuple):
    """A shape in axes of the grid: its ``kind`` and ``half`` lengths as in ``FOOT``; ``rotation`` (3, 3); ``middle``:
    fractional column and row, and height [m] without the grid's z; ``motion`` (6,): velocity [m/s] of the middle, and
    spin [rad/s]; ``size`` [m]: more than half its length along columns and rows; ``spacing`` [m] of the samples."""

    kind: int
    half: Triple
    rotation: Rotation
    middle: Triple
    motion: tuple[float, float, float, float, float, float]
    size: float
    spacing: float


@compiled
def press_all(grid: MovingGrid, layer: SoilLayer, feet: Any, press: Press) -> None:
    """Press all ``feet``, records of ``FOOT``, into the soil."""
    for foot in feet:
        filter_load(foot, press)
        foot.sinkage, foot.area, foot.carried, foot.grip, foot.displaced = 0.0, 0.0, 0.0, 0.0, 0.0
        foot.first[0], foot.first[1], foot.last[0], foot.last[1] = NOWHERE, NOWHERE, -1, -1
        if foot.load <= LEAST_LOAD:
            foot.load = foot.centre_of_load[0] = foot.centre_of_load[1] = 0.0
            foot.seat = math.nan
        else:
            press_one(grid, layer, foot, press)


@compiled
def filter_load(foot: Any, press: Press) -> None:
    """Filter the load of a body, and its place, which noisy contacts change within a step."""
    share = -math.expm1(-press.dt / press.load_time) if press.load_time > 0.0 else 1.0
    foot.load += share * (foot.force - foot.load)
    share = -math.expm1(-press.dt / press.lean_time) if press.lean_time > 0.0 else 1.0
    if foot.force > 0.0:
        for axis in range(2):
            change = foot.place[axis] - foot.centre_of_load[axis]
            foot.centre_of_load[axis] += share * min(foot.force / foot.load, 1.0) * change


@compiled
def press_one(grid: MovingGrid, layer: SoilLayer, foot: Any, press: Press) -> None:
    """Press one body into the soil."""
    shape = placed(grid, foot)
    under = samples_under(grid, shape, press.time)
    touch = math.inf
    for sample in under:
        if sample.area > 0.0:
            touch = min(touch, sample.low - sample.now)
    if touch == math.inf:
        return
    farthest, middle = press.fastest * press.dt, shape.middle[2]
    deepest, size = touch + farthest, shape.size
    samples = samples_within(grid, layer, shape, under, deepest, farthest)
    own = slope_of(shape.kind, shape.rotation)
    lean = np.array([touch, 0.0, 0.0])
    if foot.seat == foot.seat:  # start where the body was carried before
        lean[0] = min(middle - foot.seat, deepest)
    leans = shape.kind != SPHERE and not math.isnan(foot.centre_of_load[0])  # a ball does not lean
    if leans:
        x, y = foot.centre_of_load[0], foot.centre_of_load[1]
        moments = foot.load / size * np.array([grid.cos * x + grid.sin * y, grid.cos * y - grid.sin * x])
        if foot.seat == foot.seat:
            for axis in range(2):
                lean[1 + axis] = min(max((own[axis] - foot.slope[axis]) * size, -farthest), farthest)
        leans = lean_over(samples, foot.load, moments, lean, deepest, farthest, press.dt)
    if not leans:
        lean[0] = balance(samples, foot.load, (lean[0], lean[1], lean[2]), lean[0], deepest, press.dt)
    foot.seat = middle - lean[0]
    foot.slope[0], foot.slope[1] = own[0] - lean[1] / size, own[1] - lean[2] / size
    settle(layer, samples, (lean[0], lean[1], lean[2]), press, foot, shape)


@compiled
def samples_under(grid: MovingGrid, shape: PlacedShape, time: float) -> Any:
    """Return the samples (n,) of ``SAMPLE`` under a shape, without the values of their soil."""
    middle, spacing = shape.middle, grid.resolution
    rows, columns = grid.heights.shape
    half_x = reach(shape.kind, shape.half, shape.rotation, 0, spacing) / spacing
    half_y = reach(shape.kind, shape.half, shape.rotation, 1, spacing) / spacing
    top, bottom = max(int(middle[1] - half_y), 0), min(int(middle[1] + half_y) + 1, rows - 1)
    left, right = max(int(middle[0] - half_x), 0), min(int(middle[0] + half_x) + 1, columns - 1)
    samples = np.empty(max(bottom - top + 1, 0) * max(right - left + 1, 0), SAMPLE)
    count = 0
    for r in range(top, bottom + 1):
        for c in range(left, right + 1):
            x, y = (c - middle[0]) * spacing, (r - middle[1]) * spacing
            low = underside(shape.kind, shape.half, shape.rotation, x, y, spacing)
            if low == math.inf or math.isnan(grid.heights[r, c]):
                continue
            sample = samples[count]
            sample.row, sample.column, sample.low = r, c, middle[2] + low
            sample.now = sample_at(grid, r, c, time, 0.0)[0] - grid.z
            sample.area = covered_share(shape.kind, shape.half, shape.rotation, x, y, spacing) * spacing * spacing
            sample.x, sample.y = x / shape.size, y / shape.size
            count += 1
    return samples[:count]


@compiled
def samples_within(
    grid: MovingGrid, layer: SoilLayer, shape: PlacedShape, samples: Any, deepest: float, most: float
) -> Any:
    """Return those of the ``samples`` under a shape that the body reaches if it goes down by ``deepest`` [m] and leans
    by ``most`` [m], with the values of their soil; take their ground into the layer."""
    width = patch_width(shape.kind, shape.half, shape.rotation)
    count = 0
    for place in range(len(samples)):
        r, c, low, area = samples[place].row, samples[place].column, samples[place].low, samples[place].area
        now, x, y = samples[place].now, samples[place].x, samples[place].y
        known = layer.touched[r, c] == 1 and layer.known[r, c] == grid.heights[r, c]
        level = layer.level[r, c] if known else float(grid.heights[r, c])
        if low - deepest - most * (abs(x) + abs(y)) > level:
            continue
        if not known:
            note_ground(grid, layer, r, c)
        soil, sample = layer.kinds[r, c], samples[count]
        sample.row, sample.column, sample.low, sample.now, sample.level = r, c, low, now, level
        sample.area, sample.x, sample.y = area, x, y
        sample.plastic, sample.yielded = layer.plastic[r, c], layer.yielded[r, c]
        sample.modulus = layer.soils[soil, KC] / width + layer.soils[soil, KPHI]
        sample.exponent, sample.elastic = layer.soils[soil, EXPONENT], layer.soils[soil, ELASTIC]
        sample.damping = layer.soils[soil, DAMPING]
        count += 1
    return samples[:count]


@compiled
def placed(grid: MovingGrid, foot: Any) -> PlacedShape:
    """Return the shape of a record of ``FOOT`` in axes of the grid."""
    body, own, rotation = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    offset, q = np.zeros(3), np.empty(4)
    for k in range(4):
        q[k] = foot.state[3 + k]
    rotation_of(q, body)
    for k in range(4):
        q[k] = foot.form[7 + k]
    rotation_of(q, own)
    for i in range(3):
        for j in range(3):
            offset[i] += body[i, j] * foot.form[4 + j]
            total = 0.0
            for k in range(3):
                total += body[i, k] * own[k, j]
            rotation[i, j] = total
    for j in range(3):
        x, y = rotation[0, j], rotation[1, j]
        rotation[0, j], rotation[1, j] = grid.cos * x + grid.sin * y, grid.cos * y - grid.sin * x
    row, column = to_grid(grid, foot.state[0] + offset[0], foot.state[1] + offset[1])
    middle = (column, row, foot.state[2] + offset[2] - grid.z)
    spin_x, spin_y, spin_z = foot.state[10], foot.state[11], foot.state[12]
    vx = foot.state[7] + spin_y * offset[2] - spin_z * offset[1]
    vy = foot.state[8] + spin_z * offset[0] - spin_x * offset[2]
    vz = foot.state[9] + spin_x * offset[1] - spin_y * offset[0]
    motion = (
        grid.cos * vx + grid.sin * vy, grid.cos * vy - grid.sin * vx, vz,
        grid.cos * spin_x + grid.sin * spin_y, grid.cos * spin_y - grid.sin * spin_x, spin_z,
    )  # fmt: skip
    kind, half = int(foot.form[0]), (foot.form[1], foot.form[2], foot.form[3])
    turned = (
        (rotation[0, 0], rotation[0, 1], rotation[0, 2]), (rotation[1, 0], rotation[1, 1], rotation[1, 2]),
        (rotation[2, 0], rotation[2, 1], rotation[2, 2]),
    )  # fmt: skip
    longest = max(half_lengths(kind, half, turned, 0), half_lengths(kind, half, turned, 1))
    return PlacedShape(kind, half, turned, middle, motion, longest + 2.0 * grid.resolution, grid.resolution)


@compiled
def note_ground(grid: MovingGrid, layer: SoilLayer, r: int, c: int) -> None:
    """Take a sample into the layer when a body first touches it, and again after the map there was changed by others:
    it then is new soil."""
    height = grid.heights[r, c]
    if layer.touched[r, c] == 1 and height == layer.known[r, c]:
        return
    layer.touched[r, c], layer.moves[r, c] = 1, 0
    layer.level[r, c] = layer.target[r, c] = height
    layer.known[r, c] = height
    layer.plastic[r, c] = layer.yielded[r, c] = layer.pressure[r, c] = 0.0
    layer.shear_x[r, c] = layer.shear_y[r, c] = 0.0


@compiled
def settle(layer: SoilLayer, samples: Any, lean: Triple, press: Press, foot: Any, shape: PlacedShape) -> None:
    """Press the samples down by a ``lean``, see `pressed_to`, and write the results to the ``foot``."""
    force, resistance = 0.0, 0.0
    cell = shape.spacing * shape.spacing
    for sample in samples:
        pressure, total, _ = loaded(sample, lean, press.dt)
        if total <= 0.0:
            continue
        r, c = sample.row, sample.column
        soil, share = layer.kinds[r, c], sample.area
        height = pressed_to(sample, lean)
        sinkage, before = layer.level[r, c] - height, layer.plastic[r, c]
        after, yielded = plastic_after(sinkage, pressure, before, layer.yielded[r, c], sample.elastic)
        layer.plastic[r, c], layer.yielded[r, c], layer.pressure[r, c] = after, yielded, pressure
        # Two bodies on a sample: the deeper one counts.
        again = layer.pressed[r, c] == press.number
        layer.target[r, c] = min(layer.target[r, c], height) if again else height
        layer.pressed[r, c] = press.number
        foot.displaced += (layer.plastic[r, c] - before) * cell
        shear_x, shear_y = slip_at(shape, r, c, sample.low)
        layer.shear_x[r, c] += shear_x * press.dt
        layer.shear_y[r, c] += shear_y * press.dt
        displacement = math.sqrt(layer.shear_x[r, c] ** 2 + layer.shear_y[r, c] ** 2)
        cohesion, friction, shear = layer.soils[soil, COHESION], layer.soils[soil, FRICTION], layer.soils[soil, SHEAR]
        resistance += share * shear_at(pressure, displacement, cohesion, friction, shear)
        force += share * pressure
        foot.area += share
        foot.sinkage = max(foot.sinkage, sinkage)
        foot.first[0], foot.first[1] = min(foot.first[0], r), min(foot.first[1], c)
        foot.last[0], foot.last[1] = max(foot.last[0], r), max(foot.last[1], c)
    foot.carried, foot.grip = force, min(resistance / foot.load, MOST_GRIP)


@compiled
def slip_at(shape: PlacedShape, r: int, c: int, low: float) -> tuple[float, float]:
    """Return the velocity at which the body's surface shears the soil at a sample, along columns and rows [m/s]: its
    size is that of the velocity along the surface. ``low`` [m]: height of the surface."""
    x, y = (c - shape.middle[0]) * shape.spacing, (r - shape.middle[1]) * shape.spacing
    z, motion = low - shape.middle[2], shape.motion
    vx = motion[0] + motion[4] * z - motion[5] * y
    vy = motion[1] + motion[5] * x - motion[3] * z
    vz = motion[2] + motion[3] * y - motion[4] * x
    nx, ny, nz = normal_at(shape.kind, shape.half, shape.rotation, x, y, z, shape.spacing)
    into = vx * nx + vy * ny + vz * nz
    vx, vy, vz = vx - into * nx, vy - into * ny, vz - into * nz
    level = math.sqrt(vx * vx + vy * vy)
    share = math.sqrt(vx * vx + vy * vy + vz * vz) / level if level > 1e-12 else 0.0
    return vx * share, vy * share
