"""How a view follows its node: no message of a burst is lost, none waits for a slow page, and what the view shows is of
the run that is there, whether the one before ended or was killed."""

from argparse import Namespace
from contextlib import nullcontext, suppress
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.serialization import serialize_message
from shape_msgs.msg import Mesh
from smartmesh_msgs.msg import ColliderPatch, ColliderPatchArray, Heightmap, TrackedBodyArray

from smartmesh_ros.tools.client import remote as remote_module
from smartmesh_ros.tools.client.remote import Remote
from smartmesh_ros.tools.testing import COLLIDER, Probe, Process, heightmap_message, mesh_message

pytest.importorskip("viser", reason="viser is not installed; scripts/workspace run dev view")

from smartmesh_ros.tools.view import main, page
from smartmesh_ros.tools.view.knobs import KnobPanel


def tiles(remote: Remote) -> set[str]:
    """Tiles of the ground that a view shows, once it has heard what there is."""
    remote.spin(0.05)
    remote.apply_waiting()
    return set(remote.ground.tiles)


def test_tiles_that_are_published_in_a_burst_are_all_shown(remote: Remote, probe: Probe) -> None:
    maps = probe.publishers["heightmap"]
    remote.watch(set())
    probe.wait_for(lambda: [tiles(remote), maps.get_subscription_count()][1])
    names = {f"tile_{number}" for number in range(8)}
    for name in names:
        maps.publish(heightmap_message(np.zeros((5, 5)), tile=name))
    assert maps.wait_for_all_acked()
    probe.wait_for(lambda: tiles(remote) == names)


def test_after_a_large_map_no_others_are_received_for_a_while_unless_it_is_the_last_one_again(
    remote: Remote, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A latched map comes with each subscription: for ever, and each time it took back the regions that had changed."""
    monkeypatch.setattr(remote_module, "LARGE_MAP", 100)
    for stamp, pauses in (((1, 0), True), ((1, 0), False), ((1, 5), True), ((0, 0), True), ((0, 0), True)):
        before = remote._no_maps_until
        message = heightmap_message(np.zeros((9, 9)), stamp=Time(sec=stamp[0], nanosec=stamp[1]))
        remote._take("heightmap", serialize_message(message))
        assert (remote._no_maps_until > before) == pauses


def test_patches_are_those_of_the_newest_whole_message_and_of_all_changes_after(remote: Remote) -> None:
    rng = np.random.default_rng(0)
    known: dict[str, int] = {}
    a_point = Mesh(vertices=[Point()])
    for _ in range(30):
        for _ in range(int(rng.integers(5))):
            whole, names = rng.random() < 0.3, rng.choice([*"abcdef"], 2, replace=False).tolist()
            patches = [ColliderPatch(body_id=name, row=int(rng.integers(1000)), mesh=a_point) for name in names]
            gone = rng.choice([*"abcdef"], 1).tolist()
            message = ColliderPatchArray(incremental=not whole, removed=gone, patches=patches)
            remote._take("collider_patches", serialize_message(message))
            known = {name: row for name, row in known.items() if not whole and name not in gone}
            known |= {patch.body_id: patch.row for patch in patches}
        remote.apply_waiting()
        assert {name: patch.row for name, patch in remote.sight.patches.items()} == known


def test_messages_are_handled_however_long_a_page_takes(monkeypatch: pytest.MonkeyPatch) -> None:
    spent = {"page": 0.0, "messages": 0.0}
    left = iter([0.03] * 20)

    def spend(what: str, seconds: float) -> None:
        spent[what] += seconds

    made: Any = SimpleNamespace(url="", close=lambda: None, refresh=lambda: spend("page", next(left)))
    monkeypatch.setattr(page, "Page", lambda *_: made)
    monkeypatch.setattr(main, "monotonic", lambda: sum(spent.values()))
    remote: Any = SimpleNamespace(name="", missing="", close=lambda: None, spin=lambda time: spend("messages", time))
    options = Namespace(node="n", host="", port=0, rate=100.0, demo=False)
    with suppress(StopIteration):
        main.show(remote, options, SimpleNamespace(asked=False, starting=True))
    assert spent["messages"] > 0.8 * spent["page"] > 0.4


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

    def given(tile: str) -> set[str]:
        probe.publishers["terrain_mesh"].publish(mesh_message(np.eye(3), [(0, 1, 2)], tile=tile))
        return tiles(remote)

    probe.wait_for(lambda: given("before") == {"", "before"} and remote.runs)
    if not killed:
        probe.node.destroy_publisher(run)
        probe.wait_for(lambda: tiles(remote) == {""})
    probe.node.create_publisher(TrackedBodyArray, states, 10)
    probe.wait_for(lambda: given("now") == {"", "now"})
    if killed:
        probe.node.destroy_publisher(run)
    probe.wait_for(lambda: tiles(remote) == {"", "now"} and len(remote.runs) == 1)
