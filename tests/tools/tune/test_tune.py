"""The measure is right, the command goes from its beginning to its file, and the node loads what it writes."""

import math
import signal
import sys
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import pytest
import yaml

from smartmesh_ros.errors import InputError
from smartmesh_ros.tools.replay.cli import INTERRUPTED
from smartmesh_ros.tools.testing import TIMEOUT, Probe, Process, bags, heightmap_message
from smartmesh_ros.tools.tune import cli, grid
from smartmesh_ros.tools.tune.case import open_case
from smartmesh_ros.tools.tune.grid import KNOWN
from smartmesh_ros.tools.tune.measuring import measure
from tests.node import shared
from tests.preloaded import has_ended

SCENE = {
    "title": "Three balls on a small wave",
    "ground": {"kind": "waves", "amplitude": 0.1, "number": 1.0, "frequency": 3.0},
    "grid": [31, 0.25],
    "bodies": {"count": 3, "spread": [2, 2]},
    "map_rate": 30,
    "duration": 0.2,
    "settle": 0.05,
}
SPAWN = [
    "{id: ball, shape: sphere, size: [0.2], mass: 1.0, xy: [0.1, 0.2], above: 0.25}",
    "{id: crate, shape: box, size: [0.3, 0.2, 0.2], mass: 2.0, xy: [-1.0, 0.5], above: 0.2, yaw: 0.4}",
]
MAP = "/terrain_collider/heightmap"


def recorded(path: Path, yaw: float = 0.0, topic: str = MAP) -> str:
    """A bag of waves at 20 Hz, turned by ``yaw`` [rad]."""
    x = np.linspace(-3.0, 3.0, 41)
    origin = (-3.0 * math.cos(yaw) + 3.0 * math.sin(yaw), -3.0 * math.sin(yaw) - 3.0 * math.cos(yaw), 0.0)

    def message(time: float) -> Any:
        heights = np.tile(0.1 * np.sin(2.0 * x - 4.0 * time), (41, 1))
        return heightmap_message(heights, resolution=0.15, origin=origin, yaw=yaw)

    bags.write(path, [(topic, 0.05 * k, message(0.05 * k)) for k in range(13)])
    return str(path)


def test_nodes_load_what_is_written(domain: int, tmp_path: Path, capfd: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """In a namespace of its own: a node of the same name that another test left behind would be warned of."""
    monkeypatch.setattr(grid, "GRID", {"physics.rate": (60.0, 240.0), "physics.solver_residual": (1e-9, 1e-5)})
    scene, start = tmp_path / "small.yaml", tmp_path / "start.yaml"
    scene.write_text(yaml.safe_dump(SCENE))
    given = {"bodies": {"default_radius": 0.3, "spawn": ["{id: b, shape: sphere, size: [0.2], xyz: [0, 0, 1]}"]}}
    start.write_text(yaml.safe_dump({"terrain_collider": {"ros__parameters": {**given, "physics.rate": 180.0}}}))
    out = tmp_path / "out"
    words = [str(scene), "--params-file", str(start), "--out", str(out), "--jobs", "2"]
    assert cli.main([*words, "--budget", "100"]) == 0
    said = capfd.readouterr().out
    assert "this file" in said and "as given" in said and (out / "small.png").stat().st_size > 10_000
    text = (out / "small_tuned.yaml").read_text()
    assert "# defaults" in text and "# as given" in text and "measured over 0.2 s" in text
    values = yaml.safe_load(text)["/**"]["ros__parameters"]
    assert set(KNOWN) < set(values)
    assert values["bodies.spawn"] == given["bodies"]["spawn"] and values["bodies.default_radius"] == 0.3
    arguments = ["--ros-args", "--params-file", str(out / "small_tuned.yaml")]
    with Probe(namespace="tuned") as probe, probe.running(arguments=arguments) as process:
        assert shared.values(probe, values) == values
        assert "[WARN" not in process.output and "[ERROR" not in process.output
    assert cli.main([*words, "--budget", "1e-6"]) == 1
    words = "Asked: cost at most 1e-06 of a core. NOT POSSIBLE: the nearest settings exceed the limits of cost."
    assert words in capfd.readouterr().out and words in (out / "small_nearest.yaml").read_text()


def test_a_map_that_is_turned_is_measured_as_one_that_is_not(tmp_path: Path) -> None:
    found = []
    for yaw in (0.0, 0.5):
        x, y = 0.1 * math.cos(yaw) - 0.2 * math.sin(yaw), 0.1 * math.sin(yaw) + 0.2 * math.cos(yaw)
        ball = f"{{id: ball, shape: sphere, size: [0.2], mass: 1.0, xy: [{x}, {y}], above: 0.25}}"
        case = open_case(recorded(tmp_path / f"{yaw}", yaw), {"bodies.spawn": [ball]}, [], None)
        found.append(measure(case, {})[0])
    assert all(math.isfinite(one.penetration) and not one.failed for one in found)
    assert found[0].penetration == pytest.approx(found[1].penetration, abs=2e-5)
    assert found[0].hover == pytest.approx(found[1].hover, abs=2e-5)


def test_ground_that_is_not_followed_is_measured_as_penetration(tmp_path: Path) -> None:
    """Control: on ground that waits for the next map, bodies are inside the true ground by what it rises."""
    case = open_case(recorded(tmp_path / "bag", topic="/m"), {"bodies.spawn": SPAWN}, [("~/heightmap", "/m")], None)
    kept, _ = measure(case, {})
    lagging, positions = measure(case, {"terrain.motion": "hold"})
    assert kept.penetration < 0.5 * lagging.penetration
    assert kept.hover < 0.5 * lagging.hover
    assert kept.cost > 0.0 and kept.longest > 0.0 and positions.keys() == {"ball", "crate"}


def test_where_nothing_can_be_measured_the_search_ends_with_the_first_setting(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(grid, "GRID", {"physics.rate": (60.0, 240.0), "physics.solver_residual": (1e-9,)})
    case, shares = open_case(recorded(tmp_path / "bag"), {}, (), 0.2), list[float]()
    with pytest.raises(InputError, match="no simulated body stayed over the ground"):
        grid.measure_all(case, 1, shares.append)
    assert not shares


def test_ground_that_was_taken_away_is_not_measured(tmp_path: Path) -> None:
    """The crate falls where a tile was; the ball stays on another one."""
    east = heightmap_message(np.zeros((41, 41)), origin=(-2.0, -2.0, 0.0), tile="east")
    west = heightmap_message(np.zeros((41, 41)), origin=(-8.0, -2.0, 0.0), tile="west")
    maps = [east, west, heightmap_message(np.empty((0, 0)), tile="west"), east]
    bags.write(tmp_path / "bag", [(MAP, 0.3 * k, message) for k, message in enumerate(maps)])
    spawn = [SPAWN[0].replace("0.25", "0.2"), SPAWN[1].replace("-1.0, 0.5", "-6.0, 0.0")]
    figures, places = measure(open_case(str(tmp_path / "bag"), {"bodies.spawn": spawn}, [], None), {})
    assert places["crate"][2] < 0.0
    assert figures.penetration < 1e-3 and not figures.failed


def test_steps_as_seldom_as_measurements_are_measured(tmp_path: Path) -> None:
    case = open_case(recorded(tmp_path / "bag"), {"bodies.spawn": SPAWN}, [], None)
    for rate in (10.0, 30.0):
        assert math.isfinite(measure(case, {"physics.rate": rate})[0].penetration)


def test_corrected_ground_is_the_one_that_the_node_shows(tmp_path: Path) -> None:
    """Noisy maps of ground at rest: bodies stand on what is shown, which no single map is."""
    rng, path = np.random.default_rng(3), tmp_path / "bag"
    maps = [
        heightmap_message(rng.normal(0.0, 0.02, (41, 41)), resolution=0.15, origin=(-3.0, -3.0, 0.0)) for _ in range(12)
    ]
    bags.write(path, [(MAP, 0.1 * k, message) for k, message in enumerate(maps)])
    case = open_case(
        str(path), {"bodies.spawn": SPAWN, "terrain.changes": "correction", "terrain.noise": 0.02}, [], None
    )
    assert measure(case, {})[0].penetration < 1e-3


def test_a_signal_ends_the_search_and_its_processes(tmp_path: Path) -> None:
    """And what follows in a script sees that there is no result. SIGINT, taken alike: test_command.py of the replay."""
    with Process("tune", arguments=["flat", "--seconds", "1000", "--out", str(tmp_path)]) as search:
        started = psutil.Process(search.process.pid)
        # The tracker of resources, the server of forks, and what that makes.
        shared.wait_until(lambda: len(started.children(recursive=True)) > 2)
        children = started.children(recursive=True)
        search.process.send_signal(signal.SIGTERM)
        assert search.process.wait(TIMEOUT) == INTERRUPTED
        shared.wait_until(lambda: all(has_ended(child.pid) for child in children))
        assert "Traceback" not in search.output


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["flat", "--budget", "0"], "--budget: '0' is no number from 1e-09"),
        (["flat", "--jobs", "0"], "--jobs: '0' is no whole number from 1"),
        (["flat", "-p", "physics.rate:=fast"], "physics.rate is 'fast'; it must be of type float"),
        (["flat", "--preset", "swift"], "there is no preset 'swift'; choose accurate"),
        (["flat", "--out", "/proc/nowhere"], "nothing can be written in /proc/nowhere"),
        (["nowhere"], "no bag and no scene 'nowhere'; the scenes are crater"),
        (["bag", "--seconds", "0.05"], "0.05 s of messages for the node; record at least 0.1 s"),
    ],
)
def test_what_cannot_be(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, options: list[str], words: str
) -> None:
    monkeypatch.setattr(grid, "GRID", {name: (value,) for name, value in KNOWN.items()})
    source, *others = options
    given = recorded(tmp_path / "bag") if source == "bag" else source
    with pytest.raises(SystemExit, match="2"):
        sys.exit(cli.main([given, "--out", str(tmp_path / "out"), *others]))
    said = capsys.readouterr().err
    assert words in said and "Traceback" not in said
