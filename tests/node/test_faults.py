"""Peers, disks and wires that fail. Clocks: test_clock.py, test_refusals.py, test_real_maps.py."""

import contextlib
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from smartmesh_msgs.msg import Heightmap
from smartmesh_msgs.srv import RemoveBody, SpawnBody

from smartmesh_ros.node.fleet import front
from smartmesh_ros.tools.demo import rover
from smartmesh_ros.tools.testing import COLLIDER, Probe, assert_on_map
from tests.node.shared import Logged, body_names, made_with

SHARED = {"terrain.motion": "hold"}
ROUGH = np.random.default_rng(1).normal(size=(40, 30)) * 0.1


def on_map(probe: Probe, message: Heightmap) -> Callable[[], bool]:
    """Whether there are patches, all of whose vertices are samples of the map."""

    def holds() -> bool:
        probe.publish_poses([(1.0, 1.0, 0.3)])
        patches = probe.patches()
        try:
            for points in patches.values():
                assert_on_map(points, message)
        except AssertionError:
            return False
        return bool(patches)

    return holds


def test_the_node_runs_where_no_log_can_be_written(probe: Probe, tmp_path: Path) -> None:
    """On a full disk. Where there can be no folder: test_processes.py."""
    with full_disk(tmp_path) as logs, probe.running(environment={"ROS_LOG_DIR": str(logs)}) as process:
        good = probe.publish_map(ROUGH)
        probe.wait_for(on_map(probe, good), watch=process)
        # A refusal is logged, which needs the disk.
        probe.publish_map(np.zeros((2, 2)))
        probe.wait_for(lambda: "refused, heightmap: geometry" in probe.diagnostics("inputs"))
        assert process.stop() == 0


@contextlib.contextmanager
def full_disk(tmp_path: Path) -> Iterator[Path]:
    folder = tmp_path / "small"
    folder.mkdir()
    if os.system(f"mount -t tmpfs -o size=4k tmpfs {folder} 2>/dev/null") != 0:
        pytest.skip("mounting a small file system is not permitted here")
    try:
        with contextlib.suppress(OSError):
            (folder / "ballast").write_bytes(bytes(8192))
        yield folder
    finally:
        os.system(f"umount {folder}")


def test_parameters_of_no_type_and_empty_lists_of_numbers_are_refused_and_the_node_lives(shared: Probe) -> None:
    """The first without an answer: rclpy fails."""
    client = shared.client("set_parameters", SetParameters)
    client.call_async(SetParameters.Request(parameters=[Parameter(name="physics.rate", value=ParameterValue(type=77))]))
    shared.wait_for(lambda: "refused, rclpy: malformed" in shared.diagnostics("inputs"))
    empty = Parameter(name="physics.gravity", value=ParameterValue(type=ParameterType.PARAMETER_DOUBLE_ARRAY))
    [result] = shared.call("set_parameters", SetParameters, parameters=[empty]).results
    assert not result.successful and "gravity is (); it must be three finite numbers" in result.reason
    shared.wait_for(on_map(shared, shared.publish_map(ROUGH)))


def test_the_rover_asks_again_for_what_a_collider_took_and_was_killed_with(
    probe: Probe, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(rover, "PATIENCE", 0.1)
    probe.listen("heightmap", Heightmap)
    served: list[str] = []

    def serve(request: Any, response: Any) -> Any:
        served.append(request.id)
        response.success = True
        return response

    with made_with(rover.Rover, {}) as node, contextlib.ExitStack() as ends:
        executor = SingleThreadedExecutor(context=node.context)
        ends.callback(executor.shutdown)
        executor.add_node(node)
        killed = Node("killed", context=probe.context)
        taken = killed.create_service(SpawnBody, f"{COLLIDER}/spawn_body", serve).handle
        probe.wait_for(lambda: executor.spin_once(0.0) or taken.service_take_request(SpawnBody.Request)[0])
        killed.destroy_node()
        probe.node.create_service(SpawnBody, f"{COLLIDER}/spawn_body", serve)
        probe.wait_for(lambda: executor.spin_once(0.0) or served)
        assert served[0] == rover.ROBOT


def test_the_rover_spawns_its_robot_again(probe: Probe, monkeypatch: pytest.MonkeyPatch, logged: Logged) -> None:
    """After it was removed, and in a collider that was started again."""
    monkeypatch.setattr(rover, "PATIENCE", 0.1)
    with made_with(rover.Rover, {}) as node, contextlib.ExitStack() as ends:
        executor = SingleThreadedExecutor(context=node.context)
        ends.callback(executor.shutdown)
        executor.add_node(node)

        def drives() -> bool:
            executor.spin_once(0.0)
            return rover.ROBOT in body_names(probe) and node._there

        with probe.running():
            probe.wait_for(drives)
            assert probe.call("remove_body", RemoveBody, id=rover.ROBOT).success
            probe.wait_for(lambda: not drives() and not node._there)
            probe.wait_for(drives)
        with probe.running():
            probe.wait_for(lambda: not drives() and not node._there)
            probe.wait_for(drives)
    assert logged().count("rover is gone; it is spawned again") == 2


def test_nodes_say_that_those_that_they_need_are_not_there(monkeypatch: pytest.MonkeyPatch, logged: Logged) -> None:
    for kind, act, words in (
        (rover.Rover, rover.Rover._start, "nobody subscribes to /terrain_collider/heightmap; start terrain_collider"),
        (front.Front, front.Front._report, "none of /fleet/node_0/terrain_collider, /fleet/node_1/terrain_collider is"),
    ):
        with made_with(kind, {}) as node:
            act(node)
            assert words not in logged()
            monkeypatch.setattr(f"{kind.__module__}.GRACE", -1.0)
            act(node)
            act(node)
            assert logged().count(words) == 1
