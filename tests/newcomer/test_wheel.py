"""A wheel for users of PyBullet without ROS, installed into an empty environment."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.newcomer.conftest import LONG, ROOT, copy_of_this

OWN = ("demo", "fleet", "studies", "tune", "view")
COMMANDS = {"terrain_collider", "terrain_source", *(f"smartmesh-{name}" for name in OWN)}
WITHOUT_ROS = {"smartmesh-studies", "smartmesh-tune"}


def run(*command: str | Path) -> subprocess.CompletedProcess[str]:
    bare = {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "AMENT_PREFIX_PATH")}
    return subprocess.run(command, env=bare, capture_output=True, text=True, timeout=LONG, check=False)


def pip(python: Path | str, *arguments: str | Path) -> None:
    result = run(python, "-m", "pip", "--disable-pip-version-check", "--quiet", *arguments)
    if re.search("NewConnectionError|Temporary failure in name resolution", result.stderr):
        pytest.skip("packages cannot be downloaded")
    assert result.returncode == 0, result.stdout + result.stderr


@pytest.fixture(scope="module")
def environment(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A virtual environment that holds the wheel and what it asks for, and nothing else."""
    folder = tmp_path_factory.mktemp("wheel")
    copy_of_this(folder / "source")
    pip(sys.executable, "wheel", "--no-deps", "--wheel-dir", folder, folder / "source")
    [wheel] = folder.glob("smartmesh_ros-*.whl")
    made = folder / "empty"
    assert run(sys.executable, "-m", "venv", made).returncode == 0
    pip(made / "bin" / "python", "install", "-c", ROOT / "requirements" / "constraints.txt", wheel)
    return made


def test_the_ten_lines_run_without_ros(environment: Path) -> None:
    python = environment / "bin" / "python"
    assert run(python, "-c", "import rclpy").returncode != 0
    [code] = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), re.DOTALL)
    check = "\nassert p.getBasePositionAndOrientation(ball)[0][2] > -0.5, 'it fell through'\n"
    result = run(python, "-c", code + check)
    assert result.returncode == 0, result.stderr


def test_only_names_that_say_where_they_are_from_land_on_the_path(environment: Path) -> None:
    metadata = "import importlib.metadata as m; print(*[e.name for e in m.distribution('smartmesh_ros').entry_points])"
    assert set(run(environment / "bin" / "python", "-c", metadata).stdout.split()) == COMMANDS
    for command in COMMANDS - WITHOUT_ROS:
        without_ros = run(environment / "bin" / command)
        assert without_ros.returncode == 1
        assert f"{command} needs ROS 2" in without_ros.stderr
        assert "Traceback" not in without_ros.stderr
    assert "bench" in run(environment / "bin" / "smartmesh-studies", "--help").stdout
