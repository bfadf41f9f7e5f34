"""Patches as height fields of MuJoCo.

MuJoCo stores a height as a fraction, 0 to 1, of the field's elevation, and finds contacts only within the bounds that
the model was compiled with. Ground outside either range has no contacts, and MuJoCo reports no error.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.errors import InputError
from smartmesh_ros.ground.quaternions import quaternion_of
from smartmesh_ros.tools.client.patch import Patch

# Width of the rim around the patch [samples], at the height of the patch's edge. Raising it keeps bodies that leave the
# patch while the node stalls from falling for longer.
RIM = 6
# Cosine of the angle between rows and columns, seen from above, from which a patch is that of a flat deck that rolls
# and pitches: its height field tilts with the deck.
SKEWED = 1e-4
# mjGEOM_HFIELD: MuJoCo's geom type of height fields.
GEOM_HFIELD = 1
# Height to which the field of a patch without any ground is moved [m].
FAR_BELOW = -1.0e4


class _Field(NamedTuple):
    """A height field of a model: its number, name and mocap body, its capacity ``room`` [samples], and its half sides
    ``half_x``, ``half_y`` and ``elevation`` [m] as compiled."""

    number: int
    name: str
    mocap: int
    room: int
    half_x: float
    half_y: float
    elevation: float


def write_field(model: Any, data: Any, field: int | str, patch: Patch) -> None:
    """Write a patch into a height field of MuJoCo, and move the field's mocap body to the patch.

    ``field``: name or number of the height field, used by one geom on a mocap body. MuJoCo cuts each cell along the
    same diagonal as the node, so its triangles equal the patch's. Holes are as deep as the field's elevation allows.
    Raises `InputError`, and writes nothing, if the model's field is too small, too low, beside its body, or not on a
    mocap body, or if the patch is no grid.
    """
    found = _find(model, field)
    if patch.shape is None:
        raise InputError("geometry", f"the patch of {patch.name!r} is no grid, but triangles of a general mesh")
    rows, columns = patch.shape
    high, wide = rows + 2 * RIM, columns + 2 * RIM
    if high * wide > found.room:
        raise InputError(
            "size",
            f"the patch of {patch.name!r} takes {high} x {wide} samples with its rim, and height field {found.name!r} "
            f"has room for {found.room}; give it nrow x ncol of {high * wide} or more, 77 x 77 for any body",
        )
    first, last = patch.vertices_w[0], patch.vertices_w[-1]
    across, down = patch.vertices_w[1] - first, patch.vertices_w[columns] - first
    middle, known = 0.5 * (first + last), patch.vertices_w[~np.isnan(patch.vertices_w[:, 2])]
    slope, middle[2] = np.zeros(2), 0.0
    if abs(across[:2] @ down[:2]) > SKEWED * math.hypot(*across[:2]) * math.hypot(*down[:2]):
        # The plane of the deck; corners of the patch may be holes.
        equations = np.column_stack([known[:, :2] - middle[:2], np.ones(len(known))])
        *slope, middle[2] = np.linalg.lstsq(equations, known[:, 2], rcond=None)[0]
    across[2], down[2] = across[:2] @ slope, down[:2] @ slope
    wide_cell, high_cell = float(np.linalg.norm(across)), float(np.linalg.norm(down))
    x, y = across / wide_cell, down / high_cell
    up = np.cross(x, y)
    half_x, half_y = 0.5 * (wide - 1) * wide_cell, 0.5 * (high - 1) * high_cell
    if half_x > found.half_x or half_y > found.half_y:
        raise InputError(
            "size",
            f"the patch of {patch.name!r} reaches {half_x:.3g} x {half_y:.3g} m from its middle with its rim, and "
            f"height field {found.name!r} was compiled for {found.half_x:.3g} x {found.half_y:.3g} m; give it a size "
            "at least as large, because MuJoCo finds no contacts beyond",
        )
    heights = ((patch.vertices_w - middle) @ up).reshape(rows, columns)
    if not len(known):
        data.mocap_pos[found.mocap, 2] = FAR_BELOW
        return
    shares, base = _shares(heights, found, patch.name)
    at = int(model.hfield_adr[found.number])
    model.hfield_data[at : at + high * wide] = np.pad(shares, RIM, mode="edge").ravel()
    model.hfield_nrow[found.number], model.hfield_ncol[found.number] = high, wide
    model.hfield_size[found.number][:3] = half_x, half_y, found.elevation
    data.mocap_pos[found.mocap] = middle + base * up
    *vector, scalar = quaternion_of(np.column_stack([x, y, up]))
    data.mocap_quat[found.mocap] = scalar, *vector


def _shares(heights: NDArray[np.float64], field: _Field, name: str) -> tuple[NDArray[np.float64], float]:
    """Return heights (rows, columns) [m] as fractions of the field's elevation, zero in holes, and the base height of
    the body [m] that centres the ground in the range. Raises `InputError` if the heights exceed the range."""
    low, high = float(np.nanmin(heights)), float(np.nanmax(heights))
    if not high - low <= field.elevation:
        raise InputError(
            "range",
            f"the patch of {name!r} spans {high - low:.3g} m from its lowest to its highest vertex, and height field "
            f"{field.name!r} has an elevation of {field.elevation:.3g} m; make the third number of its size "
            f"{high - low:.3g} or more, because MuJoCo stores heights as fractions 0 to 1 of it",
        )
    base = 0.5 * (low + high - field.elevation)
    return np.nan_to_num(np.clip((heights - base) / field.elevation, 0.0, 1.0), nan=0.0), base


def _find(model: Any, field: int | str) -> _Field:
    """Return the height field of a name or number. Raises `InputError` if it is missing or not on one mocap geom."""
    names = [model.hfield(number).name for number in range(model.nhfield)]
    if isinstance(field, str) and field not in names:
        raise InputError("parameter", f"the model has no height field {field!r}; it has {names}")
    number = names.index(field) if isinstance(field, str) else field
    if not 0 <= number < model.nhfield:
        raise InputError("parameter", f"the model has no height field {number}; it has {model.nhfield}, from 0 on")
    name = names[number] or str(number)
    geoms = np.flatnonzero((model.geom_type == GEOM_HFIELD) & (model.geom_dataid == number))
    if len(geoms) != 1:
        raise InputError("parameter", f"{len(geoms)} geoms use height field {name!r}; it must be one")
    geom = int(geoms[0])
    mocap = int(model.body_mocapid[model.geom_bodyid[geom]])
    if mocap < 0:
        raise InputError(
            "parameter", f"the geom of height field {name!r} is on a body that cannot be moved; give it mocap='true'"
        )
    if model.geom_pos[geom].any() or model.geom_quat[geom].tolist() != [1.0, 0.0, 0.0, 0.0]:
        raise InputError(
            "parameter", f"the geom of height field {name!r} has a pose in its body, which is moved: leave its pos and "
            "its orientation out"
        )  # fmt: skip
    ends = [*model.hfield_adr.tolist(), len(model.hfield_data)]
    room = min(end for end in ends if end > ends[number]) - ends[number]
    # Contacts are limited by the compiled bounds in `geom_aabb`, which never change, unlike `hfield_size`.
    _, _, middle, half_x, half_y, half_z = model.geom_aabb[geom].tolist()
    return _Field(number, name, mocap, room, half_x, half_y, middle + half_z)
