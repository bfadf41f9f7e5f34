"""What is said where the C++ core cannot be built."""

import sys
from pathlib import Path

import pytest

from tests.newcomer.conftest import copy_of_this
from tests.newcomer.test_wheel import empty_environment, run


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the sources whose core is not compiled yet."""
    folder = tmp_path_factory.mktemp("core") / "source"
    copy_of_this(folder)
    (folder / "smartmesh_ros" / "core" / "new.cpp").touch()
    return folder


@pytest.mark.parametrize(
    ("settings", "words"), [({"CXX": "no_compiler"}, "apt install g++"), ({"PIP_NO_INDEX": "1"}, "Connect once")]
)
def test_what_is_missing_is_named(source: Path, settings: dict[str, str], words: str) -> None:
    """A compiler, and Bullet's headers, with nothing downloaded before."""
    result = run(sys.executable, source / "core_build.py", XDG_CACHE_HOME=str(source.parent), **settings)
    assert result.returncode == 1
    [line] = result.stderr.splitlines()
    assert words in line
    assert words != "Connect once" or str(source.parent) in line


def test_an_error_of_the_compiler_ends_the_installation(source: Path, tmp_path: Path) -> None:
    empty_environment(tmp_path / "environment")
    command = [sys.executable, "-m", "pip", "--python", tmp_path / "environment" / "bin" / "python", "install"]
    result = run(*command, "--no-deps", source, CXX="false")
    assert result.returncode == 1
    assert "CMake Error" in result.stderr
