"""Builds smartmesh_ros.core._core, the C++ core, by CMake: in place when run, and for setup.py.

`python core_build.py --bullet` prints the folder of Bullet's headers for a build by hand, see
smartmesh_ros/core/CMakeLists.txt. Libraries are kept in build/core under a digest of what they are made of, because pip
builds in an environment of a new name each time, for which CMake would compile everything again.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import sys
import sysconfig
import tarfile
import tempfile
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

ROOT = Path(__file__).resolve().parent
CORE = Path("smartmesh_ros/core")
# The classes of Bullet have the layout of this release in every PyBullet that the core accepts.
PYBULLET = "3.2.7"
# Stable ABI from Python 3.12 on, the first that nanobind can use it with.
STABLE_ABI = sys.version_info >= (3, 12)
LIBRARY = "_core" + (".abi3.so" if STABLE_ABI else sysconfig.get_config_var("EXT_SUFFIX"))


class MissingError(SystemExit):
    """What is missing to build the core, and how to install it. A script that does not catch it ends with it."""


def bullet_sources() -> Path:
    """Return the folder with Bullet's src/ and examples/, of PyBullet's source package; downloads it the first time."""
    try:
        cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "smartmesh_ros"
        folder = cache / f"pybullet-{PYBULLET}"
        if folder.is_dir():
            return folder
        cache.mkdir(parents=True, exist_ok=True)
    except (OSError, RuntimeError) as error:  # RuntimeError: no home
        raise MissingError(
            f"smartmesh_ros: there is no folder for Bullet's headers ({error}); set XDG_CACHE_HOME to one"
        ) from None
    print(
        f"smartmesh_ros: downloading the source package of PyBullet {PYBULLET} for its headers (80 MB, once)",
        flush=True,
    )
    with tempfile.TemporaryDirectory(dir=cache) as made:
        command = [sys.executable, "-m", "pip", "download", "--quiet", "--disable-pip-version-check", "--no-deps",
                   "--no-binary", ":all:", "--no-build-isolation", f"pybullet=={PYBULLET}", "--dest", made]  # fmt: skip
        done = subprocess.run(command, check=False, capture_output=True, text=True)
        archives = list(Path(made).glob("*.tar.gz"))
        if not archives:
            _, _, reason = done.stderr.strip().rpartition("\n")
            raise MissingError(
                f"smartmesh_ros: Bullet's headers are missing: pip could not download pybullet=={PYBULLET} as source "
                f"({reason}). Connect once, or unpack that package's src/ and examples/ into {folder}"
            )
        with tarfile.open(archives[0]) as archive:
            archive.extraction_filter = getattr(tarfile, "data_filter", None)  # Python has it since 3.11.4
            sources = [item for item in archive if Path(item.name).suffix in (".h", ".cpp")]
            archive.extractall(made, members=sources)
        Path(made, sources[0].name.partition("/")[0]).rename(folder)
    return folder


def _digest(settings: tuple[str, ...]) -> str:
    """Return a digest of the sources and of what they are compiled with, but not of where they lie."""
    try:
        parts = [sys.version, PYBULLET, version("nanobind"), os.environ.get("CXX", ""), *settings]
    except PackageNotFoundError:
        raise MissingError("smartmesh_ros: nanobind is missing (pip install nanobind)") from None
    found = hashlib.sha256("\n".join(parts).encode())
    for path in sorted((ROOT / CORE).rglob("*")):
        if path.suffix in (".cpp", ".h", ".txt"):
            found.update(path.relative_to(ROOT).as_posix().encode() + path.read_bytes())
    return found.hexdigest()[:16]


def configured(*settings: str) -> Path:
    """Return CMake's folder for this Python and ``settings``, configured. Raises `MissingError`, and
    ``CalledProcessError`` if CMake fails."""
    for tool, package in ((os.environ.get("CXX", "c++"), "g++"), ("cmake", "cmake")):
        if shutil.which(tool) is None:
            raise MissingError(f"smartmesh_ros: {tool} is missing (Debian: apt install {package})")
    if not Path(sysconfig.get_path("include"), "Python.h").is_file():
        raise MissingError("smartmesh_ros: Python's headers are missing (Debian: apt install python3-dev)")
    name = hashlib.sha256("\n".join((sys.prefix, sys.executable, *settings)).encode()).hexdigest()[:8]
    folder = ROOT / "build" / f"core-{name}"
    generator = ["-G", "Ninja"] if shutil.which("ninja") else []
    command = ["cmake", *generator, "-S", ROOT / CORE, "-B", folder, f"-DBULLET_SOURCES={bullet_sources()}",
               f"-DPython_EXECUTABLE={sys.executable}", *settings]  # fmt: skip
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    return folder


def build(target: Path = ROOT / CORE / LIBRARY, *settings: str) -> Path:
    """Write the library ``target``, in place for running from a checkout, and return it; build it, with ``settings``
    for CMake, unless build/core has it. Raises as `configured`."""
    library = ROOT / "build" / "core" / _digest(settings) / "_core.so"
    if not library.is_file():
        folder = configured(*settings)
        command = ["cmake", "--build", folder, "--parallel", str(os.cpu_count() or 1)]
        subprocess.run(command, check=True, stdout=sys.stderr)
        library.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(folder / LIBRARY, library)
    target.parent.mkdir(parents=True, exist_ok=True)
    part = target.with_suffix(f".{os.getpid()}")  # a library that is loaded somewhere must not be written over
    shutil.copy2(library, part)
    part.replace(target)
    return target


if __name__ == "__main__":
    if sys.argv[1:] == ["--bullet"]:
        print(bullet_sources())
    else:
        build()
