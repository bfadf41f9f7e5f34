"""What peers may make the node open, hold and believe."""

from pathlib import Path
from time import sleep

import numpy as np
import pybullet_data
import pytest
from geometry_msgs.msg import PoseArray
from smartmesh_msgs.srv import RemoveBody, SpawnBody

from smartmesh_ros.tools.testing import TIMEOUT, Probe, Process, pose_message
from tests import urdfs
from tests.node.shared import BALL, spawn

SIZE = (0.3, 0.3, 0.2)
ROBOT = urdfs.robot(urdfs.link("a", urdfs.box(SIZE), 1.0, SIZE))


def test_services_open_no_file_outside_the_folders(probe: Probe, tmp_path: Path) -> None:
    allowed = tmp_path / "robots"
    allowed.mkdir()
    for folder in (allowed, tmp_path):
        (folder / "robot.urdf").write_text(ROBOT)
    (allowed / "link.urdf").symlink_to(tmp_path / "robot.urdf")
    reader = ROBOT.replace('<box size="0.3 0.3 0.2"/>', '<mesh filename="/etc/passwd"/>')
    with probe.running(parameters={"bodies.urdf_folders": [str(allowed)]}):
        for number, urdf in enumerate(
            (str(tmp_path / "robot.urdf"), str(allowed / "link.urdf"), str(allowed / "../robot.urdf"),
             f"{pybullet_data.getDataPath()}/r2d2.urdf", "/etc/passwd", "/no/such/file", reader)
        ):  # fmt: skip
            response = probe.call("spawn_body", SpawnBody, id=f"robot_{number}", urdf=urdf)
            assert not response.success, urdf
            assert "outside the allowed folders" in response.message
        spawn(probe, "good", urdf=str(allowed / "robot.urdf"))
        spawn(probe, "text", urdf=ROBOT)


def test_sizes_are_capped_by_parameters(probe: Probe) -> None:
    caps = {
        "bodies.most": 3, "bodies.longest_urdf": 1000,
        "terrain.max_samples": 2000, "terrain.max_tiles": 2,
    }  # fmt: skip
    with probe.running(parameters=caps):
        probe.publish_map(np.zeros((30, 30)))
        probe.wait_for(lambda: probe.diagnostics("terrain")["samples"] == "900")
        # More samples in all tiles together, or more tiles, than allowed.
        refused = "refused, heightmap: size"
        probe.publish_map(np.zeros((40, 30)), tile="large", origin=(50.0, 0.0, 0.0))
        probe.wait_for(lambda: probe.diagnostics("inputs").get(refused) == "1")
        probe.publish_map(np.zeros((10, 10)), tile="b", origin=(50.0, 0.0, 0.0))
        probe.wait_for(lambda: probe.diagnostics("terrain")["tiles"] == "2")
        probe.publish_map(np.zeros((10, 10)), tile="c", origin=(99.0, 0.0, 0.0))
        probe.wait_for(lambda: probe.diagnostics("inputs").get(refused) == "2")
        probe.publish_map(np.zeros((10, 10)), tile="x" * 257, origin=(99.0, 0.0, 0.0))
        probe.wait_for(lambda: probe.diagnostics("inputs").get(refused) == "3")
        # Names and descriptions.
        spawn = {"shape": BALL, "mass": 1.0, "pose": pose_message((1, 1, 1))}
        assert "at most 256" in probe.call("spawn_body", SpawnBody, id="x" * 257, **spawn).message
        long = ROBOT.replace("<link", " " * 1000 + "<link", 1)
        assert "bytes" in probe.call("spawn_body", SpawnBody, id="long", urdf=long).message
        # Bodies, by service and by topic.
        for name in "abc":
            assert probe.call("spawn_body", SpawnBody, id=name, **spawn).success
        assert "bodies.most" in probe.call("spawn_body", SpawnBody, id="d", **spawn).message
        probe.publish_poses([(1.0, 1.0, 0.3)])
        probe.wait_for(lambda: probe.diagnostics("inputs").get("refused, body_poses: size") == "1")
        probe.publishers["body_poses"].publish(PoseArray(poses=[pose_message((0, 0, 0))] * 4))
        probe.wait_for(lambda: probe.diagnostics("inputs").get("refused, body_poses: size") == "2")
        assert probe.call("remove_body", RemoveBody, id="a").success
        assert probe.call("spawn_body", SpawnBody, id="d", **spawn).success


@pytest.mark.parametrize("strategy", ["Enforce", "Permissive"])
def test_security_that_is_not_to_be_had_stops_the_start(domain: int, tmp_path: Path, strategy: str) -> None:
    """No node runs in the clear where security was asked for. The wheels' Fast DDS is built without it."""
    (tmp_path / "enclaves").mkdir()
    asked = {"ENABLE": "true", "STRATEGY": strategy, "KEYSTORE": str(tmp_path)}
    environment = {f"ROS_SECURITY_{name}": value for name, value in asked.items()}
    with Process("terrain_collider", environment=environment) as process:
        if strategy == "Permissive" and not _ends(process):
            pytest.skip("this middleware has DDS security, and permits what has no keys")
        assert process.process.wait(TIMEOUT) == 2
        assert "ROS_SECURITY_ENABLE" in process.output
        assert "Traceback" not in process.output


def _ends(process: Process) -> bool:
    """Waits until the node ends, or says that it has started."""
    while process.process.poll() is None and "terrain from" not in process.output:
        sleep(0.1)
    return process.process.poll() is not None
