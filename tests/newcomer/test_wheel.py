"""Installations by pip into empty environments: what lands there, and which package named PyBullet is asked for.

Users of PyBullet without ROS install in this way. One asks for a PyBullet that has a wheel, and for none where a
PyBullet is there.
"""

import importlib.metadata
import json
import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement

from tests.newcomer.conftest import LONG, ROOT, copy_of_this

OWN = ("demo", "fleet", "fleet-front", "replay", "rover", "tune", "view")
CONSTRAINTS = ROOT / "requirements" / "constraints.txt"
NODES = ("terrain_collider", "terrain_score", "terrain_sensor", "terrain_source")
COMMANDS = {"smartmesh", *NODES, *(f"smartmesh-{name}" for name in OWN)}
FORK, UPSTREAM = "pybullet-arm64", "pybullet"
MACHINES = [("Linux", "x86_64"), ("Linux", "aarch64"), ("Darwin", "x86_64"), ("Darwin", "arm64"), ("Windows", "AMD64")]
VERSIONS = ["3.11", "3.12", "3.13", "3.14"]


def run(*command: str | Path, **settings: str) -> subprocess.CompletedProcess[str]:
    bare = {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "AMENT_PREFIX_PATH")}
    # For the environments that pip builds in as well; bytecode of all packages would take longer than the tests.
    bare |= {"PIP_CONSTRAINT": str(CONSTRAINTS), "PIP_NO_COMPILE": "1", **settings}
    # Not from here, where the sources would be imported.
    return subprocess.run(command, env=bare, cwd="/", capture_output=True, text=True, timeout=LONG, check=False)


def pip(python: Path | str, *arguments: str | Path) -> None:
    result = run(python, "-m", "pip", "--disable-pip-version-check", "--quiet", *arguments)
    if re.search("NewConnectionError|Temporary failure in name resolution", result.stderr):
        pytest.skip("packages cannot be downloaded")
    assert result.returncode == 0, result.stdout + result.stderr


def of_pybullet(requirements: list[str]) -> list[Requirement]:
    """Those of the requirements that are of PyBullet."""
    return [found for found in map(Requirement, requirements) if found.name.startswith("pybullet")]


def distribution(packages: Path) -> importlib.metadata.Distribution:
    """The installation of this package in a folder."""
    [folder] = packages.glob("smartmesh_ros-*.dist-info")
    return importlib.metadata.PathDistribution(folder)


def empty_environment(made: Path) -> Path:
    """The folder of the packages of a new virtual environment."""
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", made], check=True)
    [packages] = made.glob("lib/python*/site-packages")
    return packages


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("pip") / "source"
    copy_of_this(folder)
    return folder


@pytest.fixture(scope="module")
def packages(source: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The packages of an empty environment into which pip installed this one, and what it asks for."""
    made = tmp_path_factory.mktemp("empty") / "environment"
    found = empty_environment(made)
    # From outside: an environment with a pip of its own takes long to make.
    pip(sys.executable, "--python", made / "bin" / "python", "install", source)
    return found


@pytest.fixture(scope="module")
def for_all_machines(packages: Path) -> list[Requirement]:
    """What a package asks for that is installed into an environment without PyBullet."""
    return of_pybullet(distribution(packages).requires or [])


def for_make() -> list[Requirement]:
    """What `make` and the README's recipe for a workspace install."""
    lines = (ROOT / "requirements" / "pybullet.txt").read_text().splitlines()
    return of_pybullet([line for line in lines if line and not line.startswith("#")])


def test_the_library_is_installed_without_its_sources(packages: Path) -> None:
    library, *others = [path.name for path in (packages / "smartmesh_ros" / "core").glob("*.*") if path.suffix != ".py"]
    assert library.startswith("_core.")
    assert not others
    this = f"cp{sys.version_info.major}{sys.version_info.minor}"
    tag = "cp312-abi3-linux" if sys.version_info >= (3, 12) else f"{this}-{this}-linux"
    assert f"\nTag: {tag}" in (distribution(packages).read_text("WHEEL") or "")


def test_the_ten_lines_run_without_ros(packages: Path) -> None:
    """The ball rides the wave."""
    python = packages.parents[2] / "bin" / "python"
    assert run(python, "-c", "import rclpy").returncode != 0
    [code, _] = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), re.DOTALL)
    result = run(python, "-c", code)
    assert result.returncode == 0, result.stderr
    said = r"^height of the ball: (-?\d\.\d{3}) m\nof the ground below it: (-?\d\.\d{3}) m$"
    [(ball, ground)] = re.findall(said, result.stdout, re.MULTILINE)
    assert 0.15 < float(ball) - float(ground) < 0.4


def test_only_names_that_say_where_they_are_from_land_on_the_path(packages: Path) -> None:
    entries = distribution(packages).entry_points
    assert {entry.name for entry in entries} == COMMANDS
    here = {entry.value for entry in importlib.metadata.distribution("smartmesh_ros").entry_points}
    assert {entry.value for entry in entries} == here, "each command of a workspace"
    for command in COMMANDS:
        without_ros = run(packages.parents[2] / "bin" / command)
        assert without_ros.returncode == 1
        assert f"{command} needs ROS 2" in without_ros.stderr
        assert "Traceback" not in without_ros.stderr


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize(("system", "machine"), MACHINES)
def test_one_pybullet_is_asked_for_and_it_has_a_wheel_on_linux(
    for_all_machines: list[Requirement], version: str, system: str, machine: str
) -> None:
    there = {"platform_system": system, "platform_machine": machine, "python_version": version}
    expected = FORK if (system, machine) == ("Linux", "x86_64") and version in ("3.12", "3.13") else UPSTREAM
    for requirements in (for_all_machines, for_make()):
        [name] = [found.name for found in requirements if found.marker is not None and found.marker.evaluate(there)]
        assert name == expected


def test_versions_are_pinned_to_those_of_the_constraints_and_a_build_asks_for_none(
    for_all_machines: list[Requirement],
) -> None:
    constraints = CONSTRAINTS.read_text().splitlines()
    [fork] = [found for found in for_all_machines if found.name == FORK]
    for found in (fork, *for_make()):
        assert f"{found.name}{found.specifier}" in constraints
    requires = tomllib.loads((ROOT / "pyproject.toml").read_text())["build-system"]["requires"]
    assert not of_pybullet(requires)


@pytest.mark.parametrize("name", ["other", ""])
def test_an_environment_keeps_its_pybullet(
    source: Path, tmp_path: Path, for_all_machines: list[Requirement], name: str
) -> None:
    """One that would not be asked for here, installed by pip, which builds where the environment's packages cannot be
    imported. With "", PyBullet is there without being a package of pip's."""
    asked = [found.name for found in for_all_machines if found.marker is None or found.marker.evaluate()]
    name = name and (UPSTREAM if asked == [FORK] else FORK)
    made = tmp_path / "environment"
    packages = empty_environment(made)
    (packages / "pybullet.py").touch()
    if name:
        folder = packages / f"{name.replace('-', '_')}-3.2.9.dist-info"
        folder.mkdir()
        (folder / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 3.2.9\n")
        (folder / "top_level.txt").write_text("pybullet\n")
    asks = ["install", "--dry-run", "--no-deps", "--report", made / "report", source]
    pip(sys.executable, "--python", made / "bin" / "python", *asks)
    [item] = json.loads((made / "report").read_text())["install"]
    assert [str(found) for found in of_pybullet(item["metadata"]["requires_dist"])] == [name] * bool(name)
