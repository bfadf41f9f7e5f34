"""What is said where the C++ core cannot be built."""

import subprocess
import sys
from pathlib import Path

from tests.newcomer.conftest import copy_of_this
from tests.newcomer.test_wheel import DROP, empty_environment, run


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
