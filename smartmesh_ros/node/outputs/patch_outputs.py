"""Messages of patches, serialised to bytes: of all patches, or of those that changed since the last message."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Hashable, Iterator
from functools import partial
from typing import NamedTuple

import numpy as np
from geometry_msgs.msg import Point
from numpy.typing import NDArray
from shape_msgs.msg import MeshTriangle
from smartmesh_msgs.msg import ColliderPatch, ColliderPatchArray
from std_msgs.msg import Header
from visualization_msgs.msg import Marker, MarkerArray

from smartmesh_ros.node.outputs.cdr import ArrayMessage, by_length, stamp_fields, text_rows
from smartmesh_ros.patches.batch import PatchBatch
from smartmesh_ros.terrain.grid import FloatArray, IntArray


class PatchGroup(NamedTuple):
    """Patches of a batch with the same triangles (T, 3): rows ``members`` (n,) of the batch, their bodies (n,) and
    vertices (n, K, 3) [m]. ``whole``: the group has all triangles of the batch, none removed at a hole."""

    batch: PatchBatch
    members: NDArray[np.int64]
    bodies: NDArray[np.int64]
    vertices_w: NDArray[np.float64]
    triangles: NDArray[np.int32]
    whole: bool


def by_triangles(batches: list[PatchBatch]) -> Iterator[PatchGroup]:
    """Yield the patches grouped by their triangles; triangles that touch a hole are removed."""
    for batch in batches:
        vertices = batch.vertices_w
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


class SentPatches:
    """The patches of the last message of changes, by body."""

    def __init__(self) -> None:
        self._sent: dict[int, tuple[Hashable, bytes]] = {}
        self._now: dict[int, tuple[Hashable, bytes]] = {}  # of the message that is being written

    def end(self) -> None:
        """Ends a message. Bodies without a patch in it will count as changed when they return, and so will all bodies
        after a message of all patches."""
        self._sent, self._now = self._now, {}

    def changed(self, group: PatchGroup, kind: Hashable, *values: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return which patches of a group (n,) differ from those last sent, and record the group as sent.

        ``kind``: key of the constant content of the group. ``values`` (n, ...): all other content of its patches.
        """
        count = len(group.bodies)
        if not group.whole:  # at a hole: rare, and each has its own triangles
            return np.ones(count, bool)
        key = kind, group.triangles.tobytes()
        rows = np.concatenate([part.reshape(count, -1) for part in values], axis=1, dtype=np.float64)
        new = {body: (key, row.tobytes()) for body, row in zip(group.bodies.tolist(), rows, strict=True)}
        self._now |= new
        return np.array([self._sent.get(body) != patch for body, patch in new.items()], bool)


KINDS = {
    "heightfield": ColliderPatch.HEIGHTFIELD,
    "trimesh": ColliderPatch.TRIMESH,
    "hull": ColliderPatch.HULL,
    "prisms": ColliderPatch.PRISMS,
    "whole": ColliderPatch.WHOLE,
}
# Id of the marker that deletes all others. RViz reports an error if an id comes twice in an array.
NO_ID = -1
# Colour of the patches (r, g, b, a).
COLOUR = (0.95, 0.55, 0.15, 0.85)


class PatchMarkers:
    """``~/patches``: one TRIANGLE_LIST marker per patch with a constant id per body, and DELETE when the patch goes.

    The markers are ``frame_locked``: RViz places them by the newest transform to its Fixed Frame, and again at each
    redraw. Else it would ask for the transform at the marker's stamp, which is newer than any that it has.
    """

    def __init__(self, namespace: str = "patches") -> None:
        self._namespace = namespace
        self._message = ArrayMessage()
        self._ids: dict[str, int] = {}
        self._id_of = np.empty(0, np.int64)  # marker ids by slot
        self._next_id = 0
        self._epoch = -1  # of the bodies known here
        self._shown = np.empty(0, np.int64)  # ids, ascending
        self._sent = SentPatches()

    def write(
        self,
        header: Header,
        batches: list[PatchBatch],
        names: list[str],
        epoch: int,
        *,
        only_changed: bool = False,
        clear: bool = False,
    ) -> bytes:
        """Return the MarkerArray of all patches (or of the changed ones), with DELETE for removed patches.

        ``names``: names of all bodies that may have a patch, by slot; ``epoch`` changes when the bodies change.
        ``clear``: first delete all markers of the namespace, such as those of a node that ended.
        """
        self._assign_ids(names, epoch)
        message = self._message
        message.start("markers", MarkerArray)
        if clear:
            self._add_clearing(header)
        stamp = stamp_fields(header)
        # Patches of equal size form one group, planes and heightfields alike.
        ids: dict[int, list[IntArray]] = defaultdict(list)
        points: dict[int, list[FloatArray]] = defaultdict(list)
        shown = [np.empty(0, np.int64)]
        for group in by_triangles(batches):
            of_group, vertices, size = self._id_of[group.bodies], group.vertices_w, group.triangles.size
            shown.append(of_group)
            if only_changed:
                changed = self._sent.changed(group, "marker", vertices)
                of_group, vertices = of_group[changed], vertices[changed]
            ids[size].append(of_group)
            points[size].append(vertices.take(group.triangles.ravel(), axis=1))
        for size, parts in points.items():
            fields = {**stamp, "id": np.concatenate(ids[size]), "points": np.concatenate(parts)}
            make = partial(_marker, self._namespace, header.frame_id, Marker.ADD, size)
            message.add((header.frame_id, size), make, len(fields["id"]), fields)
        gone = self._gone(np.sort(np.concatenate(shown)))
        make = partial(_marker, self._namespace, header.frame_id, Marker.DELETE, 0)
        message.add((header.frame_id, "gone"), make, len(gone), {**stamp, "id": gone})
        self._sent.end()
        return message.finish()

    def cleared(self, header: Header) -> bytes:
        """Return the MarkerArray that deletes all markers of the namespace."""
        self._message.start("markers", MarkerArray)
        self._add_clearing(header)
        return self._message.finish()

    def _add_clearing(self, header: Header) -> None:
        make = partial(_marker, self._namespace, header.frame_id, Marker.DELETEALL, 0)
        self._message.add((header.frame_id, "all"), make, 1, {**stamp_fields(header), "id": NO_ID})

    def _assign_ids(self, names: list[str], epoch: int) -> None:
        """Assigns marker ids to new bodies."""
        if epoch != self._epoch:
            self._epoch = epoch
            self._ids = {name: self._ids.get(name, self._next_id + new) for new, name in enumerate(names)}
            self._id_of = np.array([self._ids[name] for name in names], np.int64)
            self._next_id += len(names)
            self._sent = SentPatches()

    def _gone(self, shown: IntArray) -> IntArray:
        """Return the ids that were shown before but are not in ``shown`` (n,), ascending."""
        before, self._shown = self._shown, shown
        return before[:0] if np.array_equal(before, shown) else np.setdiff1d(before, shown)


class ColliderPatches:
    """``~/collider_patches``: the geometry of the patches, for other simulators."""

    def __init__(self) -> None:
        self._message = ArrayMessage()
        self._names: list[str] = []
        self._epoch = -1  # of the bodies known here
        self._shown: set[str] = set()
        self._sent = SentPatches()

    def write(
        self,
        header: Header,
        batches: list[PatchBatch],
        names: list[str],
        epoch: int,
        carry_velocity: bool,
        *,
        only_changed: bool = False,
    ) -> bytes:
        """Return the ColliderPatchArray of all patches, or of the changed patches and the removed bodies.

        ``names``: names of all bodies that may have a patch, by slot; ``epoch`` changes when the bodies change.
        """
        if epoch != self._epoch:
            self._epoch, self._names = epoch, names
            self._sent = SentPatches()
        groups = list(by_triangles(batches))
        shown = {names[index] for group in groups for index in group.bodies.tolist()}
        gone = sorted(self._shown - shown) if only_changed else []
        self._shown = shown
        self._message.start(
            None if gone else (header.frame_id, only_changed),
            lambda: ColliderPatchArray(header=header, incremental=only_changed, removed=gone),
            stamp_fields(header),
        )
        for group in groups:
            self._add(group, carry_velocity, only_changed)
        self._sent.end()
        return self._message.finish()

    def _add(self, group: PatchGroup, carry_velocity: bool, only_changed: bool) -> None:
        """Adds all patches of a group, or only the changed ones."""
        batch, triangles = group.batch, group.triangles
        placed = np.stack([batch.rows, batch.columns, batch.stride, batch.deviation], axis=1)[group.members]
        twist = np.concatenate([batch.linear_w, batch.angular_w], axis=1)[group.members]
        vertices = group.vertices_w
        chosen = np.arange(len(vertices))
        if only_changed:
            kind = (batch.tile, batch.kind, carry_velocity)
            chosen = np.flatnonzero(self._sent.changed(group, kind, vertices, placed, twist))
        for some, texts in by_length([self._names[index] for index in group.bodies[chosen].tolist()]):
            part = chosen[some]
            fields = {
                "body_id": text_rows(texts),
                **dict(zip(("row", "column", "stride", "deviation"), placed[part].T, strict=True)),
                "mesh.vertices": vertices[part],
                "mesh.triangles": np.broadcast_to(triangles, (len(texts), *triangles.shape)),
            }
            if carry_velocity:
                fields.update(zip(_TWIST_FIELDS, twist[part].T, strict=True))
            size = vertices.shape[1]
            self._message.add(
                (batch.tile, batch.kind, len(texts[0].encode()), size, len(triangles)),
                lambda: _collider_patch(batch.tile, batch.kind, texts[0], size, len(triangles)),  # noqa: B023
                len(texts),
                fields,
            )


_TWIST_FIELDS = tuple(f"surface_twist.{part}.{axis}" for part in ("linear", "angular") for axis in "xyz")


def _marker(namespace: str, frame_id: str, action: int, points: int) -> Marker:
    marker = Marker(ns=namespace, type=Marker.TRIANGLE_LIST, action=action, frame_locked=True)
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
