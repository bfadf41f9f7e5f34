"""Bags that cannot be replayed: each is refused with what is in it."""

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from nav_msgs.msg import Odometry

from smartmesh_ros.node.timing.pacing import stamp_of
from smartmesh_ros.tools.testing import bags, heightmap_message, pose_message
from smartmesh_ros.tools.tune import cli

SPAWN = "bodies.spawn=['{id: ball, shape: sphere, size: [0.2], mass: 1.0, xy: [0.0, 0.0], above: 0.3}']"
ODOMETRY = "bodies.odometry=[rover=/odom]"
MAP, POSE = "/terrain_collider/heightmap", "/odom"


def a_map(time: float, frame: str = "map") -> tuple[str, float, Any]:
    message = heightmap_message(np.zeros((9, 9)), resolution=0.5, origin=(-2.0, -2.0, 0.0), stamp=stamp_of(time))
    message.header.frame_id = frame
    return MAP, time, message


def a_pose(time: float, frame: str = "map") -> tuple[str, float, Any]:
    message = Odometry(child_frame_id="base_link")
    message.header.stamp, message.header.frame_id = stamp_of(time), frame
    message.pose.pose = pose_message((0.1 * time, 0.0, 0.3))
    return POSE, time, message


def recorded(frame: str = "map") -> Iterator[tuple[str, float, Any]]:
    for tick in range(40):
        yield a_map(1.0 + 0.05 * tick)
        yield a_pose(1.0 + 0.05 * tick, frame)


def words_of(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    """What `tune` says when it refuses to begin."""
    assert cli.main([*arguments, "--trials", "1"]) == 2
    said = capsys.readouterr().err
    assert "Traceback" not in said
    return said


def written(path: Path, messages: Iterable[tuple[str, float, Any]], storage: Any = "mcap") -> str:
    bags.write(path, messages, storage)
    return str(path)


CONTENTS = f"{MAP}  smartmesh_msgs/msg/Heightmap  40 messages"


def test_no_maps(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bag = written(tmp_path / "bag", (a_pose(0.1 * tick) for tick in range(20)))
    said = words_of(capsys, bag, "--set", SPAWN)
    assert "no maps: terrain.input 'heightmap' needs smartmesh_msgs/msg/Heightmap" in said
    assert "/odom  nav_msgs/msg/Odometry  20 messages" in said


def test_maps_of_another_kind(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    said = words_of(capsys, str(Path(__file__).parents[2] / "data" / "mapper"), "--set", SPAWN)
    assert "give --set terrain.input=grid_map" in said
    assert "/elevation_map  grid_map_msgs/msg/GridMap" in said


def test_bodies_in_other_frames(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    said = words_of(capsys, written(tmp_path / "bag", recorded("odom")), "--set", ODOMETRY)
    assert "bodies are in other frames than the maps" in said
    assert "maps in frame 'map'" in said and "bodies on /odom in frame 'odom'" in said
    assert CONTENTS in said


def test_maps_in_other_frames(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bag = written(tmp_path / "bag", recorded())
    said = words_of(capsys, bag, "--set", SPAWN, "--set", "frame_id=world")
    assert "no map of the bag can be taken" in said and "frame 'map' is not the terrain's frame 'world'" in said


def test_one_message(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    said = words_of(capsys, written(tmp_path / "bag", [a_map(1.0)]), "--set", SPAWN)
    assert "1 messages within 0 s" in said and "Heightmap  1 messages" in said


def test_no_bodies(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    said = words_of(capsys, written(tmp_path / "bag", recorded()))
    assert "there are no bodies" in said and CONTENTS in said


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_a_file_that_is_cut_off(tmp_path: Path, capsys: pytest.CaptureFixture[str], storage: str) -> None:
    bag = written(tmp_path / "bag", recorded(), storage)
    [file] = [path for path in (tmp_path / "bag").iterdir() if path.suffix in (".mcap", ".db3")]
    data = file.read_bytes()
    file.write_bytes(data[: len(data) // 2])
    said = words_of(capsys, bag, "--set", SPAWN)
    assert "cut off or damaged" in said and CONTENTS in said


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--set", "bodies.odometry=[rover=/odometry]"], "there is no topic /odometry"),
        (["--set", f"bodies.odometry=[rover={MAP}]"], f"{MAP} has smartmesh_msgs/msg/Heightmap, and must have"),
        (["--terrain", "/elevation"], "--terrain: there is no topic /elevation"),
    ],
)
def test_unknown_topics(tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], words: str) -> None:
    said = words_of(capsys, written(tmp_path / "bag", recorded()), *arguments)
    assert words in said and CONTENTS in said


def test_no_bag_at_all(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "notes.txt").write_text("")
    assert "it has no metadata.yaml (there is: notes.txt)" in words_of(capsys, str(tmp_path))
    assert "no bag and no scene 'nowhere'; the scenes are crater" in words_of(capsys, "nowhere")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--budget", "0"], "--budget is 0; it must be a number greater than zero"),
        (["--penetration", "-0.001"], "--penetration is -0.001"),
        (["--set", "patch.rats=0.1"], "did you mean 'patch.rate'?"),
        (["--set", "physics.rate=fast"], "physics.rate is 'fast'"),
        (["--preset", "swift"], "there is no preset 'swift'; choose accurate"),
        (["--params-file", "missing.yaml"], "missing.yaml is no parameter file"),
        (["--storage", "nosuchsql://x"], "--storage 'nosuchsql://x' does not open"),
    ],
)
def test_bad_wishes(capsys: pytest.CaptureFixture[str], arguments: list[str], words: str) -> None:
    assert words in words_of(capsys, "flat", *arguments)
