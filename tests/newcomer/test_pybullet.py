"""Which package named PyBullet an installation asks for: one with a wheel, and none where a PyBullet is there."""

import subprocess
import sys
import tomllib
from email.parser import Parser
from pathlib import Path

import pytest
from packaging.requirements import Requirement

from tests.newcomer.conftest import ROOT, copy_of_this
from tests.newcomer.test_wheel import install

FORK, UPSTREAM = "pybullet-arm64", "pybullet"
MACHINES = [("Linux", "x86_64"), ("Linux", "aarch64"), ("Darwin", "x86_64"), ("Darwin", "arm64"), ("Windows", "AMD64")]
VERSIONS = ["3.10", "3.11", "3.12", "3.13", "3.14"]


def of_pybullet(requirements: list[str]) -> list[Requirement]:
    """Those of the requirements that are of PyBullet."""
    return [found for found in map(Requirement, requirements) if found.name.startswith("pybullet")]


def metadata_of(folder: Path) -> list[str]:
    """The requirements of the installation of this package in a folder."""
    [file] = folder.rglob("smartmesh_ros-*.dist-info/METADATA")
    return Parser().parsestr(file.read_text()).get_all("Requires-Dist", [])


def tag_of(packages: Path) -> str:
    """For which Python and machine the wheel was that was installed into a folder."""
    [file] = packages.glob("smartmesh_ros-*.dist-info/WHEEL")
    return Parser().parsestr(file.read_text())["Tag"]


def empty_environment(made: Path) -> Path:
    """The folder of the packages of a new virtual environment."""
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", made], check=True)
    [packages] = made.glob("lib/python*/site-packages")
    return packages


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("pybullet") / "source"
    copy_of_this(folder)
    return folder


@pytest.fixture(scope="module")
def for_all_machines(source: Path, tmp_path_factory: pytest.TempPathFactory) -> list[Requirement]:
    """What a package asks for that is installed into an environment without PyBullet."""
    made = tmp_path_factory.mktemp("bare") / "environment"
    packages = empty_environment(made)
    install(made, "--no-deps", source)
    return of_pybullet(metadata_of(packages))


@pytest.fixture(scope="module")
def for_make() -> list[Requirement]:
    """What `make` and the README's recipe for a workspace install."""
    lines = (ROOT / "requirements" / "pybullet.txt").read_text().splitlines()
    return of_pybullet([line for line in lines if line and not line.startswith("#")])


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize(("system", "machine"), MACHINES)
def test_one_pybullet_is_asked_for_and_it_has_a_wheel_on_linux(
    for_all_machines: list[Requirement], for_make: list[Requirement], version: str, system: str, machine: str
) -> None:
    there = {"platform_system": system, "platform_machine": machine, "python_version": version}
    expected = FORK if (system, machine) == ("Linux", "x86_64") and version in ("3.12", "3.13") else UPSTREAM
    for requirements in (for_all_machines, for_make):
        [name] = [found.name for found in requirements if found.marker is not None and found.marker.evaluate(there)]
        assert name == expected


def test_versions_are_pinned_to_those_of_the_constraints(
    for_all_machines: list[Requirement], for_make: list[Requirement]
) -> None:
    constraints = (ROOT / "requirements" / "constraints.txt").read_text().splitlines()
    for found in for_make:
        assert f"{found.name}{found.specifier}" in constraints
    [fork] = [found for found in for_all_machines if found.name == FORK]
    assert f"{FORK}{fork.specifier}" in constraints


def test_a_build_installs_no_pybullet_for_itself() -> None:
    requires = tomllib.loads((ROOT / "pyproject.toml").read_text())["build-system"]["requires"]
    assert not of_pybullet(requires)


@pytest.mark.parametrize("name", [UPSTREAM, FORK, ""])
def test_an_environment_keeps_its_pybullet(source: Path, tmp_path: Path, name: str) -> None:
    """Installed by pip, which builds where the environment's packages cannot be imported. With "", PyBullet is there
    without being a package of pip's."""
    made = tmp_path / "environment"
    packages = empty_environment(made)
    (packages / "pybullet.py").touch()
    if name:
        folder = packages / f"{name.replace('-', '_')}-3.2.9.dist-info"
        folder.mkdir()
        (folder / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 3.2.9\n")
        (folder / "top_level.txt").write_text("pybullet\n")
    install(made, "--no-deps", source)
    found = of_pybullet(metadata_of(packages))
    assert [str(item) for item in found] == [name] * bool(name)
