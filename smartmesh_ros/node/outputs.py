"""What the node publishes, as ready bytes. Nothing is built for topics without subscribers."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Hashable, Iterator
from typing import Any

import numpy as np
from geometry_msgs.msg import Point
from numpy.typing import NDArray
from shape_msgs.msg import MeshTriangle
from smartmesh_msgs.msg import ColliderPatch, Contact, TrackedBody
from std_msgs.msg import Header
from visualization_msgs.msg import Marker

from smartmesh_ros.node.cdr import HEADER, Elements, text_rows
from smartmesh_ros.patches.batch import PatchBatch
from smartmesh_ros.physics.contacts import GroundContact
from smartmesh_ros.physics.state import BodyState

KINDS = {
    "heightfield": ColliderPatch.HEIGHTFIELD,
    "plane": ColliderPatch.PLANE,
    "trimesh": ColliderPatch.TRIMESH,
    "hull": ColliderPatch.HULL,
    "prisms": ColliderPatch.PRISMS,
    "whole": ColliderPatch.WHOLE,
}
# Colour of the patches (r, g, b, a).
COLOUR = (0.95, 0.55, 0.15, 0.85)


class ArrayMessage:
    """A message that ends with a sequence, written element group by element group into one reused buffer."""

    def __init__(self) -> None:
        self._layouts: dict[Hashable, Elements] = {}
        self._buffer = np.zeros(4096, np.uint8)
        self._end = 0
        self._count = 0
        self._count_at = 0

    def start(self, header: Header | None) -> None:
        """Begins a message, with its header if its type has one."""
        self._buffer[:4] = np.frombuffer(HEADER, np.uint8)
        self._end = 0
        if header is not None:
            key = ("header", header.frame_id)
            if key not in self._layouts:
                self._layouts[key] = Elements(header)
            stamp = {"stamp.sec": header.stamp.sec, "stamp.nanosec": header.stamp.nanosec}
            self._end = self._layouts[key].put(self._buffer[4:], 0, 1, stamp)
        self._count_at = -(-self._end // 4) * 4
        self._end = self._count_at + 4
        self._count = 0

    def add(self, key: Hashable, template: Any, count: int, fields: dict[str, Any]) -> None:
        """Adds ``count`` elements. ``template``: makes the template element, called once per ``key``."""
        layout = self._layouts.get(key)
        if layout is None:
            layout = self._layouts[key] = Elements(template())
        need = 4 + self._end + layout.size_bound(count)
        if need > len(self._buffer):
            grown = np.zeros(2 * need, np.uint8)
            grown[: 4 + self._end] = self._buffer[: 4 + self._end]
            self._buffer = grown
        self._end = layout.put(self._buffer[4:], self._end, count, fields)
        self._count += count

    def finish(self) -> bytes:
        """The message's bytes."""
        at = 4 + self._count_at
        self._buffer[at : at + 4] = np.frombuffer(np.uint32(self._count).astype("<u4").tobytes(), np.uint8)
        return self._buffer[: 4 + self._end].tobytes()


class PatchMarkers:
    """``~/patches``: one TRIANGLE_LIST marker per patch, with a stable id per body, DELETE when it goes."""

    def __init__(self) -> None:
        self._message = ArrayMessage()
        self._ids: dict[str, int] = {}
        self._next_id = 0
        self._names: list[str] = []
        self._shown: set[int] = set()

    def write(self, header: Header, batches: list[PatchBatch], names: list[str]) -> bytes:
        """The MarkerArray of all patches, and of those that went since the last one.

        ``names``: everything that may have a patch, in the order of the batches' indices; a new list when it changed.
        """
        if names is not self._names:
            self._names = names
            self._ids = {name: self._ids.get(name, self._next_id + new) for new, name in enumerate(names)}
            self._next_id += len(names)
        message = self._message
        message.start(None)
        stamp = {"header.stamp.sec": header.stamp.sec, "header.stamp.nanosec": header.stamp.nanosec}
        shown: set[int] = set()
        for batch, members, triangles in _by_triangles(batches):
            ids = [self._ids[names[index]] for index in batch.bodies[members].tolist()]
            shown.update(ids)
            corners = triangles.ravel()
            message.add(
                (header.frame_id, corners.size),
                lambda: _marker(header.frame_id, Marker.ADD, corners.size),  # noqa: B023  # called at once
                len(ids),
                {**stamp, "id": np.array(ids), "points": batch.vertices_w()[members][:, corners]},
            )
        gone = sorted(self._shown - shown)
        message.add(
            (header.frame_id, "gone"),
            lambda: _marker(header.frame_id, Marker.DELETE, 0),
            len(gone),
            {**stamp, "id": np.array(gone)},
        )
        self._shown = shown
        return message.finish()


class ColliderPatches:
    """``~/collider_patches``: the same geometry for other simulators."""

    def __init__(self) -> None:
        self._message = ArrayMessage()

    def write(self, header: Header, batches: list[PatchBatch], names: list[str], carry_velocity: bool) -> bytes:
        """The ColliderPatchArray of all patches."""
        message = self._message
        message.start(header)
        for batch, members, triangles in _by_triangles(batches):
            vertices = batch.vertices_w()[members]
            for part, texts in _by_length([names[index] for index in batch.bodies[members].tolist()]):
                chosen = members[part]
                fields = {
                    "body_id": text_rows(texts),
                    "row": batch.rows[chosen],
                    "column": batch.columns[chosen],
                    "stride": batch.stride[chosen],
                    "deviation": batch.deviation[chosen],
                    "mesh.vertices": vertices[part],
                    "mesh.triangles": np.broadcast_to(triangles, (len(texts), *triangles.shape)),
                }
                if carry_velocity:
                    for axis, name in enumerate("xyz"):
                        fields[f"surface_twist.linear.{name}"] = batch.linear_w[chosen, axis]
                        fields[f"surface_twist.angular.{name}"] = batch.angular_w[chosen, axis]
                message.add(
                    (batch.tile, batch.kind, len(texts[0].encode()), vertices.shape[1], len(triangles)),
                    lambda: _collider_patch(batch.tile, batch.kind, texts[0], vertices.shape[1], len(triangles)),  # noqa: B023
                    len(texts),
                    fields,
                )
        return message.finish()


class BodyStates:
    """``~/body_states``: every simulated body."""

    def __init__(self) -> None:
        self._message = ArrayMessage()

    def write(self, header: Header, bodies: list[tuple[str, float, BodyState]]) -> bytes:
        """The TrackedBodyArray of bodies given as name, radius and state."""
        message = self._message
        message.start(header)
        # Order of spawning: neighbours with names of equal length go together.
        start = 0
        while start < len(bodies):
            length = len(bodies[start][0].encode())
            end = start
            while end < len(bodies) and len(bodies[end][0].encode()) == length:
                end += 1
            group = bodies[start:end]
            numbers = np.array([(*s.position, *s.orientation, *s.linear, *s.angular) for _, _, s in group])
            fields: dict[str, Any] = {
                "id": text_rows([name for name, _, _ in group]),
                "radius": np.array([radius for _, radius, _ in group]),
            }
            for column, path in enumerate(_STATE_FIELDS):
                fields[path] = numbers[:, column]
            message.add(length, lambda: TrackedBody(id="x" * length), len(group), fields)  # noqa: B023  # called at once
            start = end
        return message.finish()


class Contacts:
    """``~/contacts``: contacts between bodies and the ground."""

    def __init__(self) -> None:
        self._message = ArrayMessage()

    def write(self, header: Header, contacts: list[GroundContact]) -> bytes:
        """The ContactArray."""
        message = self._message
        message.start(header)
        for part, texts in _by_length([contact.body for contact in contacts]):
            group = [contacts[index] for index in part.tolist()]
            fields: dict[str, Any] = {
                "body_id": text_rows(texts),
                "depth": np.array([contact.depth for contact in group]),
                "normal_force": np.array([contact.normal_force for contact in group]),
            }
            for axis, name in enumerate("xyz"):
                fields[f"position.{name}"] = np.array([contact.position[axis] for contact in group])
                fields[f"normal.{name}"] = np.array([contact.normal[axis] for contact in group])
            length = len(texts[0].encode())
            message.add(length, lambda: Contact(body_id="x" * length), len(group), fields)  # noqa: B023
        return message.finish()


_STATE_FIELDS = (
    *(f"pose.position.{axis}" for axis in "xyz"),
    *(f"pose.orientation.{axis}" for axis in "xyzw"),
    *(f"twist.linear.{axis}" for axis in "xyz"),
    *(f"twist.angular.{axis}" for axis in "xyz"),
)


def _by_triangles(batches: list[PatchBatch]) -> Iterator[tuple[PatchBatch, NDArray[np.int64], NDArray[np.int32]]]:
    """Patches grouped by the triangles they show: those that touch a hole are left out."""
    for batch in batches:
        members = np.arange(len(batch.bodies))
        if batch.may_have_holes:
            ground = ~np.isnan(batch.vertices_w()[..., 2])
            for index in np.flatnonzero(~ground.all(axis=1)):
                solid = ground[index][batch.triangles].all(axis=1)
                if solid.any():
                    yield batch, np.array([index]), batch.triangles[solid]
            members = np.flatnonzero(ground.all(axis=1))
        if members.size:
            yield batch, members, batch.triangles


def _by_length(texts: list[str]) -> Iterator[tuple[NDArray[np.int64], list[str]]]:
    """Texts grouped by their length in bytes, with their indices."""
    groups: dict[int, list[int]] = defaultdict(list)
    for index, text in enumerate(texts):
        groups[len(text.encode())].append(index)
    for indices in groups.values():
        yield np.array(indices), [texts[index] for index in indices]


def _marker(frame_id: str, action: int, points: int) -> Marker:
    marker = Marker(ns="patches", type=Marker.TRIANGLE_LIST, action=action)
    marker.header.frame_id = frame_id
    marker.scale.x = marker.scale.y = marker.scale.z = 1.0
    marker.color.r, marker.color.g, marker.color.b, marker.color.a = COLOUR
    marker.points = [Point()] * points
    return marker


def _collider_patch(tile: str, kind: str, name: str, vertices: int, triangles: int) -> ColliderPatch:
    patch = ColliderPatch(body_id=name, tile=tile, kind=KINDS[kind])
    patch.mesh.triangles = [MeshTriangle()] * triangles
    patch.mesh.vertices = [Point()] * vertices
    return patch
