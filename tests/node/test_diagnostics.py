"""Diagnostics of several nodes on one topic."""

from diagnostic_msgs.msg import DiagnosticStatus

from smartmesh_ros.tools.testing import Probe
from smartmesh_ros.tools.testing.probe import DIAGNOSTICS


def test_nodes_of_one_name_in_two_namespaces_have_diagnostics_of_their_own(domain: int) -> None:
    """An aggregator keeps the last status of each name."""
    with Probe("one") as one, one.running(), Probe("two") as two, two.running():
        kept: dict[str, DiagnosticStatus] = {}

        def heard() -> bool:
            two.spin()
            kept.update((status.name, status) for message in one.received[DIAGNOSTICS] for status in message.status)
            return {status.hardware_id for status in kept.values()} >= {one.collider, two.collider}

        one.wait_for(heard)
        tasks = ("terrain", "bodies", "physics", "inputs", "connections")
        assert kept.keys() == {f"{name}/terrain_collider: {task}" for name in ("one", "two") for task in tasks}
        assert all(status.hardware_id == "/" + name.partition(":")[0] for name, status in kept.items())
        assert one.diagnostics("terrain")["message"] == "no map yet"


def test_a_node_without_namespace_keeps_its_names(probe: Probe) -> None:
    with probe.running():
        assert probe.diagnostics("terrain")["message"] == "no map yet"
        names = {status.name for status in probe.received[DIAGNOSTICS][-1].status}
        assert names >= {"terrain_collider: terrain", "terrain_collider: connections"}
