"""What the node publishes, as ready bytes. Nothing is built for topics without subscribers."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Hashable, Iterator
from typing import Any, NamedTuple

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
from smartmesh_ros.physics.states import StateTable

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
        # What was added where in this message and in the one before: where nothing differs, the constant bytes stand.
        self._added: list[Hashable] = []
        self._before: list[Hashable] = []

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
        self._before, self._added = self._added, [self._end]
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
            self._before = []
        self._added.append((key, count, *fields))
        same = self._added == self._before[: len(self._added)]
        self._end = layout.put(self._buffer[4:], self._end, count, fields, same=same)
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
        self._sent = SentPatches()

    def write(
        self, header: Header, batches: list[PatchBatch], names: list[str], *, only_changed: bool = False
    ) -> bytes:
        """The MarkerArray of all patches (or of those that differ from what was last sent), and of those that went.

        ``names``: everything that may have a patch, in the order of the batches' indices; a new list when it changed.
        """
        if names is not self._names:
            self._names = names
            self._ids = {name: self._ids.get(name, self._next_id + new) for new, name in enumerate(names)}
            self._next_id += len(names)
            self._sent = SentPatches(len(names))
        message = self._message
        message.start(None)
        stamp = {"header.stamp.sec": header.stamp.sec, "header.stamp.nanosec": header.stamp.nanosec}
        shown: set[int] = set()
        for group in _by_triangles(batches):
            ids = np.array([self._ids[names[index]] for index in group.bodies.tolist()], np.int64)
            shown.update(ids.tolist())
            vertices = group.vertices_w
            if only_changed:
                changed = self._sent.changed(group)
                ids, vertices = ids[changed], vertices[changed]
            corners = group.triangles.ravel()
            message.add(
                (header.frame_id, corners.size),
                lambda: _marker(header.frame_id, Marker.ADD, corners.size),  # noqa: B023  # called at once
                len(ids),
                {**stamp, "id": ids, "points": vertices[:, corners]},
            )
        gone = sorted(self._shown - shown)
        message.add(
            (header.frame_id, "gone"),
            lambda: _marker(header.frame_id, Marker.DELETE, 0),
            len(gone),
            {**stamp, "id": np.array(gone)},
        )
        self._shown = shown
        if only_changed:
            self._sent.end()
        else:
            self._sent.forget()
        return message.finish()


class SentPatches:
    """The patches as they were last sent, to tell which have changed."""

    def __init__(self, count: int = 0) -> None:
        self._count = count
        self._kinds: dict[tuple[int, bytes], tuple[int, NDArray[np.float64]]] = {}
        # Which of them each body's was, -1 = none; and whether it was there this time.
        self._kind = np.full(count, -1)
        self._there = np.zeros(count, bool)

    def end(self) -> None:
        """Ends a message: a body that was not in it comes back as new."""
        self._kind[~self._there] = -1
        self._there[:] = False

    def forget(self) -> None:
        """Takes every patch as changed the next time."""
        self._kind[:] = -1

    def changed(self, group: PatchGroup) -> NDArray[np.bool_]:
        """Which of a group are not as they were sent last (n,); takes them as sent."""
        self._there[group.bodies] = True
        if not group.whole:  # at a hole: rare, and of any shape
            self._kind[group.bodies] = -1
            return np.ones(len(group.bodies), bool)
        key = (group.vertices_w.shape[1], group.triangles.tobytes())
        if key not in self._kinds:
            self._kinds[key] = len(self._kinds), np.full((self._count, key[0], 3), np.nan)
        kind, sent = self._kinds[key]
        differs = (self._kind[group.bodies] != kind) | (sent[group.bodies] != group.vertices_w).any(axis=(1, 2))
        bodies = group.bodies[differs]
        self._kind[bodies] = kind
        sent[bodies] = group.vertices_w[differs]
        return np.asarray(differs)


class ColliderPatches:
    """``~/collider_patches``: the same geometry for other simulators."""

    def __init__(self) -> None:
        self._message = ArrayMessage()

    def write(self, header: Header, batches: list[PatchBatch], names: list[str], carry_velocity: bool) -> bytes:
        """The ColliderPatchArray of all patches."""
        message = self._message
        message.start(header)
        for group in _by_triangles(batches):
            batch, members, triangles = group.batch, group.members, group.triangles
            for part, texts in _by_length([names[index] for index in group.bodies.tolist()]):
                chosen = members[part]
                fields = {
                    "body_id": text_rows(texts),
                    "row": batch.rows[chosen],
                    "column": batch.columns[chosen],
                    "stride": batch.stride[chosen],
                    "deviation": batch.deviation[chosen],
                    "mesh.vertices": group.vertices_w[part],
                    "mesh.triangles": np.broadcast_to(triangles, (len(texts), *triangles.shape)),
                }
                if carry_velocity:
                    for axis, name in enumerate("xyz"):
                        fields[f"surface_twist.linear.{name}"] = batch.linear_w[chosen, axis]
                        fields[f"surface_twist.angular.{name}"] = batch.angular_w[chosen, axis]
                vertices = group.vertices_w.shape[1]
                message.add(
                    (batch.tile, batch.kind, len(texts[0].encode()), vertices, len(triangles)),
                    lambda: _collider_patch(batch.tile, batch.kind, texts[0], vertices, len(triangles)),  # noqa: B023
                    len(texts),
                    fields,
                )
        return message.finish()


class BodyStates:
    """``~/body_states``: every simulated body."""

    def __init__(self) -> None:
        self._message = ArrayMessage()

    def write(self, header: Header, states: StateTable) -> bytes:
        """The TrackedBodyArray."""
        message = self._message
        message.start(header)
        # Order of spawning: neighbours with names of equal length go together.
        lengths = np.array([len(name.encode()) for name in states.names], np.int64)
        starts = np.flatnonzero(np.diff(lengths, prepend=-1))
        ends = np.append(starts[1:], len(lengths))[: len(starts)]
        for start, end in zip(starts.tolist(), ends.tolist(), strict=True):
            length = int(lengths[start])
            fields: dict[str, Any] = {"id": text_rows(states.names[start:end]), "radius": states.radii[start:end]}
            for column, path in enumerate(_STATE_FIELDS):
                fields[path] = states.numbers[start:end, column]
            message.add(length, lambda: TrackedBody(id="x" * length), end - start, fields)  # noqa: B023  # called at once
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
            numbers = np.array([(*c.position, *c.normal, c.depth, c.normal_force) for c in group])
            fields: dict[str, Any] = {path: numbers[:, column] for column, path in enumerate(_CONTACT_FIELDS)}
            fields["body_id"] = text_rows(texts)
            length = len(texts[0].encode())
            message.add(length, lambda: Contact(body_id="x" * length), len(group), fields)  # noqa: B023
        return message.finish()


_CONTACT_FIELDS = (
    *(f"position.{axis}" for axis in "xyz"),
    *(f"normal.{axis}" for axis in "xyz"),
    "depth",
    "normal_force",
)
_STATE_FIELDS = (
    *(f"pose.position.{axis}" for axis in "xyz"),
    *(f"pose.orientation.{axis}" for axis in "xyzw"),
    *(f"twist.linear.{axis}" for axis in "xyz"),
    *(f"twist.angular.{axis}" for axis in "xyz"),
)


class PatchGroup(NamedTuple):
    """Patches of a batch that show the same triangles (T, 3): rows ``members`` (n,) of the batch, their bodies (n,) and
    vertices (n, K, 3) [m]. ``whole``: whether these are all triangles of the batch."""

    batch: PatchBatch
    members: NDArray[np.int64]
    bodies: NDArray[np.int64]
    vertices_w: NDArray[np.float64]
    triangles: NDArray[np.int32]
    whole: bool


def _by_triangles(batches: list[PatchBatch]) -> Iterator[PatchGroup]:
    """Patches grouped by the triangles they show: those that touch a hole are left out."""
    for batch in batches:
        vertices = batch.vertices_w()
        if not batch.may_have_holes:
            yield PatchGroup(batch, np.arange(len(vertices)), batch.bodies, vertices, batch.triangles, True)
            continue
        ground = ~np.isnan(vertices[..., 2])
        for index in np.flatnonzero(~ground.all(axis=1)):
            solid = ground[index][batch.triangles].all(axis=1)
            if solid.any():
                one = np.array([index])
                yield PatchGroup(batch, one, batch.bodies[one], vertices[one], batch.triangles[solid], False)
        members = np.flatnonzero(ground.all(axis=1))
        if members.size:
            yield PatchGroup(batch, members, batch.bodies[members], vertices[members], batch.triangles, True)


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
