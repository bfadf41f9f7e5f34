"""Collider patches as arrays, and their extrapolation in time. ``ColliderPatchArray`` is read directly from its bytes,
without a Python object for each vertex."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from smartmesh_msgs.msg import ColliderPatch

from smartmesh_ros.errors import InputError
from smartmesh_ros.node.inputs.cdr_reader import CdrReader

KINDS = {ColliderPatch.HEIGHTFIELD: "heightfield", ColliderPatch.TRIMESH: "trimesh"}


@dataclass(frozen=True, eq=False, kw_only=True)
class Patch:
    """The ground under one body, in the terrain's frame (z up).

    ``name``: the body. ``kind``: "heightfield", or "trimesh" on a general mesh. ``tile``, ``row``,
    ``column``: the patch's centre sample. ``stride``: map samples from one vertex to the next. ``vertices_w`` (K, 3)
    [m]: z is NaN in a hole. ``triangles`` (T, 3): counter-clockwise from above. ``linear_w`` [m/s], ``angular_w``
    [rad/s], (3,): the ground's twist at the centre sample. ``deviation`` [m]: bound of the vertical distance to the
    terrain where the body can touch it, at the stamp; NaN = unknown. ``stamp`` [s]: instant of the last message, on the
    node's ROS clock. ``age`` [s]: time from the stamp to the requested instant.
    """

    name: str
    kind: str
    tile: str
    row: int
    column: int
    stride: int
    deviation: float
    linear_w: NDArray[np.float64]
    angular_w: NDArray[np.float64]
    vertices_w: NDArray[np.float64]
    triangles: NDArray[np.uint32]
    stamp: float = 0.0
    age: float = 0.0

    @cached_property
    def shape(self) -> tuple[int, int] | None:
        """Rows and columns of the vertices; None on a general mesh, whose vertices form no grid."""
        count = len(self.vertices_w)
        if self.kind != "heightfield" or count < 4:
            return None
        steps = np.diff(self.vertices_w[:, :2], axis=0)
        turns = np.abs(steps - steps[0]).max(axis=1) > 0.5 * np.abs(steps[0]).max()
        columns = int(turns.argmax()) + 1
        return (count // columns, columns) if columns > 1 and count % columns == 0 else None

    @cached_property
    def centre(self) -> int:
        """Index of the vertex at which the twist holds: the middle of the rows and columns, or, on a general mesh,
        whose messages do not contain it, the vertex nearest to the mean of all vertices."""
        if self.shape is None:
            away = self.vertices_w[:, :2] - self.vertices_w[:, :2].mean(axis=0)
            return int(np.argmin((away**2).sum(axis=1)))
        rows, columns = self.shape
        return (rows - 1) // 2 * columns + (columns - 1) // 2

    def after(self, time: float, **changes: Any) -> Patch:
        """Return the patch extrapolated by ``time`` [s] (negative = backwards), to first order in the twist, with
        other ``changes`` of fields. The cached shape and centre are reused."""
        vertices = self.vertices_w
        if not len(vertices):
            return replace(self, **changes)
        if time and (self.linear_w.any() or self.angular_w.any()):
            x, y, z = self.angular_w.tolist()
            away = vertices[:, :2] - vertices[self.centre, :2]
            # A height field moves vertically, so height differences must not cause horizontal motion.
            turning = away @ np.array([[0.0, z, -y], [-z, 0.0, x]])
            vertices = vertices + time * (self.linear_w + turning)
        copy = replace(self, vertices_w=vertices, **changes)
        copy.__dict__.update(shape=self.shape, centre=self.centre)
        return copy


@dataclass(frozen=True, kw_only=True)
class PatchesMessage:
    """Content of a ColliderPatchArray. ``stamp`` [s] is on the node's ROS clock; other fields as in the message."""

    stamp: float
    frame_id: str
    incremental: bool
    removed: list[str]
    patches: list[Patch]

    def onto(self, known: Mapping[str, Patch]) -> dict[str, Patch]:
        """Return the patches by body after this message, if those before it are ``known``."""
        kept = {name: patch for name, patch in known.items() if self.incremental and name not in self.removed}
        return kept | {patch.name: patch for patch in self.patches}


def read_patches(data: bytes) -> PatchesMessage:
    """Return the message encoded in CDR bytes. Raises `InputError` if the bytes are malformed."""
    reader = CdrReader(data)
    sec, nanosec, frame_id = reader.number("i"), reader.number("I"), reader.text()
    return PatchesMessage(
        stamp=sec + 1e-9 * nanosec, frame_id=frame_id, incremental=bool(reader.number("B")),
        removed=[reader.text() for _ in range(reader.count(4))],
        patches=[_patch(reader) for _ in range(reader.count(1))],
    )  # fmt: skip


def _patch(reader: CdrReader) -> Patch:
    name, tile, kind = reader.text(), reader.text(), reader.number("B")
    row, column, stride = reader.numbers("I", 3)
    deviation = reader.number("f")
    twist = np.array(reader.numbers("d", 6))
    triangles, vertices = reader.sequence("u4", 3), reader.sequence("f8", 3)
    if triangles.size and int(triangles.max()) >= len(vertices):
        raise InputError("malformed", f"a triangle of the patch of {name!r} has a corner that is no vertex")
    return Patch(
        name=name, kind=KINDS.get(kind, "trimesh"), tile=tile, row=row, column=column, stride=stride,
        deviation=deviation, linear_w=twist[:3], angular_w=twist[3:], vertices_w=vertices, triangles=triangles,
    )  # fmt: skip
