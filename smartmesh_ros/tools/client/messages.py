"""Messages of the client: ``ColliderPatchArray`` read directly from its bytes, without a Python object for each vertex,
and links of a simulator as tracked bodies."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from geometry_msgs.msg import Point, Pose, Quaternion, Twist, Vector3
from smartmesh_msgs.msg import ColliderPatch, TrackedBody, TrackedBodyArray

from smartmesh_ros.errors import InputError
from smartmesh_ros.node.inputs.cdr_reader import CdrReader
from smartmesh_ros.node.outputs import patch_outputs
from smartmesh_ros.tools.client.patch import Patch

Vector = tuple[float, float, float]
KINDS = {ColliderPatch.PLANE: "plane", **{number: kind for kind, number in patch_outputs.KINDS.items()}}


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


@dataclass(frozen=True, kw_only=True)
class TrackedLink:
    """A link that gets a patch, in the terrain's frame: ``position`` of its centre [m], ``radius`` of its bounding
    sphere [m], ``orientation`` (x, y, z, w), ``linear`` [m/s] and ``angular`` [rad/s] velocity. If all velocities of
    a link have been zero so far, the node estimates them from successive poses."""

    name: str
    position: Vector
    radius: float
    orientation: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0)
    linear: Vector = (0.0, 0.0, 0.0)
    angular: Vector = (0.0, 0.0, 0.0)


def tracked_bodies(links: Iterable[TrackedLink], frame_id: str, stamp: Any) -> TrackedBodyArray:
    """Return the message with the states of links at ``stamp``."""
    message = TrackedBodyArray(bodies=[_body(link) for link in links])
    message.header.frame_id, message.header.stamp = frame_id, stamp
    return message


def _body(link: TrackedLink) -> TrackedBody:
    x, y, z, w = map(float, link.orientation)
    pose = Pose(position=_of(Point, link.position), orientation=Quaternion(x=x, y=y, z=z, w=w))
    twist = Twist(linear=_of(Vector3, link.linear), angular=_of(Vector3, link.angular))
    return TrackedBody(id=link.name, pose=pose, twist=twist, radius=float(link.radius))


def _of(kind: Any, values: Vector) -> Any:
    x, y, z = map(float, values)
    return kind(x=x, y=y, z=z)
