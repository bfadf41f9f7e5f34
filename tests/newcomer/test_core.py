"""What is said where the C++ core cannot be built."""

import subprocess
import sys
import tarfile
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

import core_build
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
    ("settings", "words"),
    [
        ({"CXX": "no_compiler"}, "apt install g++"), ({"PIP_NO_INDEX": "1"}, "Connect once"),
        ({"XDG_CACHE_HOME": "/proc/nowhere"}, "set XDG_CACHE_HOME"),
    ],
)  # fmt: skip
def test_what_is_missing_is_named(source: Path, settings: dict[str, str], words: str) -> None:
    """A compiler, and Bullet's headers, with nothing downloaded before."""
    result = run(sys.executable, source / "core_build.py", **{"XDG_CACHE_HOME": str(source.parent), **settings})
    assert result.returncode == 1
    [line] = result.stderr.splitlines()
    assert words in line
    assert words != "Connect once" or str(source.parent) in line


def test_headers_are_unpacked_by_a_python_without_filters(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As is Debian 12's, 3.11.2."""
    header = tmp_path / "b.h"
    header.touch()

    def download(command: list[str], **_: Any) -> Any:
        with tarfile.open(Path(command[-1], "pybullet.tar.gz"), "w:gz") as archive:
            archive.add(header, "pybullet/src/b.h")
        return SimpleNamespace(stderr="")

    def extractall(archive: tarfile.TarFile, path: str, members: list[tarfile.TarInfo]) -> None:
        for member in members:
            archive.extract(member, path)

    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(subprocess, "run", download)
    monkeypatch.setattr(tarfile.TarFile, "extractall", extractall)
    monkeypatch.delattr(tarfile, "data_filter", raising=False)
    assert (core_build.bullet_sources() / "src" / "b.h").is_file()


def test_an_error_of_the_compiler_ends_the_installation(source: Path, tmp_path: Path) -> None:
    empty_environment(tmp_path / "environment")
    command = [sys.executable, "-m", "pip", "--python", tmp_path / "environment" / "bin" / "python", "install"]
    result = run(*command, "--no-deps", source, CXX="false")
    assert result.returncode == 1
    assert "CMake Error" in result.stderr
