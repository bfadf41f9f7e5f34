"""What the ground of a height map is made of: layers of one number for each sample."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from smartmesh_ros.errors import InputError, is_number, require
from smartmesh_ros.terrain.checked_heights import as_floats, unmasked

# Most soils of a map.
MOST_SOILS = 255

# A layer as it is kept: one number, or those of the samples (rows, columns).
Layer = float | NDArray[Any]


class Range(NamedTuple):
    """Numbers that a layer may have, and the ``usual`` one, which NaN stands for."""

    usual: float
    most: float = math.inf
    above_zero: bool = False

    @property
    def rule(self) -> str:
        """What a number must be."""
        least = "above zero" if self.above_zero else "zero or more"
        return least if math.isinf(self.most) else f"{least}, at most {self.most:g}"


# In the order of `Layer` in core/map/material.h. Infinite stiffness is rigid ground.
RANGES = {
    "friction": Range(1.0),
    "stiffness": Range(math.inf, above_zero=True),
    "damping": Range(0.0),
    "restitution": Range(1.0, 1.0),
    "rolling": Range(0.0),
}


@dataclass(frozen=True, kw_only=True, eq=False)
class Material:
    """Material of the ground: each layer is one number, one for each sample (rows, columns), or None = not given.

    ``friction``: coefficient, by which that of a body is multiplied; usually 1. ``stiffness`` [N/m^3]: of ground that
    gives by its contact, as pressure over depth; usually infinite, which is rigid. ``damping`` [N s/m^3]: of such
    ground, as pressure over the rate of depth; usually 0. ``restitution``: by which that of a body is multiplied, up to
    1, which is usual. ``rolling``: coefficient of rolling resistance, force over load of a wheel; usually 0. ``soil``:
    which soil each sample is, by its place in the list of a `Soil` (rows, columns); usually 0. NaN and masked samples
    stand for the usual number; those of ``soil`` are whole numbers, and none is masked.
    """

    friction: float | ArrayLike | None = None
    stiffness: float | ArrayLike | None = None
    damping: float | ArrayLike | None = None
    restitution: float | ArrayLike | None = None
    rolling: float | ArrayLike | None = None
    soil: ArrayLike | None = None

    @property
    def layers(self) -> dict[str, Any]:
        """The layers that are given, by name."""
        return {name: layer for name in NAMES if (layer := getattr(self, name)) is not None}

    def over(self, before: Material) -> Material:
        """Return this material, with layers of the one ``before`` it where it has none."""
        return replace(before, **self.layers)

    def each(self, change: Callable[[str, Any], Any]) -> Material:
        """Return the material whose layers are changed, by name and layer."""
        return Material(**{name: change(name, layer) for name, layer in self.layers.items()})

    def checked(self, shape: tuple[int, ...]) -> Material:
        """Return the material with its layers as numbers or read-only copies of a ``shape``; raises `InputError`."""
        return self.each(lambda name, layer: checked_layer(name, layer, shape))

    def written(self, part: Material, place: tuple[slice, slice], shape: tuple[int, ...]) -> Material:
        """Return the material of a map of a ``shape`` with that of a ``part`` at a ``place``; both are checked."""
        whole = {}
        for name, layer in part.layers.items():
            known = getattr(self, name)
            numbers = np.full(
                shape, usual(name) if known is None else known, np.float32 if name in RANGES else np.uint8
            )
            numbers[place] = layer
            numbers.setflags(write=False)
            whole[name] = numbers
        return replace(self, **whole)

    def tell(self, core: Any) -> None:
        """Give the layers, which are checked, to the core's reader of the map."""
        for number, name in enumerate(RANGES):
            layer = getattr(self, name)
            if layer is None or isinstance(layer, float):
                core.set_layer(number, None, math.nan if layer is None else layer)
            else:
                core.set_layer(number, layer, math.nan)


NAMES = tuple(field.name for field in fields(Material))


def together(material: Material | None, **layers: Any) -> Material:
    """Return a ``material`` with other ``layers``, None = not given; raises `InputError` for a layer of both."""
    given = {name: layer for name, layer in layers.items() if layer is not None}
    whole = Material() if material is None else material
    if not isinstance(whole, Material):
        raise InputError("type", f"the material is {material!r}; pass Material(friction=..., ...)")
    if not given:
        return whole
    if both := sorted(whole.layers.keys() & given.keys()):
        raise InputError("layer", f"{both[0]} is given twice, by itself and in the material; give it once")
    return replace(whole, **given)


def usual(name: str) -> float:
    """Return the number of a layer where nothing is known of the ground."""
    return RANGES[name].usual if name in RANGES else 0.0


def new_ground(name: str, shape: tuple[int, ...]) -> NDArray[Any]:
    """Return a layer (rows, columns) of usual numbers."""
    return np.full(shape, np.nan, np.float32) if name in RANGES else np.zeros(shape, np.uint8)


def require_layer(name: str) -> None:
    """Raise `InputError` unless a material has a layer of that name."""
    if name not in NAMES:
        raise InputError("layer", f"there is no layer {name!r} of a material; it may be one of {', '.join(NAMES)}")


def checked_layer(name: str, layer: Any, shape: tuple[int, ...]) -> Layer:
    """Return a layer as one number, or as a read-only copy of the right shape."""
    if name == "soil":
        return _frozen(checked_soil(layer, shape))
    allowed = RANGES[name]
    if is_number(layer):
        number = float(layer)
        require(_fits(number, allowed) or number == allowed.usual, name, name, number, allowed.rule)
        return number
    samples = np.array(as_floats(layer, shape, f"numbers of {name}"), order="C")
    low, high = np.fmin.reduce(samples, axis=None), np.fmax.reduce(samples, axis=None)
    if not all(_fits(float(end), allowed) or end == allowed.usual or math.isnan(end) for end in (low, high)):
        raise InputError(name, f"{name} is {low:g} to {high:g}; it must be {allowed.rule}, or NaN where it is unknown")
    return _frozen(samples)


def checked_soil(soil: ArrayLike, shape: tuple[int, ...]) -> NDArray[np.uint8]:
    """Return places of soils in a list as uint8 of the right shape."""
    array = unmasked(soil, "places of soils")
    if array.shape != shape:
        raise InputError("length", f"places of soils have shape {array.shape}; it must be {shape}")
    if array.dtype.kind not in "iub":
        raise InputError("type", f"places of soils are of type {array.dtype}; they must be whole numbers")
    if array.size and not 0 <= array.min() <= array.max() < MOST_SOILS:
        found = f"{array.min()} to {array.max()}"
        raise InputError("soil", f"places of soils are {found}; they must be 0 to {MOST_SOILS - 1}")
    return array.astype(np.uint8, order="C")


def _fits(number: float, allowed: Range) -> bool:
    return (number > 0.0 if allowed.above_zero else number >= 0.0) and number <= allowed.most and number < math.inf


def _frozen(samples: NDArray[Any]) -> NDArray[Any]:
    samples.setflags(write=False)  # what is assigned is checked, and wakes bodies
    return samples
