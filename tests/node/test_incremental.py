"""Patches in increments, over DDS: whoever keeps what he was sent has the whole picture."""

from typing import Any

import numpy as np
from geometry_msgs.msg import Point
from smartmesh_msgs.msg import ColliderPatchArray
from visualization_msgs.msg import Marker, MarkerArray

from smartmesh_ros.testing import COLLIDER, Probe

Picture = dict[Any, list[tuple[float, float, float]]]
SETTINGS = {"publish.incremental": True, "terrain.motion": "hold", "patch.kind": "heightfield", "bodies.timeout": 1.0}
LEFT, RIGHT = (1.0, 1.0, 0.1), (4.0, 4.0, 0.1)


def xyz(points: list[Point]) -> list[tuple[float, float, float]]:
    return [(point.x, point.y, point.z) for point in points]


def picture_of_patches(messages: list[ColliderPatchArray]) -> Picture:
    """Vertices by body, kept as the message definition says."""
    known: Picture = {}
    for message in messages:
        if not message.incremental:
            known = {}
        for name in message.removed:
            del known[name]
        known.update({patch.body_id: xyz(patch.mesh.vertices) for patch in message.patches})
    return known


def picture_of_markers(messages: list[MarkerArray]) -> Picture:
    """Points by id, kept as a viewer keeps markers."""
    known: Picture = {}
    for message in messages:
        for marker in message.markers:
            known.pop(marker.id, None)
            if marker.action == Marker.ADD:
                known[marker.id] = xyz(marker.points)
    return known


def test_increments_make_the_whole_picture_for_late_joiners_too(probe: Probe) -> None:
    heights = np.random.default_rng(1).normal(0.0, 0.05, (50, 50))
    bodies = {"left": LEFT, "right": RIGHT}
    with probe.running(parameters=SETTINGS):
        patches = probe.received[f"{COLLIDER}/collider_patches"]
        markers = probe.received[f"{COLLIDER}/patches"]
        probe.publish_map(heights)

        def shown(*names: str) -> bool:
            probe.publish_bodies(bodies)
            probe.spin()
            return picture_of_patches(patches).keys() == set(names) and len(picture_of_markers(markers)) == len(names)

        probe.wait_for(lambda: shown("left", "right"))

        # Nothing moves, so nothing is said; then the ground moves under one of the two, and only its patch is sent.
        def quiet() -> bool:
            return shown("left", "right") and not patches[-1].patches and not markers[-1].markers

        probe.wait_for(quiet)
        assert patches[-1].incremental
        said = len(patches), len(markers)
        heights[30:, 30:] += 0.5
        probe.publish_map(heights)
        low = picture_of_patches(patches)["right"]

        def raised() -> bool:
            return shown("left", "right") and picture_of_patches(patches)["right"] != low

        probe.wait_for(raised)
        changed = [message for message in patches[said[0] :] if message.incremental]
        assert {patch.body_id for message in changed for patch in message.patches} <= {"right"}

        # Whoever joins now is told everything at once, not only when it is everybody's turn.
        late = Probe()
        try:
            theirs = late.received[f"{COLLIDER}/collider_patches"], late.received[f"{COLLIDER}/patches"]

            def told() -> bool:
                late.spin()
                whole = picture_of_patches(theirs[0]), picture_of_markers(theirs[1])
                return shown("left", "right") and whole == (picture_of_patches(patches), picture_of_markers(markers))

            probe.wait_for(told)
            assert any(not message.incremental for message in theirs[0][:5])
            assert any(message.markers for message in theirs[1][:5])
        finally:
            late.close()

        del bodies["left"]
        probe.wait_for(lambda: shown("right"))
        gone = [name for message in patches for name in message.removed]
        whole_since = any(not message.incremental for message in patches[-30:])
        assert gone == ["left"] or (not gone and whole_since)  # said so, unless a full message said it first
