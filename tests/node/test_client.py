"""The client for other simulators, over DDS: patches by name, moved on with the ground, with their age and bound."""

import math
import signal
from collections.abc import Iterator

import numpy as np
import pytest
from smartmesh_msgs.msg import ColliderPatchArray
from visualization_msgs.msg import MarkerArray

from smartmesh_ros.tools.client import Patch, PatchClient, TrackedLink
from smartmesh_ros.tools.testing import COLLIDER, Probe
from tests.node.shared import changed

SHARED = {"publish.patches": 60.0}
RESOLUTION = 0.1
LEFT = TrackedLink(name="left", position=(1.0, 1.0, 0.2), radius=0.2)
RIGHT = TrackedLink(name="right", position=(4.0, 4.0, 0.2), radius=0.2)


@pytest.fixture
def client(shared: Probe) -> Iterator[PatchClient]:
    with PatchClient(shared.collider) as made:
        yield made


def test_rising_ground_is_where_the_client_moves_its_patch_to(shared: Probe, client: PatchClient) -> None:
    rise, tilt = 0.4, 0.1  # [m/s], and [m/s] more for each metre along x
    x = np.tile(np.arange(50) * RESOLUTION, (50, 1))
    start = client.now()

    def ground(xy: np.ndarray, time: float) -> np.ndarray:
        return (rise + tilt * xy[:, 0]) * (time - start)

    def off(patch: Patch, later: float) -> float:
        """The largest distance of the patch from the plane, moved on in time [m]."""
        moved = client.patch("left", patch.stamp + later).vertices_w
        return float(np.abs(moved[:, 2] - ground(moved, patch.stamp + later)).max())

    def shown() -> Patch | None:
        stamp = shared.node.get_clock().now()
        heights = (rise + tilt * x) * (stamp.nanoseconds * 1e-9 - start)
        shared.publish_map(heights, resolution=RESOLUTION, stamp=stamp.to_msg())
        client.track([LEFT])
        client.spin_once(0.02)
        found = client.patch("left")
        if found is None or abs(found.linear_w[2] - rise - tilt) > 0.01:
            return None
        return found if off(found, 0.0) < 0.008 else None  # a late node places maps late

    patch = shared.wait_for(shown)
    assert patch.kind == "heightfield"
    assert patch.shape is not None
    assert math.prod(patch.shape) == len(patch.vertices_w)
    assert patch.triangles.max() < len(patch.vertices_w)
    assert patch.stride == 1
    assert patch.deviation == 0.0
    assert patch.angular_w[1] == pytest.approx(-tilt, abs=0.01)
    # Wherever it is moved to in time, it lies on the plane that rises and tilts; the control, not moved, does not.
    for later in (0.0, 0.05, 0.2):
        moved = client.patch("left", patch.stamp + later)
        assert off(patch, later) < 0.008
        assert moved.age == pytest.approx(later, abs=1e-6)
    still = client.patch("left", patch.stamp)
    assert np.abs(still.vertices_w[:, 2] - ground(still.vertices_w, patch.stamp + 0.2)).min() > 0.08
    # Not without end.
    at_most = client.patch("left", patch.stamp + client.ahead).vertices_w
    np.testing.assert_allclose(client.patch("left", patch.stamp + 100.0).vertices_w, at_most)


@pytest.mark.parametrize("incremental", [False, True])
def test_bodies_come_stay_and_go(shared: Probe, client: PatchClient, *, incremental: bool) -> None:
    heights = np.random.default_rng(1).normal(0.0, 0.05, (50, 50))
    links = [LEFT, RIGHT]
    more = {"publish.incremental": incremental, "terrain.motion": "hold", "bodies.timeout": 1.0}
    with changed(shared, more):
        shared.publish_map(heights, resolution=RESOLUTION)

        def shown(*names: str) -> bool:
            client.track(links)
            client.spin_once(0.02)
            return client.patches().keys() == set(names)

        shared.wait_for(lambda: shown("left", "right"))
        assert client.frame_id == "map"

        def quiet() -> bool:  # nothing moves, so nothing is said
            said = shared.latest("collider_patches").patches or shared.latest("patches").markers
            return shown("left", "right") and not (incremental and said)

        shared.wait_for(quiet)
        # Whoever joins late is told everything at once, not only when it is everybody's turn.
        with Probe() as late:
            patches = late.listen(shared.topic("collider_patches"), ColliderPatchArray)
            markers = late.listen(shared.topic("patches"), MarkerArray)
            shared.wait_for(lambda: shown("left", "right") and not late.spin() and min(len(patches), len(markers)) > 5)
            assert {patch.body_id for message in patches[:5] for patch in message.patches} == {"left", "right"}
            assert len({marker.id for message in markers[:5] for marker in message.markers}) >= 2
        before = client.patches()
        heights[30:, 30:] += 0.5
        shared.publish_map(heights, resolution=RESOLUTION)

        def raised() -> bool:
            return shown("left", "right") and client.patches()["right"].vertices_w[:, 2].min() > 0.2

        shared.wait_for(raised)
        after = client.patches(client.patches()["right"].stamp)  # not moved on: to "hold", the jump was a speed
        np.testing.assert_array_equal(after["left"].vertices_w, before["left"].vertices_w)
        cells = np.rint(after["right"].vertices_w[:, :2] / RESOLUTION).astype(int)
        expected = heights[cells[:, 1], cells[:, 0]]
        np.testing.assert_allclose(after["right"].vertices_w[:, 2], expected, atol=1e-6)
        assert after["left"].stamp > before["left"].stamp  # it was said to hold still
        del links[0]
        shared.wait_for(lambda: shown("right"))
        assert client.patch("left") is None
        assert client.refused == 0


def test_patches_of_a_node_that_stands_still_grow_old(udp_only: None, probe: Probe) -> None:
    """First of a node that is stalled and goes on, then of one that was killed."""
    with PatchClient(COLLIDER) as client:
        assert client.age() == math.inf
        assert client.patches() == {}
        with probe.running(parameters={**SHARED, "bodies.timeout": 1000.0}) as node:
            probe.publish_map(np.zeros((50, 50)), resolution=RESOLUTION)

            def shown() -> bool:
                client.track([LEFT])
                client.spin_once(0.02)
                return "left" in client.patches() and client.age() < 1.0

            def old() -> bool:
                client.spin_once()
                return client.age() > 1.0

            for end, go_on in ((signal.SIGSTOP, signal.SIGCONT), (signal.SIGKILL, None)):
                probe.wait_for(shown)
                node.process.send_signal(end)
                try:
                    probe.wait_for(old)
                    patch = client.patches()["left"]
                    assert patch.age > 1.0
                    assert patch.moved == client.ahead
                finally:
                    if go_on is not None:
                        node.process.send_signal(go_on)


def test_a_client_on_the_callers_node_is_spun_by_the_callers_executor(shared: Probe) -> None:
    with PatchClient(shared.collider, node=shared.node) as client:
        shared.publish_map(np.zeros((50, 50)), resolution=RESOLUTION)

        def shown() -> bool:
            client.track([LEFT, RIGHT])
            return client.patches().keys() == {"left", "right"}

        shared.wait_for(shown)
        with pytest.raises(RuntimeError, match="caller's executor"):
            client.spin_once()


def test_bytes_that_are_no_message_are_counted_and_change_nothing(client: PatchClient) -> None:
    client._on_bytes(b"\x00\x01\x00\x00\x07")
    assert (client.received, client.refused) == (0, 1)
    assert client.patches() == {}
