"""The view beside a node that ends, or is killed, and is started again."""

from contextlib import nullcontext
from typing import Any

import numpy as np
import pytest
from rclpy.qos import DurabilityPolicy, QoSProfile
from smartmesh_msgs.msg import Heightmap, TrackedBodyArray

from smartmesh_ros.tools.testing import COLLIDER, Probe, Process, heightmap_message, mesh_message

pytest.importorskip("viser", reason="viser is not installed; scripts/workspace run dev view")

from smartmesh_ros.tools.client.remote import Remote
from smartmesh_ros.tools.view.knobs import KnobPanel


def test_the_page_shows_the_parameters_of_the_node_that_runs_now(probe: Probe, remote: Remote, server: Any) -> None:
    """Also where it was killed in the middle of an answer, and the page stayed open meanwhile."""
    panel = KnobPanel(server, remote, nullcontext())

    def rates() -> list[float]:
        remote.spin(0.05)
        panel.update()
        return [knob.value for knob in server.gui._gui_input_handle_from_uuid.values() if knob.label == "rate"]

    for rate in (100.0, 120.0):
        with Process("terrain_collider", {"physics.rate": rate}) as process:
            probe.wait_for(lambda rate=rate: rates() == [rate], watch=process)
            process.process.kill()


@pytest.mark.parametrize("killed", [False, True])
def test_the_ground_of_a_run_that_is_over_is_forgotten(probe: Probe, remote: Remote, *, killed: bool) -> None:
    """Unless it comes again, as a latched map does. A node that was killed is seen for a while beside the next."""
    maps, states = (f"{COLLIDER}/{topic}" for topic in ("heightmap", "body_states"))
    probe.node.destroy_publisher(probe.publishers.pop("heightmap"))
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    probe.node.create_publisher(Heightmap, maps, latched).publish(heightmap_message(np.zeros((4, 4))))
    run = probe.node.create_publisher(TrackedBodyArray, states, 10)
    remote.watch(set())

    def tiles() -> list[str]:
        remote.spin(0.05)
        remote.apply_waiting()
        return sorted(remote.ground.tiles)

    def given(tile: str) -> list[str]:
        probe.publishers["terrain_mesh"].publish(mesh_message(np.eye(3), [(0, 1, 2)], tile=tile))
        return tiles()

    probe.wait_for(lambda: given("before") == ["", "before"] and remote.runs)
    if not killed:
        probe.node.destroy_publisher(run)
        probe.wait_for(lambda: tiles() == [""])
    probe.node.create_publisher(TrackedBodyArray, states, 10)
    probe.wait_for(lambda: given("now") == ["", "now"])
    if killed:
        probe.node.destroy_publisher(run)
    probe.wait_for(lambda: tiles() == ["", "now"] and len(remote.runs) == 1)
