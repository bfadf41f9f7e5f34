"""What RViz keeps of ``~/patches``, by namespace and id until a marker deletes it, across ends and starts of a node."""

import signal
from typing import Any

import numpy as np
import pytest
from visualization_msgs.msg import Marker, MarkerArray

from smartmesh_ros.tools.testing import Probe, Process


class Display:
    """Markers as RViz keeps them: a DELETEALL with a namespace deletes that namespace in new versions, all in old."""

    def __init__(self, probe: Probe, *, by_namespace: bool) -> None:
        self.shown: dict[tuple[str, int], Marker] = {}
        self.doubled = False
        self._by_namespace = by_namespace
        probe.node.create_subscription(MarkerArray, probe.topic("patches"), self._take, 100)

    def _take(self, message: MarkerArray) -> None:
        keys = [(marker.ns, marker.id) for marker in message.markers]
        self.doubled |= len(set(keys)) < len(keys)
        for key, marker in zip(keys, message.markers, strict=True):
            if marker.action == Marker.DELETEALL:
                kept = (lambda ns, of=marker.ns: of and ns != of) if self._by_namespace else (lambda ns: False)
                self.shown = {key: marker for key, marker in self.shown.items() if kept(key[0])}
            elif marker.action == Marker.DELETE:
                self.shown.pop(key, None)
            else:
                self.shown[key] = marker

    def places(self) -> list[int]:
        return sorted(round(marker.points[0].x + 0.5) for marker in self.shown.values())


def publish(probe: Probe, places: tuple[float, ...]) -> None:
    probe.publish_bodies({f"b{x}": (x, 0.0, 0.2) for x in places}, radius=0.25)
    probe.spin()


@pytest.mark.parametrize("more", [{}, {"publish.incremental": True}])
def test_patches_go_with_their_node(probe: Probe, more: dict[str, Any]) -> None:
    displays = [Display(probe, by_namespace=by_namespace) for by_namespace in (True, False)]

    def show(*places: float) -> bool:
        publish(probe, places)
        return all(display.places() == list(places) for display in displays)

    for places, ends in (((0.0, 2.0, 4.0), signal.SIGKILL), ((0.0,), signal.SIGINT), ((2.0,), signal.SIGTERM)):
        with probe.running(parameters=more) as node:
            probe.wait_for(lambda: not any(display.shown for display in displays))  # what a killed node left
            probe.publish_map(np.zeros((41, 41)), resolution=0.5, origin=(-10.0, -10.0, 0.0))
            probe.wait_for(lambda places=places: show(*places))
            assert all(marker.frame_locked for display in displays for marker in display.shown.values())
            node.process.send_signal(ends)
            node.process.wait(30)
            if ends == signal.SIGKILL:
                assert all(display.shown for display in displays)
            else:
                probe.wait_for(lambda: not any(display.shown for display in displays))
    assert not any(display.doubled for display in displays), "RViz reports an id that comes twice in one array"


def test_nodes_that_share_a_topic_keep_each_others_patches(domain: int) -> None:
    """By their namespaces, also where one starts and ends beside another that publishes only changes."""
    with Probe("one") as one, Probe("two") as two:
        display = Display(one, by_namespace=False)

        def shown(*wanted: str) -> bool:
            for probe in (one, two):
                probe.publish_map(np.zeros((41, 41)), resolution=0.5, origin=(-10.0, -10.0, 0.0))
                publish(probe, (0.0,))
            return {namespace for namespace, _ in display.shown} == set(wanted)

        parameters = {"publish.incremental": True}
        remapped = ["--ros-args", "-r", "__ns:=/two", "-r", f"~/patches:={one.topic('patches')}", "--"]
        with one.running(parameters=parameters):
            one.wait_for(lambda: shown("one"))
            with Process("terrain_collider", parameters, remapped):
                one.wait_for(lambda: shown("one", "two"))
            one.wait_for(lambda: shown("one"))
