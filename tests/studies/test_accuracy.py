"""The accuracy study: its arithmetic, its scenes, which are what their files say, and that they run in every engine."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from smartmesh_ros import GridGeometry, InputError
from smartmesh_ros.tools.evaluation.clearance import clearances
from smartmesh_ros.tools.evaluation.grounds import make_ground
from smartmesh_ros.tools.evaluation.scene import Bodies, Scene, read_scene, read_scenes
from studies import accuracy, contest
from studies.accuracy import BodyContest, run_scene
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


def test_a_scene_runs_in_every_engine_and_is_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Bodies stay on level ground. The picture of a box: test_pictures.py."""
    scene = Scene(
        name="small", title="Small", ground={"kind": "flat"}, grid=(41, 0.25), duration=0.5, settle=0.1,
        bodies=Bodies(count=3, drop=0.0, spread=(2.0, 2.0)), reference="none", quick=True,
    )  # fmt: skip
    results = run_scene(scene, configurations(quick=True))
    for name, result in results.items():
        assert result.lost == 0, name
        assert result.most < 2e-3, name
        assert result.cost > 0.0, name
    monkeypatch.setattr(accuracy, "read_scenes", lambda: [scene])
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


SCENES = read_scenes()


@pytest.mark.parametrize("scene", SCENES, ids=[scene.name for scene in SCENES])
def test_bodies_start_on_the_ground_and_not_in_it(scene) -> None:  # type: ignore[no-untyped-def]
    starts = scene.starts()
    assert len(starts) == scene.bodies.count
    positions = np.array([start.position for start in starts])
    orientations = np.tile([0.0, 0.0, 0.0, 1.0], (len(starts), 1))
    surface = scene.surface(scene.make_ground().heights(0.0))
    found = clearances(surface, scene.bodies.make_shape(), positions, orientations, reach=2.0)
    assert (found > -0.1 * scene.bodies.make_shape().bounding_radius).all()
    assert (found < scene.bodies.drop + 0.5 * scene.bodies.make_shape().bounding_radius + 1e-6).all()


def test_the_elevation_model_is_the_same_terrain_at_every_resolution() -> None:
    coarse = make_ground(GridGeometry(rows=9, columns=9, resolution=10.0), "elevation").heights(0.0)
    fine = make_ground(GridGeometry(rows=33, columns=33, resolution=2.5), "elevation").heights(0.0)
    np.testing.assert_allclose(fine[::4, ::4] - fine[0, 0], coarse - coarse[0, 0], atol=1e-3)


@pytest.mark.parametrize(
    "text",
    [
        "[]",
        "{",
        "title: x",
        "{title: x, ground: {kind: flat}, grid: !!bool x}",
        "{title: x, ground: {kind: flat}, grid: [9, 0.1], speed: 3}",
        "{title: x, ground: {kind: flat}, grid: [9, 0.1], bodies: {colour: red}}",
        "{title: x, ground: {kind: lava}, grid: [9, 0.1]}",
        "{title: x, ground: {kind: slope, steepness: 3}, grid: [9, 0.1]}",
        "{title: x, ground: flat, grid: [9, 0.1]}",
        "{title: x, ground: {}, grid: [9, 0.1]}",
        "{title: x, ground: {kind: flat}, grid: 9}",
        "{title: x, ground: {kind: flat}, grid: [9, 0.1], duration: 0}",
        "{title: x, ground: {kind: flat}, grid: [9, 0.1], duration: long}",
        "{title: x, ground: {kind: flat}, grid: [9, 0.1], settle: .nan}",
        "{title: x, ground: {kind: flat}, grid: [9, 0.1], bodies: {count: 0}}",
        "{title: x, ground: {kind: flat}, grid: [9, 0.1], bodies: {size: 0.2}}",
    ],
)
def test_files_that_make_no_scene_are_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "bad.yaml"
    path.write_text(text)
    with pytest.raises(InputError):
        read_scene(path).make_ground()


@pytest.mark.parametrize("name", ["slope", "elevation_10m"])
def test_references_on_rigid_ground_change_little_at_a_higher_rate(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where they correct the same share of a penetration in each step they change by 94 mm and 31 m."""
    [scene] = [scene for scene in SCENES if scene.name == name]
    few = replace(scene, bodies=replace(scene.bodies, count=12))
    places = []
    for rate in (contest.FINE_RATE, 4.0 * contest.FINE_RATE):
        for module in (contest, accuracy):
            monkeypatch.setattr(module, "FINE_RATE", rate)
        places.append(BodyContest(few).reference())
    assert places[0] is not None and places[1] is not None
    assert np.median(np.linalg.norm(places[0] - places[1], axis=1)) < 2e-3


def test_ground_that_slides_is_at_rest_for_who_goes_along() -> None:
    [scene] = [scene for scene in SCENES if scene.slide != (0.0, 0.0)]
    at_rest = replace(scene, slide=(0.0, 0.0), bodies=replace(scene.bodies, count=1, velocity=(-1.0, 0.0, 0.0)))
    sliding = replace(at_rest, slide=(1.0, 0.0), bodies=replace(at_rest.bodies, velocity=(0.0, 0.0, 0.0)))
    found, expected = (BodyContest(one).reference() for one in (sliding, at_rest))
    assert found is not None and expected is not None
    assert found == pytest.approx(expected + (1.0, 0.0, 0.0), abs=1e-9)
    heights = scene.make_ground().heights(0.0)
    place = np.array([[10.3, 9.1, 1.0]])
    assert scene.surface(heights, 2.0).below(place + (2.0, 0.0, 0.0)) == pytest.approx(
        scene.surface(heights).below(place), abs=1e-6
    )
