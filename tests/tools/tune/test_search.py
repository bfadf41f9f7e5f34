"""A search from its beginning to its file: it goes on where it was ended, and the node loads what it writes."""

import itertools
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml
from optuna.trial import TrialState
from rcl_interfaces.srv import GetParameters
from rclpy.parameter import parameter_value_to_python

from smartmesh_ros.tools.testing import Probe
from smartmesh_ros.tools.tune import cli, search, space
from smartmesh_ros.tools.tune.session import open_search

SCENE = {
    "title": "Three balls on a small wave",
    "ground": {"kind": "waves", "amplitude": 0.1, "number": 1.0, "frequency": 3.0},
    "grid": [31, 0.25],
    "bodies": {"count": 3, "spread": [2, 2]},
    "map_rate": 30,
    "duration": 0.2,
    "settle": 0.05,
}


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    path = tmp_path / "small.yaml"
    path.write_text(yaml.safe_dump(SCENE))
    return path


def test_the_node_loads_what_is_written(probe: Probe, scene: Path, tmp_path: Path, capsys: Any) -> None:
    start = tmp_path / "start.yaml"
    given = {"bodies": {"default_radius": 0.3, "spawn": ["{id: b, shape: sphere, size: [0.2], xyz: [0, 0, 1]}"]}}
    start.write_text(yaml.safe_dump({"terrain_collider": {"ros__parameters": given}}))
    out = tmp_path / "out"
    words = [str(scene), "--params-file", str(start), "--trials", "14", "--seed", "1", "--out", str(out)]
    assert cli.main(words) == 0
    said = capsys.readouterr().out
    assert "this file" in said and "preset fleet" in said and (out / "small.png").stat().st_size > 10_000
    text = (out / "small_tuned.yaml").read_text()
    assert "# defaults" in text and "# preset accurate" in text and "Measured over 0.4 s" in text
    values = yaml.safe_load(text)["/**"]["ros__parameters"]
    assert set(space.LADDERS) < set(values)
    assert values["bodies.spawn"] == given["bodies"]["spawn"] and values["bodies.default_radius"] == 0.3
    with probe.running(arguments=["--ros-args", "--params-file", str(out / "small_tuned.yaml")]) as process:
        names = list(values)
        found = probe.call("get_parameters", GetParameters, names=names).values
        assert {name: parameter_value_to_python(value) for name, value in zip(names, found, strict=True)} == values
        assert "[WARN" not in process.output and "[ERROR" not in process.output
    # The same command has nothing left to try; what cannot be is said to be so, with what comes nearest.
    assert cli.main([*words, "--budget", "1e-6"]) == 1
    said = capsys.readouterr().out
    assert " settings tried" in said
    assert "Not possible here: cost at most 1e-06 of a core" in said and "nearest that was found has cost" in said
    assert "(at most 1e-06 of a core, as asked)" in said and "What binds in the search is the limit of cost" in said
    assert "NOT POSSIBLE" in (out / "small_nearest.yaml").read_text()


@pytest.fixture
def obeyed() -> Iterator[None]:
    """SIGINT raises KeyboardInterrupt, whatever earlier tests of this process have left."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.parametrize("within", ["run", "measure"])
def test_an_interrupted_search_goes_on(
    scene: Path, tmp_path: Path, obeyed: None, monkeypatch: pytest.MonkeyPatch, within: str
) -> None:
    options = cli.parser().parse_args([str(scene), "--seed", "3", "--out", str(tmp_path)])
    first = open_search(options)
    first.prepare()
    calls, usual = itertools.count(), getattr(search, within)

    def interrupted(*arguments: Any) -> Any:
        if next(calls) == 5:
            signal.raise_signal(signal.SIGINT)
        return usual(*arguments)

    with monkeypatch.context() as patched, pytest.raises(KeyboardInterrupt):
        patched.setattr(search, within, interrupted)
        first.run(18)
    again = open_search(options)
    kept = again.points()
    assert len(kept) == 5
    assert not again.study.get_trials(states=(TrialState.RUNNING,))
    assert again.base == first.base and again.reference == first.reference
    again.prepare()
    again.run(18)
    assert len(again.points()) == 18
    assert again.points()[: len(kept)] == kept


def test_processes_share_one_search(scene: Path, tmp_path: Path, capfd: Any) -> None:
    words = [str(scene), "--trials", "18", "--jobs", "2", "--out", str(tmp_path)]
    assert cli.main([*words, "--storage", f"sqlite:///{tmp_path}/tune.db"]) == 0
    said = "".join(capfd.readouterr()).lower()
    assert not any(word in said for word in ("pybullet", "optuna", "trial", "warning"))
    again = open_search(cli.parser().parse_args([*words, "--storage", f"sqlite:///{tmp_path}/tune.db"]))
    assert len(again.points()) >= 18
