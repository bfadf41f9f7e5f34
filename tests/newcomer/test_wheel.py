"""A wheel for users of PyBullet without ROS, installed into an empty environment."""

import importlib.metadata
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.newcomer.conftest import LONG, ROOT, copy_of_this

OWN = ("demo", "fleet", "fleet-front", "rover", "soil", "tune", "view")
CONSTRAINTS = ROOT / "requirements" / "constraints.txt"
COMMANDS = {"terrain_collider", "terrain_sensor", "terrain_source", *(f"smartmesh-{name}" for name in OWN)}
WITHOUT_ROS = {"smartmesh-tune"}


def run(*command: str | Path, **settings: str) -> subprocess.CompletedProcess[str]:
    bare = {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "AMENT_PREFIX_PATH")}
    # For the environments that pip builds in as well; bytecode of all packages would take longer than the tests.
    bare |= {"PIP_CONSTRAINT": str(CONSTRAINTS), "PIP_NO_COMPILE": "1", **settings}
    # Not from here, where the sources would be imported.
    return subprocess.run(command, env=bare, cwd="/", capture_output=True, text=True, timeout=LONG, check=False)


def pip(python: Path | str, *arguments: str | Path, **settings: str) -> None:
    result = run(python, "-m", "pip", "--disable-pip-version-check", "--quiet", *arguments, **settings)
    if re.search("NewConnectionError|Temporary failure in name resolution", result.stderr):
        pytest.skip("packages cannot be downloaded")
    assert result.returncode == 0, result.stdout + result.stderr


def install(environment: Path, *arguments: str | Path, **settings: str) -> None:
    """Install into a virtual environment without a pip of its own, which takes long to make."""
    pip(sys.executable, "--python", environment / "bin" / "python", "install", *arguments, **settings)


@pytest.fixture(scope="module")
def environment(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A virtual environment that holds the wheel and what it asks for, and nothing else."""
    folder = tmp_path_factory.mktemp("wheel")
    copy_of_this(folder / "source")
    pip(sys.executable, "wheel", "--no-deps", "--wheel-dir", folder, folder / "source")
    [wheel] = folder.glob("smartmesh_ros-*.whl")
    made = folder / "empty"
    assert run(sys.executable, "-m", "venv", "--without-pip", made).returncode == 0
    install(made, wheel)
    return made


def test_the_ten_lines_run_without_ros(environment: Path) -> None:
    python = environment / "bin" / "python"
    assert run(python, "-c", "import rclpy").returncode != 0
    [code, _] = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), re.DOTALL)
    check = "\nassert p.getBasePositionAndOrientation(ball)[0][2] > -0.5, 'it fell through'\n"
    result = run(python, "-c", code + check)
    assert result.returncode == 0, result.stderr


def test_only_names_that_say_where_they_are_from_land_on_the_path(environment: Path) -> None:
    names, functions = entry_points(environment / "bin" / "python")
    assert names == COMMANDS
    here = {entry.value for entry in importlib.metadata.distribution("smartmesh_ros").entry_points}
    assert functions == here, "each command of a workspace"
    for command in COMMANDS - WITHOUT_ROS:
        without_ros = run(environment / "bin" / command)
        assert without_ros.returncode == 1
        assert f"{command} needs ROS 2" in without_ros.stderr
        assert "Traceback" not in without_ros.stderr
    assert "--budget" in run(environment / "bin" / "smartmesh-tune", "--help").stdout


def entry_points(python: Path) -> tuple[set[str], set[str]]:
    """Names of the commands, and the functions that they run."""
    entries = "importlib.metadata.distribution('smartmesh_ros').entry_points"
    code = f"import importlib.metadata; [print(e.name, e.value) for e in {entries}]"
    pairs = [line.split() for line in run(python, "-c", code).stdout.splitlines()]
    return {name for name, _ in pairs}, {function for _, function in pairs}
