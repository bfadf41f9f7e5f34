"""Patches as height fields of MuJoCo.

MuJoCo keeps a height as a share, 0 to 1, of its field's elevation, and finds contacts within the bounds that the model
was compiled with. Whatever lies outside either is not collided with, and MuJoCo says nothing.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.client.patch import Patch
from smartmesh_ros.errors import InputError

# Samples that a field is larger than its patch on each side, as high as the patch's rim: what gets there while the node
# stalls does not fall.
RIM = 6
# MuJoCo's number for geoms that are height fields.
HFIELD = 1
# Where the field of a patch goes that is all hole [m].
FAR_BELOW = -1.0e4


class _Field(NamedTuple):
    """A height field of a model: its number, name and mocap body; how many samples it has ``room`` for; half of its
    sides ``half_x``, ``half_y`` and its ``elevation`` [m], as the model was compiled with them."""

    number: int
    name: str
    mocap: int
    room: int
    half_x: float
    half_y: float
    elevation: float


def write_field(model: Any, data: Any, field: int | str, patch: Patch, *, rim: int = RIM) -> None:
    """Make a height field of MuJoCo, alone on a mocap body, the surface of a patch, and moves the body there.

    ``field``: its name or number. ``rim``: samples that the field goes on around the patch, as high as the patch's
    edge. MuJoCo cuts each cell along the same diagonal as the node, so that the triangles are the patch's own. Holes
    are as deep as the field's elevation allows. Raises `InputError`, and writes nothing, if the model's field is too
    small, not high enough, or on no mocap body, or the patch is no grid.
    """
    found = _find(model, field)
    if patch.shape is None:
        raise InputError(
            "geometry", f"the patch of {patch.name!r} is no grid; run the node with -p patch.kind:=heightfield"
        )
    rows, columns = patch.shape
    high, wide = rows + 2 * rim, columns + 2 * rim
    if high * wide > found.room:
        raise InputError(
            "size",
            f"the patch of {patch.name!r} takes {high} x {wide} samples with its rim, and height field {found.name!r} "
            f"has room for {found.room}; give it nrow x ncol of {high * wide} or more, 33 x 33 for any tracked body",
        )
    first, last = patch.vertices_w[0], patch.vertices_w[-1]
    across, down = (patch.vertices_w[1] - first)[:2], (patch.vertices_w[columns] - first)[:2]
    half_x, half_y = 0.5 * (wide - 1) * math.hypot(*across), 0.5 * (high - 1) * math.hypot(*down)
    if half_x > found.half_x or half_y > found.half_y:
        raise InputError(
            "size",
            f"the patch of {patch.name!r} reaches {half_x:.3g} x {half_y:.3g} m from its middle with its rim, and "
            f"height field {found.name!r} was compiled for {found.half_x:.3g} x {found.half_y:.3g} m; give it a size "
            "at least as large, for MuJoCo finds no contacts beyond",
        )
    heights = patch.vertices_w[:, 2].reshape(rows, columns)
    if np.isnan(heights).all():
        data.mocap_pos[found.mocap, 2] = FAR_BELOW
        return
    shares, base = _shares(heights, found, patch.name)
    at = int(model.hfield_adr[found.number])
    model.hfield_data[at : at + high * wide] = np.pad(shares, rim, mode="edge").ravel()
    model.hfield_nrow[found.number], model.hfield_ncol[found.number] = high, wide
    model.hfield_size[found.number][:3] = half_x, half_y, found.elevation
    data.mocap_pos[found.mocap] = 0.5 * (first[0] + last[0]), 0.5 * (first[1] + last[1]), base
    yaw = math.atan2(across[1], across[0])
    data.mocap_quat[found.mocap] = math.cos(0.5 * yaw), 0.0, 0.0, math.sin(0.5 * yaw)


def _shares(heights: NDArray[np.float64], field: _Field, name: str) -> tuple[NDArray[np.float64], float]:
    """Heights (rows, columns) [m] as shares of the field's elevation, holes zero; and where the body's base is then
    [m], so that the ground is in the middle of the range."""
    low, high = float(np.nanmin(heights)), float(np.nanmax(heights))
    if not high - low <= field.elevation:
        raise InputError(
            "range",
            f"the patch of {name!r} spans {high - low:.3g} m from its lowest to its highest vertex, and height field "
            f"{field.name!r} has an elevation of {field.elevation:.3g} m; make the third number of its size "
            f"{high - low:.3g} or more, for MuJoCo keeps heights as shares 0 to 1 of it",
        )
    base = 0.5 * (low + high - field.elevation)
    return np.nan_to_num(np.clip((heights - base) / field.elevation, 0.0, 1.0), nan=0.0), base


def _find(model: Any, field: int | str) -> _Field:
    """Return the height field of that name or number in a model."""
    names = [model.hfield(number).name for number in range(model.nhfield)]
    if isinstance(field, str) and field not in names:
        raise InputError("parameter", f"the model has no height field {field!r}; it has {names}")
    number = names.index(field) if isinstance(field, str) else field
    if not 0 <= number < model.nhfield:
        raise InputError("parameter", f"the model has no height field {number}; it has {model.nhfield}, from 0 on")
    name = names[number] or str(number)
    geoms = np.flatnonzero((model.geom_type == HFIELD) & (model.geom_dataid == number))
    if len(geoms) != 1:
        raise InputError("parameter", f"{len(geoms)} geoms are of height field {name!r}; it must be one")
    geom = int(geoms[0])
    mocap = int(model.body_mocapid[model.geom_bodyid[geom]])
    if mocap < 0:
        raise InputError(
            "parameter", f"the geom of height field {name!r} is on a body that cannot be moved; give it mocap='true'"
        )
    ends = [*model.hfield_adr.tolist(), len(model.hfield_data)]
    room = min(end for end in ends if end > ends[number]) - ends[number]
    # The bounds are those of the compiled size, which does not change; `hfield_size` is written here.
    _, _, middle, half_x, half_y, half_z = model.geom_aabb[geom].tolist()
    return _Field(number, name, mocap, room, half_x, half_y, middle + half_z)
