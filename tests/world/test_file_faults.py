"""The k-th opening, reading or writing of a file fails, for k = 1, 2, ...: a refusal, after which all goes on."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from smartmesh_ros import BodyState, World
from smartmesh_ros.io import files
from smartmesh_ros.io.urdf import checked_urdf
from smartmesh_ros.world.robots.prepared import prepare_robot
from tests.faults import Faults, file_faults
from tests.urdfs import link, robot

TETRAHEDRON = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\nf 1 3 4\nf 2 3 4\n"


@pytest.fixture
def faults(world: World, monkeypatch: pytest.MonkeyPatch) -> Faults:
    prepare_robot(robot(link("base", '<sphere radius="1"/>')))
    return file_faults(monkeypatch)  # after the child process has started, whose pipes are opened as files are


def robot_in(folder: Path, scale: float) -> Path:
    """A robot of one mesh. No other robot has the same, so that nothing of it is remembered."""
    (folder / "mesh.obj").write_text(TETRAHEDRON)
    file = folder / "robot.urdf"
    file.write_text(robot(link("base", f'<mesh filename="mesh.obj" scale="{scale} {scale} {scale}"/>')))
    return file


def test_a_robot_is_spawned_or_not(faults: Faults, world: World, tmp_path: Path) -> None:
    for number in faults.runs():
        file = str(robot_in(tmp_path, 0.2 + 0.001 * number))
        if not faults.done(number, lambda: world.spawn_robot("robot", file, BodyState((0.0, 0.0, 0.05)))):  # noqa: B023
            assert faults.fired in faults.said
            assert world.bodies == {}
            assert world.client.getNumBodies() == 0
            world.spawn_robot("robot", file, BodyState((0.0, 0.0, 0.05)))
        low, high = (np.array(corner) for corner in world.client.getAABB(world.bodies["robot"].uid))
        assert (high - low > 0.2).all(), "a mesh of which half was written is loaded"
        world.step(30)
        assert world.below_ground() == []
        world.remove("robot")


def test_a_file_is_read_or_refused(faults: Faults, tmp_path: Path) -> None:
    heights = np.arange(12, dtype=np.uint8).reshape(3, 4)
    np.save(tmp_path / "heights.npy", heights)
    Image.fromarray(heights).save(tmp_path / "heights.png")
    urdf = robot_in(tmp_path, 0.9)
    readers: list[Callable[[], Any]] = [
        lambda: files.load(tmp_path / "heights.npy"),
        lambda: files.load(tmp_path / "heights.png"),
        lambda: checked_urdf(str(urdf), [tmp_path]),
    ]
    for read in readers:
        for number in faults.runs():
            if not faults.done(number, read):
                assert faults.fired in faults.said
                read()
        assert number > 1
