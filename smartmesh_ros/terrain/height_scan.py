"""Height scans: heights of the ground on a grid in a body's yaw frame, as policies of legged robots observe them.

The layouts are those of the training environments that are used most:

- ``isaac_lab``: Isaac Lab's locomotion tasks, ``GridPatternCfg(resolution=0.1, size=[1.6, 1.0])`` in the order "xy" of
  ``isaaclab/sensors/ray_caster/patterns/patterns.py``, and the observation ``mdp.height_scan``: sensor z - hit z - 0.5,
  clipped to -1 to 1. A ray that hits nothing gives -1 there. Training adds uniform noise of 0.1 m.
- ``unitree_rl_lab``: Unitree's tasks for Isaac Lab, with the same scanner, and values clipped to -1 to 5
  (``tasks/locomotion/robots/go2/velocity_env_cfg.py``).
- ``unitree_rl_mjlab``: Unitree's tasks for mjlab: the same grid, body z - hit z divided by the range of 5 m, which also
  stands for a ray that hits nothing.
- ``legged_gym``, and ``unitree_rl_gym``, which has its code: ``measured_points_x``, ``measured_points_y`` and
  ``compute_observations`` of ``legged_gym/envs/base``. y runs fastest, and values are
  5 clip(base z - 0.5 - height, -1, 1). Training adds uniform noise of 0.1 m after the clipping.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from smartmesh_ros.core import CORE
from smartmesh_ros.errors import InputError, checked_count, is_number, require, require_choice
from smartmesh_ros.terrain.checked_heights import checked_time, unmasked
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.terrain.terrain import MainMesh, Terrain

Order = Literal["xy", "yx"]
Values = Literal["height", "clearance"]
Distribution = Literal["uniform", "normal"]
# Largest extent, offset and noise [m], most points, and longest delay [s].
LARGEST, MOST_POINTS, LONGEST_DELAY = 1000.0, 100_000, 10.0
# Lets the last point of an axis be there although the extent is no exact multiple of the spacing, as in Isaac Lab [m].
ROUNDING = 1e-9


@dataclass(frozen=True, kw_only=True)
class HeightScan:
    """Settings of a height scan.

    ``size`` [m]: extent of the grid along x and y; ``spacing`` [m] of its points. ``offset`` [m]: x and y of the grid's
    middle in the body's yaw frame; z is subtracted from all values. ``order``: the axis that runs fastest comes first.
    ``values``: height, the ground's z; or clearance, the z of the body's frame minus that of the ground. Then ``noise``
    [m] is added: the bound of a uniform ``distribution``, or the standard deviation of a normal one. Then values are
    limited to ``clip`` [m], and multiplied by ``scale``. ``fill`` is the final value where there is no ground.
    ``delay`` [s]: age at which values become known. ``seed``: noise is a function of it and of the instant, so scans of
    one instant need different seeds.

    Raises `InputError` for an impossible value.
    """

    size: tuple[float, float] = (1.6, 1.0)
    spacing: float = 0.1
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    order: Order = "xy"
    values: Values = "height"
    noise: float = 0.0
    distribution: Distribution = "uniform"
    clip: tuple[float, float] = (-math.inf, math.inf)
    scale: float = 1.0
    fill: float = math.nan
    delay: float = 0.0
    seed: int = 0

    def __post_init__(self) -> None:
        for name, count in (("size", 2), ("offset", 3), ("clip", 2)):
            object.__setattr__(self, name, _numbers(name, getattr(self, name), count))
        for name in ("spacing", "noise", "scale", "fill", "delay"):
            object.__setattr__(self, name, _number(name, getattr(self, name)))
        for name, kind in (("order", Order), ("values", Values), ("distribution", Distribution)):
            require_choice(getattr(self, name), get_args(kind), "height_scan", f"the {name}")
        _require(all(0.0 <= size <= LARGEST for size in self.size), "size", self.size, f"two of 0 to {LARGEST:g} m")
        _require(0.0 < self.spacing <= LARGEST, "spacing", self.spacing, f"above 0 and at most {LARGEST:g} m")
        _require(all(abs(x) <= LARGEST for x in self.offset), "offset", self.offset, f"within {LARGEST:g} m")
        _require(0.0 <= self.noise <= LARGEST, "noise", self.noise, f"0 to {LARGEST:g} m")
        _require(self.clip[0] < self.clip[1], "clip", self.clip, "a lower and a higher bound")
        _require(math.isfinite(self.scale), "scale", self.scale, "finite")
        _require(0.0 <= self.delay <= LONGEST_DELAY, "delay", self.delay, f"0 to {LONGEST_DELAY:g} s")
        object.__setattr__(self, "seed", checked_count(self.seed, "height_scan", "the seed"))
        most = (self.size[0] / self.spacing + 1.0) * (self.size[1] / self.spacing + 1.0)
        _require(most <= MOST_POINTS, "spacing", self.spacing, f"so large that there are at most {MOST_POINTS} points")

    @classmethod
    def of(cls, layout: str, **changes: Any) -> HeightScan:
        """Return the scan of one of the `LAYOUTS`, with some settings changed. Raises `InputError`."""
        require_choice(layout, LAYOUTS, "height_scan", "the layout of a height scan")
        return replace(LAYOUTS[layout], **changes)

    @cached_property
    def axes(self) -> tuple[FloatArray, FloatArray]:
        """Coordinates x (nx,) and y (ny,) of the grid's points from its middle [m]."""
        x, y = (np.arange(-0.5 * size, 0.5 * size + ROUNDING, self.spacing) for size in self.size)
        return x, y

    @cached_property
    def points_b(self) -> FloatArray:
        """Points (k, 2) [m] in the body's yaw frame, in the order of the values."""
        x, y = np.meshgrid(*self.axes, indexing="xy" if self.order == "xy" else "ij")
        return np.stack([x.ravel() + self.offset[0], y.ravel() + self.offset[1]], axis=-1)

    @property
    def layout(self) -> tuple[tuple[str, int], tuple[str, int]]:
        """Name and number of points of both axes, slowest first: the values (n, k) of n bodies are (n, slow, fast)."""
        x, y = (("x", self.axes[0].size), ("y", self.axes[1].size))
        return (y, x) if self.order == "xy" else (x, y)

    def read(self, terrain: MainMesh | Terrain, poses_w: ArrayLike, time: float) -> FloatArray:
        """Return the values (n, k) around ``poses_w`` (n, 4), each x, y, z [m] and yaw [rad], at ``time`` [s]. Raises
        `InputError` for another shape."""
        given, time = unmasked(poses_w, "poses"), checked_time(time)
        if given.ndim != 2 or given.shape[1] != 4 or given.dtype.kind not in "fiu":
            words = "they must be numbers of shape (n, 4): x, y, z and yaw of each"
            raise InputError("length", f"poses have shape {given.shape} and type {given.dtype}; {words}")
        poses_w = given.astype(np.float64)
        found = np.empty((len(poses_w), len(self.points_b)))
        CORE.scan_heights(
            Terrain.of(terrain).core, np.ascontiguousarray(poses_w[:, [0, 1, 3]]), self.points_b, time, found
        )
        hole = None if math.isnan(self.fill) else np.isnan(found)
        if self.values == "clearance":
            np.subtract(poses_w[:, 2:3] - self.offset[2], found, out=found)
        else:
            found -= self.offset[2]
        if self.noise > 0.0:
            found += self._noise(found.shape, time)
        if self.clip != (-math.inf, math.inf):
            np.clip(found, *self.clip, out=found)
        if self.scale != 1.0:
            found *= self.scale
        if hole is not None:
            found[hole] = self.fill
        return found

    def _noise(self, shape: tuple[int, ...], time: float) -> FloatArray:
        random = np.random.default_rng((self.seed, abs(round(time * 1e9))))
        if self.distribution == "normal":
            return random.normal(0.0, self.noise, shape)
        return random.uniform(-self.noise, self.noise, shape)


def require_scan(scan: Any) -> None:
    """Raise `InputError` unless something is the settings of a height scan."""
    require(isinstance(scan, HeightScan), "height_scan", "the scan", scan, "HeightScan(...) or HeightScan.of(layout)")


def yaws_of(orientations: ArrayLike) -> FloatArray:
    """Return the turns about z (n,) [rad] of unit quaternions (n, 4) (x, y, z, w): the directions of the x axes seen
    from above, as ``yaw_quat`` of Isaac Lab."""
    x, y, z, w = np.asarray(orientations, np.float64).reshape(-1, 4).T
    return np.asarray(np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)))


def _number(name: str, value: Any) -> float:
    _require(is_number(value), name, value, "a number")
    return float(value)


def _numbers(name: str, values: Any, count: int) -> tuple[float, ...]:
    good = isinstance(values, tuple | list | np.ndarray) and len(values) == count
    _require(good, name, values, f"{count} numbers")
    return tuple(_number(name, value) for value in values)


def _require(good: bool, name: str, value: Any, wanted: str) -> None:
    require(good, "height_scan", f"the {name}", value, wanted)


_RELATIVE = HeightScan(values="clearance", offset=(0.0, 0.0, 0.5), clip=(-1.0, 1.0))
# The layouts by name; see the head of this file.
LAYOUTS = {
    "isaac_lab": replace(_RELATIVE, fill=-1.0),
    "unitree_rl_lab": replace(_RELATIVE, clip=(-1.0, 5.0), fill=-1.0),
    "unitree_rl_mjlab": HeightScan(values="clearance", scale=0.2, fill=1.0),
    "legged_gym": replace(_RELATIVE, order="yx", scale=5.0),
    "unitree_rl_gym": replace(_RELATIVE, order="yx", scale=5.0),
}
