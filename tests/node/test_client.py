"""The client for other simulators: patches by name, moved on with the ground, with their age and bound."""

import math
from collections.abc import Iterator
from dataclasses import replace
from operator import itemgetter
from typing import Any

import numpy as np
import pytest
from rclpy.serialization import serialize_message
from rosgraph_msgs.msg import Clock
from smartmesh_msgs.msg import ColliderPatch, ColliderPatchArray, TrackedBody, TrackedBodyArray
from visualization_msgs.msg import MarkerArray

from smartmesh_ros import BodyState
from smartmesh_ros.errors import InputError
from smartmesh_ros.node.timing.pacing import stamp_of
from smartmesh_ros.tools.client import PatchClient, TrackedLink
from smartmesh_ros.tools.replay.replay import Replay
from smartmesh_ros.tools.testing import COLLIDER, Probe, heightmap_message, mesh_message, pose_message
from tests.node.shared import changed, seconds

SHARED = {"publish.patches": 60.0, "publish.incremental": True, "terrain.motion": "hold", "bodies.timeout": 1.0}
RESOLUTION = 0.1
LEFT = TrackedLink(name="left", position=(1.0, 1.0, 0.2), radius=0.2)
RIGHT = TrackedLink(name="right", position=(4.0, 4.0, 0.2), radius=0.2)


@pytest.fixture
def client() -> Iterator[PatchClient]:
    """Of the shared node."""
    with PatchClient(f"/shared{COLLIDER}") as made:
        yield made


def test_a_patch_is_moved_on_with_its_ground_and_grows_old(client: PatchClient) -> None:
    rise, tilt = 0.4, 0.1  # [m/s], and [m/s] more for each metre along x
    x = np.tile(np.arange(50) * RESOLUTION, (50, 1))
    assert (client.age(), client.patches()) == (math.inf, {})
    client._on_bytes(b"\x00\x01\x00\x00\x07")
    client._on_bytes(serialize_message(ColliderPatchArray(patches=[ColliderPatch(body_id="left")])))
    assert (client.received, client.refused) == (1, 1), "bytes that are no message change nothing"
    assert not len(client.patch("left").vertices_w)
    body = TrackedBody(id="left", pose=pose_message((1.0, 1.0, 0.5)), radius=0.5)
    given: list[Any] = [("tracked_bodies", time, TrackedBodyArray(bodies=[body])) for time in np.arange(0.0, 1.0, 0.05)]
    given += [("heightmap", t, heightmap_message((rise + tilt * x) * t, resolution=RESOLUTION)) for _, t, _ in given]
    with Replay(sorted(given, key=itemgetter(1)), keep=["collider_patches"]) as run:
        run.run()
        client._on_bytes(serialize_message(run.received("collider_patches")[-1]))
    stamp = client.patch("left").stamp

    patch = client.patch("left", stamp)
    assert (patch.kind, patch.stride, patch.deviation) == ("heightfield", 1, 0.0)
    assert math.prod(patch.shape) == len(patch.vertices_w) > patch.triangles.max()
    assert patch.angular_w[1] == pytest.approx(-tilt, abs=0.01)
    # Wherever it is moved to in time, it lies on the plane that rises and tilts; the control, not moved, does not.
    for later in (0.0, 0.05, 0.2):
        moved = client.patch("left", stamp + later)
        x, _, z = moved.vertices_w.T
        assert np.abs(z - (rise + tilt * x) * (stamp + later)).max() < 0.008
        assert moved.age == pytest.approx(later, abs=1e-6)
    x, _, z = patch.vertices_w.T
    assert np.abs(z - (rise + tilt * x) * (stamp + 0.2)).min() > 0.08
    # Not without end: a node that stands still, or has ended.
    at_most, old = client.patch("left", stamp + client.ahead), client.patch("left", stamp + 100.0)
    np.testing.assert_allclose(old.vertices_w, at_most.vertices_w)
    assert client.age(stamp + 100.0) == pytest.approx(old.age) == pytest.approx(100.0)


def test_bodies_come_stay_and_go(shared: Probe, client: PatchClient) -> None:
    heights = np.random.default_rng(1).normal(0.0, 0.05, (50, 50))
    links = [LEFT, RIGHT]
    shared.publish_map(heights, resolution=RESOLUTION)

    def shown(*names: str) -> bool:
        client.track(links)
        client.spin_once(0.02)
        return client.patches().keys() == set(names)

    shared.wait_for(lambda: shown("left", "right"))
    assert client.frame_id == "map"

    def quiet() -> bool:  # nothing moves, so nothing is said
        said = shared.latest("collider_patches").patches or shared.latest("patches").markers
        return shown("left", "right") and not said

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


def test_a_wait_for_patches_of_a_node_that_is_not_there_says_so() -> None:
    words = r"no patch of \['wheel'\] after 0.1 s; nobody publishes /nobody/collider_patches; running nodes: "
    with PatchClient("/nobody") as client, pytest.raises(TimeoutError, match=words):
        client.wait_for(["wheel"], timeout=0.1)


def test_patches_are_where_the_ground_is_at_their_stamp() -> None:
    """It rises at 1 m/s."""
    events: list[Any] = []
    for k in range(60):
        message = heightmap_message(np.full((20, 20), k / 20), velocities=np.ones((20, 20)))
        message.header.stamp = stamp_of(1000.0 + k / 20)
        events += [("/clock", k / 20, Clock(clock=message.header.stamp)), ("heightmap", k / 20, message)]
    with Replay(events, {"use_sim_time": True}, keep=["collider_patches"]) as run:
        run.world.track("wheel", 0.2, BodyState((1.0, 1.0, 1.0)))
        run.run()
        found = [(seconds(one.header.stamp), one.patches) for one in run.received("collider_patches")[5:]]
        assert len(found) > 50
        for stamp, [patch] in found:
            assert patch.mesh.vertices[0].z == pytest.approx(stamp - 1000.0, abs=1e-5)


def test_changes_that_come_while_a_simulator_is_busy_are_kept(shared: Probe) -> None:
    """For half a second and more at 120 Hz, and each says what no other one does."""
    mesh = mesh_message(np.eye(3), [[0, 1, 2]]).mesh
    with PatchClient("/busy") as client:
        patches = shared.node.create_publisher(ColliderPatchArray, "/busy/collider_patches", 100)
        shared.wait_for(patches.get_subscription_count)
        for number in range(80):
            patch = ColliderPatch(body_id=f"wheel_{number}", mesh=mesh)
            patches.publish(ColliderPatchArray(incremental=number > 0, patches=[patch]))
        assert patches.wait_for_all_acked()
        assert any(client.spin_once(1.0) and len(client.patches()) == 80 for _ in range(10)), "each handles all of them"


def test_a_link_that_no_body_can_be_called_is_refused(client: PatchClient) -> None:
    for name in ("rover/wheel", "", 3):  # of the last ROS would make no message, and end Python
        with pytest.raises(InputError, match="cannot name a body"):
            client.track([replace(LEFT, name=name)])


def test_a_client_on_the_callers_node_is_spun_by_the_callers_executor(shared: Probe) -> None:
    with PatchClient(shared.collider, node=shared.node) as client, changed(shared, {"publish.incremental": False}):
        shared.publish_map(np.zeros((50, 50)), resolution=RESOLUTION)

        def shown() -> bool:
            client.track([LEFT, RIGHT])
            return client.patches().keys() == {"left", "right"}

        shared.wait_for(shown)
        with pytest.raises(RuntimeError, match="caller's executor"):
            client.spin_once()
