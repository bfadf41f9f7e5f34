"""What pictures show is simulated, and the README names the depths of the run."""

import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from scripts import height_scan
from smartmesh_ros import BodyState, World
from smartmesh_ros.scenes.tracks import robot_file
from studies.matrix.run import draw_box
from studies.rising_picture import WAYS, grid, height, simulated
from studies.soil.rut_pictures import ramp
from studies.tiny_renderer import Stage

README = (Path(__file__).parents[2] / "README.md").read_text()


def test_the_depths_that_the_readme_names_are_those_of_the_run() -> None:
    replaced, ours = (np.array([depths for _, _, depths in simulated(way)]) for way in WAYS)  # of pictures and bodies
    [named] = re.findall(r"sink (\d+) mm into it; here they sink ([\d.]+) mm", README.replace("\n", " "))
    for depths, millimetres in zip((replaced, ours), named, strict=True):
        assert 1e3 * depths.max() == pytest.approx(float(millimetres), rel=0.2)
    assert (replaced.max(axis=0) > 10.0 * ours.max(axis=0)).all(), "each body"


def test_the_ground_rises_as_fast_as_the_readme_says() -> None:
    [speed] = re.findall(r"ground rises at ([\d.]+) m/s", README.replace("\n", " "))
    times = np.arange(0.0, 2.0, 0.01)
    heights = np.array([height(0.0, time) for time in times])
    assert np.diff(heights).max() / 0.01 == pytest.approx(float(speed), rel=0.02)
    assert grid(0.0).shape == (41, 101)


def test_the_points_of_a_height_scan_are_drawn(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """By `make height-scan`."""
    monkeypatch.setattr("sys.argv", ["height_scan", str(tmp_path / "scan.png")])
    height_scan.main()
    assert np.shape(Image.open(tmp_path / "scan.png")) == (640, 1000, 3)
    assert "a row for each y, x from left to right" in capfd.readouterr().out


def test_a_robot_is_drawn_where_it_stands() -> None:
    """Also one whose centre of mass is not at the frame of its base link."""
    stage = Stage()
    with World(ramp()) as world:
        world.spawn_robot("machine", robot_file().read_text(), BodyState(), on_ground=True, align=True)
        stage.add_robot(world, "machine", str(robot_file()))
        for link in range(-1, world.client.getNumJoints(world.bodies["machine"].uid)):
            expected = world.client.getAABB(world.bodies["machine"].uid, link)
            np.testing.assert_allclose(stage.client.getAABB(0, link), expected, atol=5e-3)  # margins differ


def test_the_picture_is_drawn(tmp_path: Path) -> None:
    draw_box(tmp_path / "box.png", seconds=0.2)
    assert (tmp_path / "box.png").read_bytes().startswith(b"\x89PNG")
