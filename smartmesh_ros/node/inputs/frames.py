"""A buffer of transforms between parent and child frames (REP 105), with look-up by time. Without ROS."""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from dataclasses import dataclass, field

from smartmesh_ros.errors import InputError, listed
from smartmesh_ros.ground.quaternions import slerp
from smartmesh_ros.ground.transform import IDENTITY, Transform
from smartmesh_ros.terrain.deck import QUATERNION_SLACK

# A transform that is older than the newest of its child by more than this restarts the child's history, because the
# clock of its source was set back or a recording started over [s].
SET_BACK = 1.0
# Age at which transforms are dropped [s], and most transforms to keep of one child.
HISTORY = 10.0
MOST_KEPT = 2000
# The newest transform holds for this long after its stamp [s]; later look-ups fail.
MAX_HOLD = 0.5


@dataclass
class _Edge:
    """A child's parent, and its transforms by stamp [s]; no stamps = static."""

    parent: str
    stamps: list[float] = field(default_factory=list)
    transforms: list[Transform] = field(default_factory=list)

    def insert(self, stamp: float, transform: Transform) -> None:
        """Insert a transform by its stamp [s]; it replaces one of the same stamp."""
        at = bisect_left(self.stamps, stamp)
        if at < len(self.stamps) and self.stamps[at] == stamp:
            self.transforms[at] = transform
            return
        self.stamps.insert(at, stamp)
        self.transforms.insert(at, transform)
        old = max(bisect_right(self.stamps, self.stamps[-1] - HISTORY) - 1, len(self.stamps) - MOST_KEPT, 0)
        if old > len(self.stamps) // 4:  # in batches, because each deletion shifts the lists
            del self.stamps[:old], self.transforms[:old]


# Most frames in a buffer; more are refused.
MOST_FRAMES = 10_000


class FrameBuffer:
    """Transforms of the last `HISTORY` seconds, with look-up across the frame tree. ``version`` counts additions."""

    def __init__(self) -> None:
        self.version = 0
        self._edges: dict[str, _Edge] = {}

    def clear(self) -> None:
        """Removes all moving transforms, after a clock jumped back."""
        self._edges = {child: edge for child, edge in self._edges.items() if not edge.stamps}

    def add(self, parent: str, child: str, transform: Transform, stamp: float | None) -> float:
        """Add the pose of ``child`` in ``parent`` at ``stamp`` [s], None = static. Raises `InputError`.

        Transforms may arrive in any order; the last one of a stamp counts. Return the time by which the stamp is older
        than the child's history, which it restarts [s]; 0 = it does not.
        """
        if not parent or not child or parent == child:
            raise InputError("frame", f"a transform from {child!r} to {parent!r} needs two distinct frame names")
        if not all(math.isfinite(value) for part in transform for value in part):
            raise InputError("non_finite", f"the transform from {child!r} to {parent!r} is not finite: {transform}")
        length = math.hypot(*transform.rotation)
        if abs(length - 1.0) > QUATERNION_SLACK:
            words = f"the rotation from {child!r} to {parent!r} is no unit quaternion: {transform}"
            raise InputError("quaternion", words)
        x, y, z, w = transform.rotation
        transform = Transform(transform.translation, (x / length, y / length, z / length, w / length))
        edge = self._edges.get(child)
        if edge is None and len(self._edges) >= MOST_FRAMES:
            raise InputError("size", f"there are {MOST_FRAMES} frames already; {child!r} is one too many")
        self.version += 1
        if stamp is None:
            self._edges[child] = _Edge(parent, [], [transform])
        elif edge is None or edge.parent != parent or not edge.stamps:
            self._edges[child] = _Edge(parent, [stamp], [transform])
        elif stamp < edge.stamps[-1] - SET_BACK:
            self._edges[child] = _Edge(parent, [stamp], [transform])
            return edge.stamps[-1] - stamp
        else:
            edge.insert(stamp, transform)
        return 0.0

    def lookup(self, target: str, source: str, stamp: float | None = None) -> tuple[Transform, float | None]:
        """Return the pose of ``source`` in ``target`` at ``stamp`` [s], and that stamp.

        Without a stamp, the newest stamp common to all frames on the path; None if all of them are static. Interpolates
        between transforms. A leading ``/`` of a name means nothing, as to tf2. Raises `InputError` if no path connects
        the frames, or a transform lacks that time.
        """
        target, source = target.strip("/"), source.strip("/")
        up, down = self.way(source), self.way(target)
        shared = next((frame for frame in up if frame in down), None)
        if shared is None:
            frames = sorted({*self._edges, *(edge.parent for edge in self._edges.values())})
            known = listed(frames, 20) or "none yet"
            raise InputError("frame", f"there is no transform from {source!r} to {target!r}; known frames: {known}")
        up, down = up[: up.index(shared)], down[: down.index(shared)]
        moving = [edge.stamps[-1] for child in up + down if (edge := self._edges[child]).stamps]
        if stamp is None:
            stamp = min(moving, default=None)
        outward = self._chain(up, stamp)
        return (self._chain(down, stamp).inverse().then(outward) if down else outward), stamp

    def way(self, frame: str) -> list[str]:
        """Return a frame and those above it, up to the root. Raises `InputError` if the frames form a cycle."""
        way = [frame]
        while (edge := self._edges.get(way[-1])) is not None:
            if edge.parent in way:
                raise InputError("frame", f"the frames form a cycle: {' -> '.join([*way, edge.parent])}")
            way.append(edge.parent)
        return way

    def _chain(self, children: list[str], stamp: float | None) -> Transform:
        whole = IDENTITY
        for child in children:
            whole = self._at(child, stamp).then(whole)
        return whole

    def _at(self, child: str, stamp: float | None) -> Transform:
        edge = self._edges[child]
        if not edge.stamps or stamp is None:
            return edge.transforms[-1]
        after = bisect_right(edge.stamps, stamp)
        if after == 0 or stamp > edge.stamps[-1] + MAX_HOLD:
            words = f"{child!r} in {edge.parent!r} is known from {edge.stamps[0]:.3f} s to {edge.stamps[-1]:.3f} s"
            raise InputError("frame", f"{words}, not at the requested {stamp:.3f} s")
        if after == len(edge.stamps):
            return edge.transforms[-1]
        share = (stamp - edge.stamps[after - 1]) / (edge.stamps[after] - edge.stamps[after - 1])
        (p1, q1), (p2, q2) = edge.transforms[after - 1], edge.transforms[after]
        x, y, z = (a + share * (b - a) for a, b in zip(p1, p2, strict=True))
        return Transform((x, y, z), slerp(q1, q2, share))
