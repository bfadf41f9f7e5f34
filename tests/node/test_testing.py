"""`smartmesh_ros.tools.testing`: no process outlives its test, failures explain themselves, domains are free."""

import os
import re
import signal
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from geometry_msgs.msg import Point
from sensor_msgs.msg import JointState
from smartmesh_msgs.msg import TrackedBodyArray
from std_msgs.msg import String
from std_srvs.srv import SetBool, Trigger

from smartmesh_ros.errors import InputError
from smartmesh_ros.startup.dds import in_use, isolated, isolated_unless_chosen, require_domain
from smartmesh_ros.tools.client import PatchClient
from smartmesh_ros.tools.testing import TIMEOUT, Probe, Process, bags, heightmap_message
from smartmesh_ros.tools.testing.probe import DIAGNOSTICS
from smartmesh_ros.tools.testing.process import start_command
from tests.node.shared import LATCHED, UDP_ONLY, show_map, wait_until
from tests.preloaded import has_ended

STARTS_A_NODE = """
import sys
from smartmesh_ros.tools.testing import Process
process = Process("terrain_source")
print(process.process.pid, flush=True)
sys.stdin.readline()
"""
USES_THE_DOMAIN = """
import os
def test_the_environment_names_it(domain):
    assert os.environ["ROS_DOMAIN_ID"] == str(domain)
"""


def test_a_process_ends_with_an_exception_and_its_output_can_be_read_after_its_end(executables: None) -> None:
    words = "did you mean 'rate'?"
    with pytest.raises(ValueError, match="of the test"), Process("terrain_source", {"rat": 1.0}) as process:
        wait_until(lambda: words in process.output)
        raise ValueError("of the test")
    assert process.process.poll() is not None
    process.close()
    assert words in process.output


@pytest.mark.parametrize("package", ["smartmesh_ros", "no_such_package"])
def test_an_executable_that_is_not_installed_is_named(package: str) -> None:
    with pytest.raises(FileNotFoundError, match=f"package {package} has no executable none; build and source"):
        Process("none", package=package)


def test_a_process_ends_with_a_test_that_was_killed() -> None:
    command = [sys.executable, "-c", STARTS_A_NODE]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as test:
        pid = int(test.stdout.readline())  # type: ignore[union-attr]
        assert not has_ended(pid)
        test.send_signal(signal.SIGKILL)
    wait_until(lambda: has_ended(pid))


def shared_memory(process: int) -> set[str]:
    """Files of the shared memory that Fast DDS has mapped into a process."""
    return set(re.findall(r"/dev/shm/fastrtps_\w+", Path(f"/proc/{process}/maps").read_text()))


def test_a_node_gives_its_shared_memory_back_when_it_ends(probe: Probe) -> None:
    """Also a fork, which ends without freeing Python's objects. Otherwise peers send to it what is for the next one."""
    topic, others = "/terrain_sensor/points", shared_memory(os.getpid())
    with Process("terrain_sensor") as process:
        probe.wait_for(lambda: probe.node.count_publishers(topic), watch=process)
        own = {file for file in shared_memory(process.process.pid) - others if "port" not in file}
        assert own
        assert process.stop() == 0
    assert not [file for file in own if Path(file).exists()]


def test_a_process_outlives_the_thread_that_started_it(tmp_path: Path) -> None:
    """For Linux that thread is the parent, with which the process would be killed: of a pool, or of a test's own."""
    code = "import signal as s; s.pthread_sigmask(s.SIG_BLOCK, [2]); print('ready', flush=True); s.sigwait([2])"
    file = tmp_path / "log"

    def started() -> subprocess.Popen[bytes]:
        with file.open("wb") as log:
            child = start_command([sys.executable, "-c", code], log, {**os.environ})
        wait_until(lambda: b"ready" in file.read_bytes())
        return child

    with ThreadPoolExecutor() as pool:
        child = pool.submit(started).result()
    child.send_signal(signal.SIGINT)
    assert child.wait(TIMEOUT) == 0


def test_a_wait_in_vain_says_why(shared: Probe) -> None:
    shared.publish_map(np.zeros((3, 3)), resolution=-1.0)
    shared.wait_for(lambda: "1 refused" in shared.diagnostics("inputs")["message"])
    shared.wait_for(lambda: "terrain_collider" in shared.node.get_node_names())  # may arrive after its topics
    with pytest.raises(AssertionError) as failure:
        shared.wait_for(lambda: False, timeout=0.1)
    for words in (
        r"refused: heightmap: \w+ 1", "/shared/terrain_collider/heightmap: probe -> terrain_collider",
        "terrain_collider runs", "heightmap refused:",  # the node's own log
    ):  # fmt: skip
        assert re.search(words, str(failure.value))


def test_a_wait_for_a_misspelt_name_says_which_one_may_be_meant(shared: Probe, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shared, "wait_for", partial(shared.wait_for, timeout=0.5))
    with pytest.raises(
        AssertionError, match=r"there is no publisher of /shared/\S+/contac; did you mean 'contacts'\?; waited"
    ):
        shared.latest("contac")
    with pytest.raises(AssertionError, match=r"no std_srvs/srv/SetBool service \S+/puse; did you mean 'pause'\?"):
        shared.call("puse", SetBool, data=True)
    with pytest.raises(AssertionError, match=r"no subscription of \S+/joint_command; did you mean 'joint_commands'\?"):
        shared.publisher(JointState, "joint_command")
    with pytest.raises(AssertionError, match=r"description is subscribed as std_msgs/msg/String, RELIABLE and TRAN"):
        shared.publisher(String, "robot_description")  # give it such a qos


def test_the_last_message_of_a_latched_topic_is_the_first_that_comes(shared: Probe) -> None:
    shared.node.create_publisher(String, "/latched", LATCHED).publish(String(data="last"))
    assert shared.latest("/latched").data == "last"


def test_a_call_that_says_other_than_its_service_is_no_call(shared: Probe) -> None:
    """ROS leaves out a misspelt field, and makes nonsense of a wrong type or ends Python."""
    for fields, words in (({"dat": True}, "dat"), ({"data": "yes"}, "must be of type 'bool'")):
        with pytest.raises(AssertionError, match=words):
            shared.call("pause", SetBool, **fields)
    with pytest.raises(RuntimeError, match="incompatible type"):
        shared.call("pause", Trigger)


def test_probes_and_clients_end_after_a_signal_has_ended_ros_or_twice() -> None:
    """Ctrl-C ends all contexts of a program that has called ``rclpy.init``."""
    with Probe() as probe, PatchClient() as client:
        probe.context.shutdown()
        client.node.context.shutdown()
    with Probe() as probe, PatchClient() as client:
        probe.close()
        client.close()


def test_a_probe_listens_in_a_namespace_to_its_own_node(shared: Probe) -> None:
    """And the diagnostics of both have names of their own: an aggregator keeps the last status of each name."""
    with Probe("/robot_2/") as other, other.running():
        kept: dict[str, str] = {}

        def heard() -> bool:
            for message in shared.received[DIAGNOSTICS]:
                kept.update((status.name, status.hardware_id) for status in message.status)
            return set(kept.values()) >= {shared.collider, other.collider}

        shared.wait_for(heard)
        tasks = ("terrain", "bodies", "physics", "inputs", "connections")
        assert kept.keys() == {f"{name}/terrain_collider: {task}" for name in ("shared", "robot_2") for task in tasks}
        assert all(node == "/" + name.partition(":")[0] for name, node in kept.items())
        show_map(shared, np.zeros((50, 50)))
        assert other.diagnostics("terrain")["message"] == "no map yet"


def test_a_call_to_a_killed_node_fails_at_once_and_one_in_its_place_gets_its_first_map() -> None:
    with Probe() as probe, probe.running(environment=UDP_ONLY) as first:
        first.stop(signal.SIGKILL)
        with pytest.raises(AssertionError, match="the node ended with -9"):
            probe.call("pause", SetBool, data=True)
        with probe.running(environment=UDP_ONLY):
            probe.publish_map(np.zeros((3, 3)))
            probe.wait_for(lambda: probe.diagnostics("terrain")["samples"] == "9")


def test_whole_numbers_and_places_on_the_plane_are_taken(probe: Probe) -> None:
    """Without the check of fields ROS would make nonsense of a whole number."""
    info = heightmap_message(np.zeros((3, 3)), resolution=1, origin=(-1, 2)).info
    assert (info.resolution, info.origin.position) == (1.0, Point(x=-1.0, y=2.0))
    heard = probe.listen("tracked_bodies", TrackedBodyArray)
    probe.wait_for(lambda: probe.publish_bodies({"ball": (0, 0, 0)}, radius=1) or heard)
    assert heard[0].bodies[0].radius == 1.0


def test_a_parameter_that_no_file_can_hold_is_named(tmp_path: Path) -> None:
    for value in (tmp_path, np.float64(1.0)):
        with pytest.raises(InputError, match=r"csv is .*; it must be a number, a text, true"):
            Process("terrain_source", {"rate": 1.0, "csv": value})


def test_of_a_bag_that_cannot_be_written_nothing_is_left(tmp_path: Path) -> None:
    level = heightmap_message(np.zeros((3, 3)))
    for topic, time, message, storage, words in (
        ("/maps", 0.2, "text", "mcap", "it must be a message"),
        ("maps", 0.2, level, "mcap", "a name is 'maps'; it must be a full one"),
        ("/maps", -0.2, level, "sqlite3", "the time of /maps is -0.2; it must be zero or more"),
        ("/maps", 0.2, level, "db3", "the storage is 'db3'; it must be sqlite3 or mcap"),
    ):
        with pytest.raises(InputError, match=words):
            bags.write(tmp_path / "bag", [("/maps", 0.1, level), (topic, time, message)], storage)
        assert not (tmp_path / "bag").exists()


def test_a_topic_of_a_bag_that_nobody_subscribes_to_is_named(probe: Probe, tmp_path: Path) -> None:
    bags.write(tmp_path / "bag", [("/maps", 0.0, heightmap_message([[0.0] * 3] * 3))])
    with pytest.raises(AssertionError, match=r"nobody subscribes to /maps after 0.5 s; remap renames topics"):
        bags.play(str(tmp_path / "bag"), probe.node, probe.spin, timeout=0.5)


def test_a_bag_with_calls_is_not_played(probe: Probe, tmp_path: Path) -> None:
    bags.write(tmp_path / "bag", [("/terrain_collider/pause", 0.0, SetBool.Request(data=True))])
    with pytest.raises(InputError, match="has calls, on /terrain_collider/pause/_service_event: a replay makes them"):
        bags.play(tmp_path / "bag", probe.node, probe.spin, timeout=0.5)


def test_a_domain_that_somebody_is_in_is_left_alone() -> None:
    with isolated() as number:
        assert not in_use(number)
        source = Process("terrain_source")
        wait_until(lambda: in_use(number))
    with source, isolated() as other:
        assert other != number, "its lock is free, but a node is still there"


def test_folders_that_import_the_fixture_share_a_domain(tmp_path: Path) -> None:
    """Also a test of the first folder that comes after one of the second."""
    names = ("first/test_one.py", "second/test_two.py", "first/test_three.py")
    for file in (tmp_path / name for name in names):
        file.parent.mkdir(exist_ok=True)
        (file.parent / "conftest.py").write_text("from smartmesh_ros.tools.testing import domain")
        file.write_text(USES_THE_DOMAIN)
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *names]
    result = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=TIMEOUT, check=False)
    assert result.returncode == 0, result.stdout
    assert "3 passed" in result.stdout


def test_a_domain_is_the_chosen_one_written_as_rcl_reads_it_or_a_free_one(monkeypatch: pytest.MonkeyPatch) -> None:
    for text, chosen in (("007", 7), ("010", 8), ("0x1f", 31), ("08", None)):
        monkeypatch.setenv("ROS_DOMAIN_ID", text)
        with pytest.raises(SystemExit) if chosen is None else nullcontext():
            require_domain()
            with isolated_unless_chosen() as number:
                assert number == chosen
    monkeypatch.delenv("ROS_DOMAIN_ID")
    with isolated_unless_chosen() as number:
        assert os.environ["ROS_DOMAIN_ID"] == str(number) != "0"
    assert "ROS_DOMAIN_ID" not in os.environ
