"""What is said where the C++ core cannot be built."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.newcomer.conftest import copy_of_this
from tests.newcomer.test_wheel import empty_environment, run


@pytest.fixture
def source(tmp_path: Path) -> Path:
    """A copy of the sources whose core is not compiled yet."""
    copy_of_this(tmp_path / "source")
    with (tmp_path / "source" / "smartmesh_ros" / "core" / "motion.cpp").open("a") as file:
        file.write("// is not compiled yet\n")
    return tmp_path / "source"


def build(source: Path, **settings: str) -> subprocess.CompletedProcess[str]:
    """Build a core, with nothing downloaded before."""
    return run(sys.executable, source / "core_build.py", XDG_CACHE_HOME=str(source.parent), **settings)


def test_a_compiler_that_is_missing_is_named(source: Path) -> None:
    result = build(source, CXX="no_compiler")
    assert result.returncode == 1
    [line] = result.stderr.splitlines()
    assert "apt install g++" in line


def test_without_bullets_headers_it_is_said_where_they_belong(source: Path) -> None:
    result = build(source, PIP_NO_INDEX="1")
    assert result.returncode == 1
    [line] = result.stderr.splitlines()
    assert "Connect once" in line and str(source.parent) in line


def test_an_error_of_the_compiler_ends_the_installation(source: Path, tmp_path: Path) -> None:
    empty_environment(tmp_path / "environment")
    command = [sys.executable, "-m", "pip", "--python", tmp_path / "environment" / "bin" / "python", "install"]
    result = run(*command, "--no-deps", source, CXX="false")
    assert result.returncode == 1
    assert "CMake Error" in result.stderr
