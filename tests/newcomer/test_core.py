"""The C++ core in an installation, and what is said where it cannot be built."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.newcomer.conftest import copy_of_this
from tests.newcomer.test_pybullet import empty_environment, tag_of
from tests.newcomer.test_wheel import install, run

DROP = """
import numpy as np
import pybullet as p
from smartmesh_ros import Ground, HeightMap

p.connect(p.DIRECT)
p.setGravity(0, 0, -9.81)
ball = p.createMultiBody(1.0, p.createCollisionShape(p.GEOM_SPHERE, radius=0.2), basePosition=[0, 0, 0.5])
ground = Ground(p, HeightMap(np.zeros((21, 21)), resolution=0.1, origin=(-1, -1)))
ground.attach(ball)
for step in range(480):
    ground.step(time=step / 240, dt=1 / 240)
assert ground.exact, ground.no_proxies
height, speed = p.getBasePositionAndOrientation(ball)[0][2], np.linalg.norm(p.getBaseVelocity(ball)[0])
assert abs(height - 0.2) < 1e-4 and speed < 1e-6, (height, speed)
"""


@pytest.fixture(scope="module")
def packages(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The packages of an environment into which pip installed this one."""
    folder = tmp_path_factory.mktemp("core")
    copy_of_this(folder / "source")
    found = empty_environment(folder / "environment")
    install(folder / "environment", "--no-deps", folder / "source")
    return found


def test_the_library_is_installed_without_its_sources(packages: Path) -> None:
    library, *others = [path.name for path in (packages / "smartmesh_ros" / "core").glob("*.*") if path.suffix != ".py"]
    assert library.startswith("_core.")
    assert not others
    this = f"cp{sys.version_info.major}{sys.version_info.minor}"
    assert tag_of(packages).startswith("cp312-abi3-linux" if sys.version_info >= (3, 12) else f"{this}-{this}-linux")


def test_a_ball_rests_on_the_map_of_an_installed_package(packages: Path) -> None:
    dependencies = "\n".join(path for path in sys.path if path.endswith("-packages"))
    (packages / "those_of_this_test.pth").write_text(dependencies)
    result = run(packages.parents[2] / "bin" / "python", "-c", DROP)
    assert result.returncode == 0, result.stderr


def build(folder: Path, **settings: str) -> subprocess.CompletedProcess[str]:
    """Build the core of a copy of the sources, with nothing downloaded before."""
    copy_of_this(folder)
    return run(sys.executable, folder / "core_build.py", XDG_CACHE_HOME=str(folder.parent), **settings)


def test_a_compiler_that_is_missing_is_named(tmp_path: Path) -> None:
    result = build(tmp_path / "source", CXX="no_compiler")
    assert result.returncode == 1
    [line] = result.stderr.splitlines()
    assert "apt install g++" in line


def test_without_bullets_headers_bodies_stand_on_height_fields(tmp_path: Path) -> None:
    result = build(tmp_path / "source", PIP_NO_INDEX="1")
    assert result.returncode == 0, result.stderr
    [line] = result.stderr.splitlines()
    assert "Connect once" in line
    code = DROP.replace("assert ground.exact, ground.no_proxies", "print(ground.no_proxies)").replace("1e-4", "1e-2")
    done = run(sys.executable, "-c", f"import sys; sys.path.insert(0, {str(tmp_path / 'source')!r})\n{code}")
    assert done.returncode == 0, done.stderr
    assert "the core is built without Bullet's headers" in done.stdout


def test_an_error_of_the_compiler_ends_the_installation(tmp_path: Path) -> None:
    copy_of_this(tmp_path / "source")
    with (tmp_path / "source" / "smartmesh_ros" / "core" / "motion.cpp").open("a") as file:
        file.write("// is not compiled yet\n")
    empty_environment(tmp_path / "environment")
    command = [sys.executable, "-m", "pip", "--python", tmp_path / "environment" / "bin" / "python", "install"]
    result = run(*command, "--no-deps", tmp_path / "source", CXX="false")
    assert result.returncode == 1
    assert "Command '['false'" in result.stderr
