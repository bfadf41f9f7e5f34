"""Messages of patches, serialised to bytes: of all patches, or of those that changed since the last message."""

from __future__ import annotations

from collections import defaultdict
from functools import partial

import numpy as np
from geometry_msgs.msg import Point
from numpy.typing import NDArray
from shape_msgs.msg import MeshTriangle
from smartmesh_msgs.msg import ColliderPatch, ColliderPatchArray
from std_msgs.msg import Header
from visualization_msgs.msg import Marker

from smartmesh_ros.ground.shown_patches import PatchTable, ShownPatches
from smartmesh_ros.node.outputs.cdr import ArrayMessage, fields_of, stamp_fields
from smartmesh_ros.terrain.grid import IntArray


class SentPatches:
    """Revisions of the patches of the last message, by slot, while the bodies stay the same. Those without a patch in
    it count as changed when they return."""

    def __init__(self) -> None:
        self._epoch, self._sent = -1, np.empty(0, np.int64)

    def renewed(self, epoch: int, capacity: int) -> bool:
        """Return True if the ``epoch`` is another than at the last call, and forget the patches then. ``capacity``:
        number of slots."""
        if epoch == self._epoch:
            return False
        self._epoch, self._sent = epoch, np.full(capacity, -1)
        return True

    def changed(self, slots: IntArray, revisions: IntArray) -> NDArray[np.bool_]:
        """Return which of the patches of ``slots`` (n,) differ from those last sent, and note them as sent."""
        before = self._sent[slots]
        self._sent.fill(-1)
        self._sent[slots] = revisions
        return np.asarray(before != revisions)


# Id of the marker that deletes all others. RViz reports an error if an id comes twice in an array.
NO_ID = -1
# Height of the markers' poses above the ground [m], so that displays of the same ground do not hide them.
LIFT = 0.005
# Colour of the patches (r, g, b, a).
COLOUR = (0.95, 0.55, 0.15, 0.85)


def deletion(header: Header, namespace: str) -> Marker:
    """Return the marker that deletes all markers of a namespace."""
    return Marker(header=header, ns=namespace, id=NO_ID, action=Marker.DELETEALL)


class PatchMarkers:
    """``~/patches``: one TRIANGLE_LIST marker per patch with a constant id per body, and DELETE when the patch goes.

    The markers are ``frame_locked``: RViz places them by the newest transform to its Fixed Frame, and again at each
    redraw. Else it would ask for the transform at the marker's stamp, which is newer than any that it has.
    """

    def __init__(self, namespace: str = "patches") -> None:
        self._namespace = namespace
        self._ids: dict[str, int] = {}
        self._id_of = np.empty(0, np.int64)  # marker ids by slot
        self._next_id = 0
        self._shown = np.empty(0, np.int64)  # ids, ascending
        self._sent = SentPatches()

    def write(
        self,
        header: Header,
        patches: ShownPatches,
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
        if self._sent.renewed(epoch, len(names)):
            self._ids = {name: self._ids.get(name, self._next_id + new) for new, name in enumerate(names)}
            self._id_of = np.array([self._ids[name] for name in names], np.int64)
            self._next_id += len(names)
        changed = self._sent.changed(patches.slots, patches.marker_revisions())
        shown = self._id_of[patches.slots]
        written = changed if only_changed else np.ones(len(shown), bool)
        before, self._shown = self._shown, np.sort(shown)
        gone = before[:0] if np.array_equal(before, self._shown) else np.setdiff1d(before, self._shown)
        return patches.markers(
            patches.slots[written], shown[written], gone, (header.stamp.sec, header.stamp.nanosec), header.frame_id,
            self._namespace, COLOUR, LIFT, clear=clear,
        )  # fmt: skip


class ColliderPatches:
    """``~/collider_patches``: the geometry of the patches, for other simulators."""

    def __init__(self) -> None:
        self._message = ArrayMessage()
        self._shown: set[str] = set()
        self._sent = SentPatches()

    def write(
        self, header: Header, patches: PatchTable, names: list[str], epoch: int, *, only_changed: bool = False
    ) -> bytes:
        """Return the ColliderPatchArray of all patches, or of the changed patches and the removed bodies.

        ``names``: names of all bodies that may have a patch, by slot; ``epoch`` changes when the bodies change.
        """
        self._sent.renewed(epoch, len(names))
        bodies = [names[slot] for slot in patches.slots.tolist()]
        before, self._shown = self._shown, set(bodies)
        gone = sorted(before - self._shown) if only_changed else []
        start = {**stamp_fields(header), "incremental": only_changed}
        empty = partial(ColliderPatchArray, header=header, removed=gone)
        self._message.start(None if gone else header.frame_id, empty, start)
        changed = self._sent.changed(patches.slots, patches.revisions)
        chosen = np.flatnonzero(changed) if only_changed else np.arange(len(patches))
        sizes = np.column_stack([patches.counts, patches.triangle_counts])
        starts = np.cumsum(sizes, axis=0) - sizes
        groups: dict[tuple[int, int], list[int]] = defaultdict(list)
        for index, (points, triangles) in zip(chosen.tolist(), sizes[chosen].tolist(), strict=True):
            groups[points, triangles].append(index)
        for size, members in groups.items():
            points, triangles = size
            first = starts[members, :, None]
            fields = {
                "kind": np.where(patches.is_mesh[members], ColliderPatch.TRIMESH, ColliderPatch.HEIGHTFIELD),
                "row": patches.rows[members], "column": patches.columns[members], "stride": patches.stride[members],
                # A patch of all samples is the ground itself.
                "deviation": np.where(patches.stride[members] == 1, 0.0, np.nan),
                "mesh.vertices": patches.points_w[first[:, 0] + np.arange(points)],
                "mesh.triangles": patches.triangles[first[:, 1] + np.arange(triangles)],
                **dict(zip(_TWIST_FIELDS, patches.motion[members].T, strict=True)),
            }  # fmt: skip
            texts = {name: [of[k] for k in members] for name, of in (("body_id", bodies), ("tile", patches.tiles))}
            self._message.add_named(partial(_collider_patch, points, triangles), texts, fields, key=size)
        return self._message.finish()


_TWIST_FIELDS = (*fields_of("surface_twist.linear"), *fields_of("surface_twist.angular"))


def _collider_patch(vertices: int, triangles: int, name: str, tile: str) -> ColliderPatch:
    patch = ColliderPatch(body_id=name, tile=tile)
    patch.mesh.triangles = [MeshTriangle()] * triangles
    patch.mesh.vertices = [Point()] * vertices
    return patch
