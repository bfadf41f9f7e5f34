"""Builds smartmesh_ros.core._core, the C++ core, in place.

Bullet's headers and the few of its sources that the core needs come from the source package of PyBullet, nanobind from
its own package. Objects are kept in build/core under a digest of what they are made of, so that `colcon build` and a
build in place compile once.
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
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

ROOT = Path(__file__).resolve().parent
CORE = Path("smartmesh_ros/core")
# The classes of Bullet have the layout of this release in every PyBullet that the core accepts.
PYBULLET = "3.2.7"
# Stable ABI from Python 3.12 on, the first that nanobind can use it with.
STABLE_ABI = sys.version_info >= (3, 12)
FLAGS = [
    "-O2", "-g0", "-std=c++17", "-ffp-contract=off", "-fvisibility=hidden", "-fno-strict-aliasing",
    "-DBT_USE_DOUBLE_PRECISION", "-DBT_THREADSAFE=1", "-DNDEBUG",
]  # fmt: skip
OF_BULLET = (
    "BulletCollision/BroadphaseCollision/btCollisionAlgorithm.cpp",
    "BulletCollision/CollisionDispatch/btCollisionObject.cpp",
    "BulletCollision/CollisionDispatch/btManifoldResult.cpp",
    "BulletCollision/CollisionShapes/btCollisionShape.cpp",
    "BulletCollision/CollisionShapes/btConcaveShape.cpp",
    "BulletCollision/NarrowPhaseCollision/btPersistentManifold.cpp",
    "BulletDynamics/ConstraintSolver/btTypedConstraint.cpp",
    "BulletDynamics/Dynamics/btRigidBody.cpp",
    "LinearMath/btAlignedAllocator.cpp",
    "LinearMath/btSerializer.cpp",
    "LinearMath/btSerializer64.cpp",
    "LinearMath/btVector3.cpp",
)


def cache_folder() -> Path:
    """Folder of what is downloaded once for all builds of this user."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "smartmesh_ros"


def bullet_sources() -> Path:
    """Return the folder with Bullet's src/ and examples/, of PyBullet's source package; downloads it the first time."""
    folder = cache_folder() / f"bullet-{PYBULLET}"
    if folder.is_dir():
        return folder
    folder.parent.mkdir(parents=True, exist_ok=True)
    print(
        f"smartmesh_ros: downloading the source package of PyBullet {PYBULLET} for its headers (80 MB, once)",
        flush=True,
    )
    with tempfile.TemporaryDirectory(dir=folder.parent) as made:
        command = [sys.executable, "-m", "pip", "download", "--quiet", "--no-deps", "--no-binary", ":all:",
                   "--no-build-isolation", f"pybullet=={PYBULLET}", "--dest", made]  # fmt: skip
        done = subprocess.run(command, check=False, capture_output=True, text=True)
        archives = list(Path(made).glob("*.tar.gz"))
        if not archives:
            raise SystemExit(
                f"smartmesh_ros: Bullet's headers are missing: pip could not download pybullet=={PYBULLET} as source. "
                f"Connect once, or unpack that package's src/ and examples/ into {folder}.\n{done.stderr}"
            )
        unpacked = Path(made) / "bullet"
        with tarfile.open(archives[0]) as archive:
            for member in archive:
                inner = Path(*Path(member.name).parts[1:])
                wanted = inner.suffix == ".h" or inner.as_posix().removeprefix("src/") in OF_BULLET
                if member.isfile() and wanted and inner.parts[0] in ("src", "examples"):
                    member.name = inner.as_posix()
                    archive.extract(member, unpacked, filter="data")
        unpacked.rename(folder)
    return folder


def nanobind_folder() -> Path:
    """Return nanobind's package."""
    try:
        import nanobind
    except ImportError:
        raise SystemExit("smartmesh_ros: the core needs nanobind to build: pip install nanobind") from None
    return Path(nanobind.__file__).parent


def _sources_and_flags() -> tuple[list[Path], list[str]]:
    """Return all sources, and the flags of the compiler."""
    bullet, binding = bullet_sources(), nanobind_folder()
    flags = [*FLAGS, *(["-DPy_LIMITED_API=0x030C0000"] if STABLE_ABI else [])]
    includes = [bullet / "src", bullet, binding / "include", binding / "ext/robin_map/include"]
    flags += [f"-isystem{path}" for path in includes] + [f"-isystem{sysconfig.get_path('include')}"]
    sources = sorted((ROOT / CORE).glob("*.cpp"))
    sources += [bullet / "src" / path for path in OF_BULLET] + [binding / "src/nb_combined.cpp"]
    return sources, flags


def _digest(sources: list[Path], flags: list[str]) -> str:
    """Return a digest of what the core is made of."""
    found = hashlib.sha256("\n".join([sys.version, *flags]).encode())
    for path in sorted([*sources, *(ROOT / CORE).glob("*.h")]):
        found.update(path.read_bytes())
    return found.hexdigest()[:16]


def build(target: Path, extra: tuple[str, ...] = ()) -> None:
    """Compile the core on all cores and write the library ``target``, unless build/core has it."""
    compiler = os.environ.get("CXX", "c++")
    if shutil.which(compiler) is None:
        raise SystemExit("smartmesh_ros: no C++ compiler was found; install one (Debian: apt install g++)")
    sources, flags = _sources_and_flags()
    flags = [*flags, *extra]
    kept = ROOT / "build" / "core" / _digest(sources, flags)
    library = kept / "_core.so"
    if not library.is_file():
        kept.mkdir(parents=True, exist_ok=True)

        def compile_one(item: tuple[int, Path]) -> str:
            made = kept / f"{item[0]}_{item[1].stem}.o"
            foreign = [] if item[1].is_relative_to(ROOT / CORE) else ["-w"]
            subprocess.run([compiler, *flags, "-fPIC", *foreign, "-c", str(item[1]), "-o", str(made)], check=True)
            return str(made)

        with ThreadPoolExecutor(os.cpu_count() or 1) as pool:
            objects = list(pool.map(compile_one, enumerate(sources)))
        part = library.with_suffix(f".{os.getpid()}")
        subprocess.run([compiler, "-shared", "-o", str(part), *objects, *extra], check=True)
        part.rename(library)
        for made in objects:
            Path(made).unlink()
    target.parent.mkdir(parents=True, exist_ok=True)
    part = target.with_suffix(f".{os.getpid()}")  # a library that is loaded somewhere must not be written over
    shutil.copy2(library, part)
    part.replace(target)


def library_name() -> str:
    """Return the file name of the library for this Python."""
    return "_core" + (".abi3.so" if STABLE_ABI else sysconfig.get_config_var("EXT_SUFFIX"))


if __name__ == "__main__":  # in place, for running from a checkout
    build(ROOT / CORE / library_name())
