"""Patches in increments, over DDS: whoever keeps what he was sent has the whole picture."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import Point
from smartmesh_msgs.msg import ColliderPatchArray
from visualization_msgs.msg import Marker, MarkerArray

from smartmesh_ros.tools.testing import COLLIDER, Probe
from tests.node.shared import set_parameters

Picture = dict[Any, list[tuple[float, float, float]]]
SETTINGS = {"publish.incremental": True, "terrain.motion": "hold", "patch.kind": "heightfield", "bodies.timeout": 10.0}
LEFT, RIGHT = (1.0, 1.0, 0.1), (4.0, 4.0, 0.1)


def xyz(points: list[Point]) -> list[tuple[float, float, float]]:
    return [(point.x, point.y, point.z) for point in points]


def keep_patches(known: Picture, message: ColliderPatchArray) -> None:
    """Vertices by body, kept as the message definition says."""
    if not message.incremental:
        known.clear()
    for name in message.removed:
        del known[name]
    known.update({patch.body_id: xyz(patch.mesh.vertices) for patch in message.patches})


def keep_markers(known: Picture, message: MarkerArray) -> None:
    """Points by id, kept as a viewer keeps markers."""
    for marker in message.markers:
        known.pop(marker.id, None)
        if marker.action == Marker.ADD:
            known[marker.id] = xyz(marker.points)


class Viewer:
    """Keeps a picture by the messages of a list that grows; each is read once, so that it never falls behind."""

    def __init__(self, messages: list[Any], keep: Callable[[Picture, Any], None]) -> None:
        self._messages, self._keep = messages, keep
        self._read, self._known = 0, Picture()

    @property
    def picture(self) -> Picture:
        """What is to be seen by now."""
        while self._read < len(self._messages):
            self._keep(self._known, self._messages[self._read])
            self._read += 1
        return dict(self._known)


def test_increments_make_the_whole_picture_for_late_joiners_too(probe: Probe) -> None:
    heights = np.random.default_rng(1).normal(0.0, 0.05, (50, 50))
    bodies = {"left": LEFT, "right": RIGHT}
    with probe.running(parameters=SETTINGS):
        patches = probe.received[f"{COLLIDER}/collider_patches"]
        markers = probe.received[f"{COLLIDER}/patches"]
        of_patches, of_markers = Viewer(patches, keep_patches), Viewer(markers, keep_markers)
        probe.publish_map(heights)

        def shown(*names: str) -> bool:
            probe.publish_bodies(bodies)
            probe.spin()
            return of_patches.picture.keys() == set(names) and len(of_markers.picture) == len(names)

        probe.wait_for(lambda: shown("left", "right"))

        # Nothing moves, so nothing is said; then the ground moves under one of the two, and only its patch is sent.
        def quiet() -> bool:
            return shown("left", "right") and not patches[-1].patches and not markers[-1].markers

        for _ in range(10):
            probe.wait_for(quiet)
            assert patches[-1].incremental
            said, low = len(patches), of_patches.picture["right"]
            heights[30:, 30:] += 0.5
            probe.publish_map(heights)

            def raised() -> bool:
                return shown("left", "right") and of_patches.picture["right"] != low  # noqa: B023

            probe.wait_for(raised)
            changed = patches[said:]
            if all(message.incremental for message in changed):
                break  # else a full message came, and the increment after it repeats all patches
        else:
            pytest.fail("ten times, a full message came between the map and its patch")
        assert {patch.body_id for message in changed for patch in message.patches} == {"right"}

        # Whoever joins now is told everything at once, not only when it is everybody's turn.
        late = Probe()
        try:
            theirs = late.received[f"{COLLIDER}/collider_patches"], late.received[f"{COLLIDER}/patches"]
            late_patches, late_markers = Viewer(theirs[0], keep_patches), Viewer(theirs[1], keep_markers)

            def told() -> bool:
                late.spin()
                whole = late_patches.picture, late_markers.picture
                return shown("left", "right") and whole == (of_patches.picture, of_markers.picture)

            probe.wait_for(told)
            assert any(not message.incremental for message in theirs[0][:5])
            assert any(message.markers for message in theirs[1][:5])
        finally:
            late.close()

        del bodies["left"]
        assert set_parameters(probe, {"bodies.timeout": 3.0}).successful
        probe.wait_for(lambda: shown("right"))
        gone = [name for message in patches for name in message.removed]
        whole_since = any(not message.incremental for message in patches[-30:])
        assert gone == ["left"] or (not gone and whole_since)  # said so, unless a full message said it first
