"""``ColliderPatchArray`` read directly from its bytes, without a Python object for each vertex."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from smartmesh_msgs.msg import ColliderPatch

from smartmesh_ros.errors import InputError
from smartmesh_ros.node.inputs.cdr_reader import CdrReader
from smartmesh_ros.node.outputs import patch_outputs
from smartmesh_ros.tools.client.patch import Patch

KINDS = {ColliderPatch.PLANE: "plane", **{number: kind for kind, number in patch_outputs.KINDS.items()}}


@dataclass(frozen=True, kw_only=True)
class PatchesMessage:
    """Content of a ColliderPatchArray. ``stamp`` [s] is on the node's ROS clock; other fields as in the message."""

    stamp: float
    frame_id: str
    incremental: bool
    removed: list[str]
    patches: list[Patch]


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
