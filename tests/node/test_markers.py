"""What RViz keeps of ``~/patches`` and ``~/scene``, by namespace and id until a marker deletes it, across ends and
starts of a node."""

import os
import signal
import subprocess

import numpy as np

from smartmesh_ros.tools.testing import Probe, Process
from tests.node.displays import Display

INCREMENTAL = {"publish.incremental": True}


def publish(probe: Probe, places: tuple[float, ...]) -> None:
    probe.publish_bodies({f"b{x}": (x, 0.0, 0.2) for x in places}, radius=0.25)
    probe.spin()


def publish_ground(probe: Probe) -> None:
    probe.publish_map(np.zeros((41, 41)), resolution=0.5, origin=(-10.0, -10.0, 0.0))


def test_markers_go_with_their_node(probe: Probe) -> None:
    patches = [Display(probe, probe.topic("patches"), by_namespace=each) for each in (True, False)]
    displays = [*patches, Display(probe, probe.topic("scene"))]

    def empty() -> bool:
        return not any(display.shown for display in displays)

    def show(*places: float) -> bool:
        publish(probe, places)
        shown = [sorted(round(marker.points[0].x + 0.5) for marker in one.shown.values()) for one in patches]
        return shown == [list(places)] * 2 and bool(displays[-1].shown)

    for places, ends in (((0.0, 2.0, 4.0), signal.SIGKILL), ((2.0,), signal.SIGTERM)):
        with probe.running(parameters=INCREMENTAL) as node:
            probe.wait_for(empty)  # what a killed node left
            publish_ground(probe)
            probe.wait_for(lambda places=places: show(*places))
            assert all(marker.frame_locked for display in displays for marker in display.shown.values())
            node.process.send_signal(ends)
            node.process.wait(30)
            if ends == signal.SIGKILL:
                assert all(display.shown for display in displays)
            else:
                probe.wait_for(empty)


def test_a_display_that_is_held_up_is_emptied_too(probe: Probe) -> None:
    """The node ends while this process, which displays, is stopped for two seconds. (With a node that waits for half a
    second, the last message was lost in seven of twelve runs.)"""
    displays = [Display(probe, probe.topic(name)) for name in ("scene", "patches")]

    def show() -> bool:
        publish(probe, (0.0, 2.0))
        return all(display.shown for display in displays)

    with probe.running() as node:
        publish_ground(probe)
        probe.wait_for(show)
        test, collider = os.getpid(), node.process.pid
        subprocess.Popen(f"sleep 0.2; kill -STOP {test}; kill -TERM {collider}; sleep 2; kill -CONT {test}", shell=True)
        node.process.wait(30)
        probe.wait_for(lambda: not any(display.shown for display in displays))


def test_nodes_that_share_a_topic_keep_each_others_patches() -> None:
    """By their namespaces, also where one starts and ends beside another that publishes only changes."""
    with Probe("one") as one, Probe("two") as two:
        display = Display(one, one.topic("patches"))

        def shown(*wanted: str) -> bool:
            for probe in (one, two):
                publish_ground(probe)
                publish(probe, (0.0,))
            return {namespace for namespace, _ in display.shown} == set(wanted)

        remapped = ["--ros-args", "-r", "__ns:=/two", "-r", f"~/patches:={one.topic('patches')}", "--"]
        with one.running(parameters=INCREMENTAL):
            one.wait_for(lambda: shown("one"))
            with Process("terrain_collider", INCREMENTAL, remapped):
                one.wait_for(lambda: shown("one", "two"))
            one.wait_for(lambda: shown("one"))
