"""Scenes are what their files say, and what a file says wrongly is refused."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from smartmesh_ros import GridGeometry, InputError
from smartmesh_ros.tools.evaluation.clearance import clearances
from smartmesh_ros.tools.evaluation.grounds import GROUNDS, make_ground
from smartmesh_ros.tools.evaluation.scene import read_scene, read_scenes
from studies import accuracy, contest
from studies.accuracy import BodyContest

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


@pytest.mark.parametrize("kind", GROUNDS)
def test_every_ground_is_finite_at_every_time(kind: str) -> None:
    ground = make_ground(GridGeometry(rows=31, columns=41, resolution=0.1), kind)
    for time in (0.0, 0.3, 1.0, 5.0):
        heights = ground.heights(time)
        assert heights.shape == (31, 41)
        assert np.isfinite(heights).all()


def test_the_elevation_model_is_the_same_terrain_at_every_resolution() -> None:
    coarse = make_ground(GridGeometry(rows=9, columns=9, resolution=10.0), "elevation").heights(0.0)
    fine = make_ground(GridGeometry(rows=33, columns=33, resolution=2.5), "elevation").heights(0.0)
    np.testing.assert_allclose(fine[::4, ::4] - fine[0, 0], coarse - coarse[0, 0], atol=1e-3)


@pytest.mark.parametrize(
    "text",
    [
        "[]",
        "title: x",
        "{title: x, ground: {kind: flat}, grid: [9, 0.1], speed: 3}",
        "{title: x, ground: {kind: flat}, grid: [9, 0.1], bodies: {colour: red}}",
        "{title: x, ground: {kind: lava}, grid: [9, 0.1]}",
        "{title: x, ground: {kind: slope, steepness: 3}, grid: [9, 0.1]}",
    ],
)
def test_files_that_make_no_scene_are_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "bad.yaml"
    path.write_text(text)
    with pytest.raises(InputError):
        read_scene(path).make_ground()


@pytest.mark.parametrize("name", ["slope", "elevation_10m"])
def test_references_on_rigid_ground_change_little_at_four_times_the_rate(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
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
