"""What RViz keeps of ``~/patches``, by namespace and id until a marker deletes it, across ends and starts of a node."""

import signal
from typing import Any

import numpy as np
import pytest

from smartmesh_ros.tools.testing import Probe, Process
from tests.node.displays import Display


def places_of(display: Display) -> list[int]:
    return sorted(round(marker.points[0].x + 0.5) for marker in display.shown.values())


def publish(probe: Probe, places: tuple[float, ...]) -> None:
    probe.publish_bodies({f"b{x}": (x, 0.0, 0.2) for x in places}, radius=0.25)
    probe.spin()


@pytest.mark.parametrize("more", [{}, {"publish.incremental": True}])
def test_patches_go_with_their_node(probe: Probe, more: dict[str, Any]) -> None:
    displays = [Display(probe, probe.topic("patches"), by_namespace=each) for each in (True, False)]

    def show(*places: float) -> bool:
        publish(probe, places)
        return all(places_of(display) == list(places) for display in displays)

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


def test_nodes_that_share_a_topic_keep_each_others_patches(domain: int) -> None:
    """By their namespaces, also where one starts and ends beside another that publishes only changes."""
    with Probe("one") as one, Probe("two") as two:
        display = Display(one, one.topic("patches"))

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
