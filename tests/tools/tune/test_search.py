"""A search from its beginning to its file: it goes on where it was ended, and the node loads what it writes."""

import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml
from optuna.trial import TrialState
from rcl_interfaces.srv import GetParameters
from rclpy.parameter import parameter_value_to_python
from smartmesh_ros.tools.tune.front import Point
from smartmesh_ros.tools.tune.idle_changes import without_idle_changes

from smartmesh_ros.tools.testing import Probe
from smartmesh_ros.tools.tune import cli, idle_changes, space
from smartmesh_ros.tools.tune.figures import Asked, Figures
from smartmesh_ros.tools.tune.search import Search, prepare, work
from smartmesh_ros.tools.tune.session import Request

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
    assert "X chosen" in said and "preset fleet" in said and (out / "small.png").stat().st_size > 10_000
    text = (out / "small_tuned.yaml").read_text()
    assert "# defaults" in text and "# preset accurate" in text and "Measured over 0.4 s" in text
    values = yaml.safe_load(text)["/**"]["ros__parameters"]
    assert set(space.SEARCHED) < set(values)
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
    assert "Not possible here: at most 1e-06 of a core" in said and "nearest that was found has cost" in said
    assert "(at most 1e-06 of a core, as asked)" in said and "What binds is the limit of cost" in said
    assert ", break what is asked" in said and "in the search" in said
    assert "NOT POSSIBLE" in (out / "small_nearest.yaml").read_text()


@pytest.fixture
def obeyed() -> Iterator[None]:
    """SIGINT raises KeyboardInterrupt, whatever earlier tests of this process have left."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def test_an_interrupted_search_goes_on(scene: Path, tmp_path: Path, obeyed: None) -> None:
    request = Request(source=str(scene), storage=str(tmp_path / "journal"), seed=3)
    case = request.open_case()
    plan = Search(trials=18, batch=3, repeats=1)
    store = request.open_store(case, 1)
    prepare(store, case, Asked(), plan, lambda _: None)
    said: list[str] = []

    def interrupt(text: str) -> None:
        said.append(text)
        if len(said) == 20:  # within a batch, wherever it is
            signal.raise_signal(signal.SIGINT)

    with pytest.raises(KeyboardInterrupt):
        work(store, case, Asked(), plan, interrupt)
    again = request.open_store(case, 2)
    kept = again.points()
    assert 0 < len(kept) < plan.trials
    assert not again.study.get_trials(states=(TrialState.RUNNING,))
    assert again.base == store.base and again.reference == store.reference
    work(again, case, Asked(), plan, lambda _: None)
    assert len(again.points()) == plan.trials
    assert again.points()[: len(kept)] == kept


def test_processes_share_one_search(scene: Path, tmp_path: Path, capfd: Any) -> None:
    words = [str(scene), "--trials", "18", "--jobs", "2", "--out", str(tmp_path)]
    assert cli.main([*words, "--storage", f"sqlite:///{tmp_path}/tune.db"]) == 0
    said = "".join(capfd.readouterr()).lower()
    assert not any(word in said for word in ("pybullet", "optuna", "trial", "warning"))
    request = Request(source=str(scene), storage=f"sqlite:///{tmp_path}/tune.db")
    assert len(request.open_store(request.open_case(), 0).points()) >= 18


def test_changes_that_do_nothing_are_left_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """On ground that is given once nothing moves between maps; how often bodies are stepped matters all the same."""
    monkeypatch.setattr(idle_changes, "SAME_COST", 100.0)  # costs are those of a busy machine
    path = tmp_path / "still.yaml"
    path.write_text(yaml.safe_dump({**SCENE, "ground": {"kind": "sinusoid", "amplitude": 0.05}, "map_rate": 0}))
    case = Request(source=str(path)).open_case()
    values = {**space.defaults(), "terrain.motion": "hold", "physics.rate": 60.0, "physics.contact_erp": 0.8}
    [point] = without_idle_changes(case, [Point(values, Figures())], None)
    assert point.values["terrain.motion"] == space.defaults()["terrain.motion"]
    assert point.values["physics.rate"] == 60.0
