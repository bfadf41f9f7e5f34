"""The command ``replay``: its file, its digest, its end, and what it refuses. A run of the node over DDS, recorded."""

import os
import signal
import subprocess
import sys
from pathlib import Path
from time import time
from typing import Any

import numpy as np
import pytest
import yaml
from geometry_msgs.msg import Twist
from mcap.reader import make_reader
from rclpy.serialization import deserialize_message
from rosbags.interfaces import QosDurability
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosgraph_msgs.msg import Clock
from smartmesh_msgs.msg import Heightmap, TrackedBodyArray
from smartmesh_msgs.srv import RemoveBody, SpawnBody

from smartmesh_ros.errors import InputError
from smartmesh_ros.node.inputs.optional_messages import class_of
from smartmesh_ros.tools.replay import cli
from smartmesh_ros.tools.replay.cli import main
from smartmesh_ros.tools.replay.replay import Replay
from smartmesh_ros.tools.testing import TIMEOUT, Probe, Process, bags, executable, heightmap_message
from tests.node.shared import position_of, spawn, wait_until
from tests.tools.replay.recordings import RECORDINGS, in_order

ARGUMENTS = [f"-p{name}:={value}" for name, value in RECORDINGS["robot"][0].items()]
MAP, REMOVE = "/terrain_collider/heightmap", "/terrain_collider/remove_body"
CONTENTS = f"{MAP}  smartmesh_msgs/msg/Heightmap  10 messages"


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> str:
    path = tmp_path_factory.mktemp("recorded") / "bag"
    bags.write(path, in_order("robot"))
    return str(path)


def words_of(capsys: pytest.CaptureFixture[str], *arguments: Any) -> str:
    assert main([*map(str, arguments)]) == 2
    said = capsys.readouterr().err
    assert "Traceback" not in said
    return said


def test_the_file_is_a_recording_and_the_same_each_time(bag: str, tmp_path: Path) -> None:
    files = [tmp_path / name / "out.mcap" for name in ("first", "second")]
    for seed, file in enumerate(files):
        file.parent.mkdir()
        command = [str(executable("replay")), bag, *ARGUMENTS, "-o", str(file), "--until", "0.6"]
        environment = os.environ | {"PYTHONHASHSEED": str(seed)}
        found = subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
        assert found.returncode == 0, found.stderr
    first, second = (file.read_bytes() for file in files)
    assert first == second
    digest = found.stdout.splitlines()[-1].removeprefix("digest: ")
    assert len(digest) == 64
    with files[0].open("rb") as stream:
        reader = make_reader(stream)
        [about] = (record.metadata["serialized_metadata"] for record in reader.iter_metadata())
        assert yaml.safe_load(about)["custom_data"] == {"smartmesh_ros_digest": digest}
        schemas = {channel.topic: schema for schema, channel, _ in reader.iter_messages()}
    types = get_typestore(Stores.EMPTY)
    with Reader(files[0]) as opened:
        counts = {one.topic: one.msgcount for one in opened.connections}
        latched = {one.topic: one.ext.offered_qos_profiles[0].durability for one in opened.connections}  # type: ignore[union-attr]
        times = []
        for connection, time, data in opened.messages():
            times.append(time)
            assert deserialize_message(bytes(data), class_of(connection.msgtype)) is not None
    assert times == sorted(times)
    assert counts["/terrain_collider/body_states"] == pytest.approx(0.6 * 60, abs=1)
    assert counts["/terrain_collider/body_descriptions"] >= 1 and "/diagnostics" in counts
    for topic in ("body_descriptions", "robot_model"):
        assert latched.pop(f"/terrain_collider/{topic}") == QosDurability.TRANSIENT_LOCAL
    assert set(latched.values()) == {QosDurability.VOLATILE}
    for schema in schemas.values():  # definitions are whole: every type that is named is there
        types.register(get_types_from_msg(schema.data.decode(), schema.name))
        assert types.generate_msgdef(schema.name, ros_version=2)


def test_the_digest_is_checked(bag: str, capsys: pytest.CaptureFixture[str]) -> None:
    said = [bag, *ARGUMENTS, "--until", "0.2", "--check"]
    assert main([*said, "0" * 64]) == 1
    digest = capsys.readouterr().out.splitlines()[-1].removeprefix("digest: ")
    assert main([*said, digest.upper()]) == 0


def test_a_topic_that_may_be_meant_for_the_node_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """In a bag of one instant, which is replayed like any other."""
    level, states = heightmap_message([[0.0] * 3] * 3), TrackedBodyArray()
    messages = [(MAP, 0.0, level), ("/maps", 0.0, level), ("/terrain_collider/body_states", 0.0, states)]
    driven = "/terrain_collider/cmd_vel/rover", 0.0, Twist()
    bags.write(tmp_path / "bag", [*messages, ("/clock", 0.0, Clock()), driven, (REMOVE, 0.0, RemoveBody.Request())])
    name = "left out: /maps (smartmesh_msgs/msg/Heightmap); -r '~/INPUT:=/maps' would make it an input"
    other = "the node had other parameters or remappings when it was recorded"
    lines = [name, f"left out: /terrain_collider/cmd_vel/rover (geometry_msgs/msg/Twist); {other}"]
    for base, expected in (([], lines), (["-p", "bases:=['{body: rover, wheels: [left, right]}']"], [name])):
        assert main([str(tmp_path / "bag"), *base]) == 0
        assert [said for said in capsys.readouterr().out.splitlines() if said.startswith("left out")] == expected
    assert main([str(tmp_path / "bag"), "-r", "~/heightmap:=/maps"]) == 0
    assert f"left out: {MAP} " in capsys.readouterr().out


def test_only_some_outputs(bag: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out.mcap"
    assert main([bag, *ARGUMENTS, "-o", str(out), "--topics", "body_states", "/terrain_collider/contacts"]) == 0
    with Reader(out) as opened:
        assert {one.topic for one in opened.connections} == {
            "/terrain_collider/body_states",
            "/terrain_collider/contacts",
        }
    said = words_of(capsys, bag, "-o", tmp_path / "no.mcap", "--topics", "bodystates")
    assert "no output /terrain_collider/bodystates; the outputs are /diagnostics, /terrain_collider/body_desc" in said
    assert not (tmp_path / "no.mcap").exists()


def test_an_interrupted_run_leaves_a_whole_file(bag: str, tmp_path: Path) -> None:
    out = tmp_path / "out.mcap"
    with Process("replay", arguments=[bag, *ARGUMENTS, "-o", str(out), "--until", "1000000"]) as run:
        wait_until(lambda: any(file.stat().st_size > 500_000 for file in tmp_path.rglob("*.mcap")))
        run.process.send_signal(signal.SIGINT)
        assert run.process.wait(TIMEOUT) == 130 and [*tmp_path.iterdir()] == [out]
        assert "until interrupted" in run.output and run.output.splitlines()[-1].startswith("digest: ")
    with Reader(out) as opened:
        assert sum(1 for _ in opened.messages()) == opened.message_count > 10


def test_a_full_disk_ends_the_run_at_once_and_the_file_of_an_earlier_run_stays(bag: str, tmp_path: Path) -> None:
    out = tmp_path / "out.mcap"
    out.write_bytes(b"earlier")
    command = ["sh", "-c", 'ulimit -f 10; exec "$0" "$@"', str(executable("replay")), bag, *ARGUMENTS, "-o", str(out)]
    command += ["--until", "1000000"]
    found = subprocess.run(command, capture_output=True, text=True, check=False, timeout=TIMEOUT)
    assert found.returncode == 2 and "Traceback" not in found.stderr and "refused" not in found.stderr
    assert found.stderr.endswith(f"replay: {out} cannot be written: File too large\n")
    assert out.read_bytes() == b"earlier" and [*tmp_path.iterdir()] == [out]


def test_a_signal_before_the_first_step_ends_the_run_as_one_in_it(bag: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: Any, **__: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(cli, "Replay", interrupted)
    assert main([bag]) == 130


def test_a_parameter_file_is_that_of_the_node(bag: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """As are its arguments after --ros-args; a file for another node is refused."""
    file = tmp_path / "parameters.yaml"
    spawn = "bodies: {spawn: ['{id: b, shape: sphere, size: [0.2], xy: [0, 0]}']}"
    file.write_text(
        f"ns: {{other: {{ros__parameters: {{{spawn}, physics.rate: 100.0}}}}}}\nthird: {{ros__parameters: {{x: 1}}}}"
    )
    given = ["--ros-args", "--params-file", str(file), "-r", "__node:=other", "-r", "__ns:=/ns"]
    remaps = ["-r", f"~/heightmap:={MAP}", "-r", "~/joint_commands:=/nothing", "-r", "~/contacts:=touches"]
    assert main([bag, *given, *remaps, "-o", str(tmp_path / "out.mcap")]) == 0
    said = capsys.readouterr().out
    assert "/ns/other/body_states" in said and "/ns/touches" in said
    assert "it is for /ns/other, /third, and this node is /terrain_collider" in words_of(
        capsys, bag, "--params-file", file
    )


def written(path: Path, storage: Any = "mcap") -> Path:
    bags.write(path, [(MAP, 1.0 + 0.1 * k, heightmap_message([[0.0] * 3] * 3)) for k in range(10)], storage)
    return path


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_a_bag_that_is_cut_off(tmp_path: Path, capsys: pytest.CaptureFixture[str], storage: str) -> None:
    [file] = [path for path in written(tmp_path / "bag", storage).iterdir() if path.suffix in (".mcap", ".db3")]
    data = file.read_bytes()
    file.write_bytes(data[: len(data) // 2])
    for path in (tmp_path / "bag", file):
        said = words_of(capsys, path)
        assert f"{path} is no bag, or it is cut off or damaged (" in said
        assert "ros2 bag reindex or the mcap tool's recover may save what is left" in said


def test_no_bag_at_all(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "notes.txt").write_text("")
    assert "it has no metadata.yaml (there is: notes.txt)" in words_of(capsys, tmp_path)
    assert "there is no bag nowhere" in words_of(capsys, "nowhere")
    assert "notes.txt is no bag" in words_of(capsys, tmp_path / "notes.txt")
    single = next(written(tmp_path / "bag").glob("*.mcap"))
    for bag in (single, single.parent):
        assert "is the bag itself, or one of its files" in words_of(capsys, bag, "-o", single)
    assert "is a folder; name a file" in words_of(capsys, single, "-o", tmp_path)
    os.mkfifo(tmp_path / "pipe")  # as a device it would be replaced by the file
    assert "is no file; name a file" in words_of(capsys, single, "-o", tmp_path / "pipe")
    assert main([str(single), "-o", str(tmp_path / "out.mcap")]) == 0


def test_a_bag_is_written_into_a_new_folder_and_played_at_a_rate_above_zero(bag: str) -> None:
    with pytest.raises(InputError, match=f"{bag} is there, and a bag is a new folder; name another one"):
        written(Path(bag))
    for rate in (0.0, -1.0, float("nan")):
        with pytest.raises(InputError, match=f"the rate is {rate}; it must be a number above zero"):
            bags.play(bag, None, lambda _: None, rate=rate)  # type: ignore[arg-type]


def test_a_package_that_is_missing_is_named(bag: str, capsys: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """And does not count as damage of the bag."""
    for name in [name for name in sys.modules if name.partition(".")[0] == "rosbags"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setattr(sys, "path", [])
    assert words_of(capsys, bag) == "replay needs rosbags: pip install rosbags\n"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["-r", f"{MAP}:=/maps"], "nothing here is for /terrain_collider, whose inputs are\n  /maps  smartmesh_msgs"),
        (["-r", "heights"], "-r 'heights' must be from:=to"),
        (["-r", f"{Path.home()}/heightmap:=/maps"], "put the remapping into quotes: '~/heightmap:=/maps'"),
        (["-r", "a b:=c"], "-r: topic name 'a b' is invalid: topic name must not contain characters other than"),
        (["-r", "__ns:=robot"], "-r: Invalid namespace: namespace must be absolute, it must lead with a '/': 'robot'"),
        (["-r", "__node:=my node"], "-r: Invalid node name: node name must not contain characters other than"),
        (["-p", "physics.rate=100"], "-p 'physics.rate=100' must be name:=value"),
        (["-p", "physics.rat:=100"], "did you mean 'physics.rate'?"),
        (["-p", "physics.rate:=fast"], "physics.rate is 'fast'"),
        (["-p", "physics.rate:=2024-13-01"], "physics.rate is '2024-13-01'"),
        (["-p", "physics.rate:=!!bool x"], "physics.rate is '!!bool x'"),
        (["--params-file", "missing.yaml"], "missing.yaml is no parameter file"),
        (["--until", "-1"], "--until is -1"),
        (["--topics", "a b"], "topic name '~/a b' is invalid: topic name must not contain characters other than"),
        (["--topics", ""], "topic name '~/' is invalid"),
        (["-o", "/nowhere/out.mcap"], "/nowhere/out.mcap cannot be written: No such file or directory"),
    ],
)
def test_what_cannot_be(tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], words: str) -> None:
    said = words_of(capsys, written(tmp_path / "bag"), *arguments)
    assert words in said
    assert CONTENTS in said or "inputs" not in words


PARAMETERS = {"service_introspection": "contents"}
RECORDED = {
    "heightmap": Heightmap, "body_states": TrackedBodyArray, "spawn_body/_service_event": SpawnBody.Event,
}  # fmt: skip


def test_a_recorded_run_is_replayed(probe: Probe, tmp_path: Path) -> None:
    """A ball comes to rest where it did. That the node does the same on any ground: test_replay.py."""
    records: list[tuple[str, float, Any]] = []

    def record(name: str, kind: Any) -> None:
        def note(data: bytes) -> None:
            records.append((probe.topic(name), time(), deserialize_message(data, kind)))

        probe.node.create_subscription(kind, probe.topic(name), note, 100, raw=True)

    with probe.running(parameters=PARAMETERS):
        for name, kind in RECORDED.items():
            record(name, kind)
        probe.wait_for(lambda: probe.node.count_publishers(probe.topic("spawn_body/_service_event")))
        probe.publish_map(np.zeros((21, 21)), resolution=0.5, origin=(-5.0, -5.0, 0.0))
        probe.wait_for(lambda: any(topic.endswith("heightmap") for topic, *_ in records))
        spawn(probe, "ball", (1.0, 0.5, 0.4))
        place = pytest.approx((1.0, 0.5, 0.2), abs=1e-3)
        probe.wait_for(lambda: position_of(probe, "ball") == place)
    bags.write(tmp_path / "bag", records)
    with Replay(tmp_path / "bag", PARAMETERS) as run:
        run.run()
        run.run(run.time + 1.0)
        assert not run.refused
        assert run.world.state("ball").position == place
