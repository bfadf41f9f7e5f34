"""The accuracy study: its arithmetic, that scenes run, and that the defaults pass the quick rows."""

import math
from dataclasses import replace
from pathlib import Path

import pytest

from smartmesh_ros.tools.evaluation.scene import Bodies, Scene
from studies import accuracy
from studies.accuracy import run_scene
from studies.configurations import configurations
from studies.contest import Result, beyond_all, cheapest_as_accurate, only_by
from studies.matrix.run import ROWS, run_cell


def test_a_front_holds_what_nothing_beats_and_says_who_is_there_by_one_measure_only() -> None:
    results = {
        "all round": Result(cost=0.5, p99=0.06, hover=0.0, deviation=0.8),
        "leaves the ground": Result(cost=1.0, p99=0.0, hover=0.0, deviation=0.7),
        "sinks": Result(cost=1.0, p99=0.05, hover=0.0, deviation=0.001),
        "a bit of both": Result(cost=1.0, p99=0.01, hover=0.0, deviation=0.01),
        "beaten": Result(cost=2.0, p99=0.02, hover=0.0, deviation=0.02),
        "loses": Result(cost=0.4, p99=0.0001, lost=1),
        "hovers": Result(cost=0.7, p99=0.0, hover=0.09),
        "stopped before a second": Result(cost=0.9, p99=0.002, hover=0.0),
        "stopped": Result(),
    }
    assert only_by(results) == {
        "all round": "", "stopped before a second": "distance", "leaves the ground": "distance", "sinks": "deviation",
        "a bit of both": "both together",
    }  # fmt: skip
    assert cheapest_as_accurate(results, 0.05, 0.01) == "a bit of both"
    untold = {name: replace(result, deviation=math.nan) for name, result in results.items()}
    front = ("all round", "stopped before a second", "leaves the ground")
    assert only_by(untold) == dict.fromkeys(front, ""), "without a reference there is one measure"
    assert cheapest_as_accurate(untold, 0.02) == "stopped before a second"


def test_what_beats_all_of_ours_is_nearer_both_to_the_ground_and_to_the_reference() -> None:
    ours = {"a": Result(cost=5.0, p99=0.01), "b": Result(cost=2.0, p99=0.05)}
    rivals = {"better": Result(cost=1.0, p99=0.005), "other": Result(cost=1.0, p99=0.02)}
    assert beyond_all(ours, rivals) == ["better"]
    true = {name: replace(result, deviation=0.01) for name, result in ours.items()}
    for deviation, found in ((0.5, []), (0.01, ["better"])):
        assert beyond_all(true, {k: replace(one, deviation=deviation) for k, one in rivals.items()}) == found


def small_scene() -> Scene:
    bodies = Bodies(count=3, drop=0.0, spread=(2.0, 2.0))
    return Scene(
        name="small", title="Small", ground={"kind": "flat"}, grid=(41, 0.25), bodies=bodies, duration=0.5, settle=0.1,
        reference="none", quick=True,
    )  # fmt: skip


@pytest.fixture(scope="module")
def results() -> dict[str, Result]:
    """The small scene in every engine."""
    return run_scene(small_scene(), configurations(quick=True))


def test_a_scene_runs_in_every_engine_and_bodies_stay_on_level_ground(results: dict[str, Result]) -> None:
    for name, result in results.items():
        assert result.lost == 0, name
        assert result.most < 2e-3, name
        assert result.cost > 0.0, name


def test_the_study_writes_what_it_says(
    results: dict[str, Result], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What it measures is tested above, and the picture of a box in test_pictures.py."""
    monkeypatch.setattr(accuracy, "read_scenes", lambda: [small_scene()])
    monkeypatch.setattr(accuracy, "run_scene", lambda *_, **__: results)
    monkeypatch.setattr(accuracy, "draw_box", lambda path: path.touch())
    monkeypatch.setattr(accuracy, "run_matrix", lambda *_, **__: [run_cell(ROWS[0], "defaults")])
    assert accuracy.main(["--quick", "--out", str(tmp_path)]) == 0
    pictures = ("small", "all", "stability")
    for name in ("accuracy.json", "accuracy_tables.md", *(f"images/accuracy/{picture}.png" for picture in pictures)):
        assert (tmp_path / name).stat().st_size > 500, name
    accuracy.CHARTS.write(tmp_path, {"machine": "another run"})
    assert (tmp_path / "accuracy.md").read_text() == "another run\n"


@pytest.mark.parametrize("part", ["--quick", "--matrix-only", "--charts-only", "--methods defaults", "--scenes flat"])
def test_a_part_of_a_run_changes_no_document(part: str) -> None:
    assert accuracy.CHARTS.folder(accuracy.parser().parse_args(part.split())) == Path("out/studies")
    assert accuracy.CHARTS.folder(accuracy.parser().parse_args([])) == Path("docs")
