"""Builds smartmesh_ros.core._core, the C++ core: in place when run, and for setup.py.

Bullet's headers and the few of its sources that the core needs come from the source package of PyBullet, nanobind from
its own package. Without Bullet's headers the core is built without its folder bullet. Libraries and objects are kept in
build/core under a digest of what they are made of, so that `colcon build`, pip and a build in place compile once.
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
from importlib.metadata import version
from pathlib import Path

ROOT = Path(__file__).resolve().parent
CORE = Path("smartmesh_ros/core")
# The classes of Bullet have the layout of this release in every PyBullet that the core accepts.
PYBULLET = "3.2.7"
# Stable ABI from Python 3.12 on, the first that nanobind can use it with.
STABLE_ABI = sys.version_info >= (3, 12)
FLAGS = [
    "-O3", "-fno-math-errno", "-fno-trapping-math", "-g0", "-std=c++17", "-ffp-contract=off", "-fvisibility=hidden",
    "-fno-strict-aliasing", "-DBT_USE_DOUBLE_PRECISION", "-DBT_THREADSAFE=1", "-DNDEBUG",
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


class MissingError(SystemExit):
    """What is missing to build the core, and how to install it. A script that does not catch it ends with it."""


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
        unpacked = Path(made) / "bullet"
        with tarfile.open(archives[0]) as archive:
            for member in archive:
                inner = Path(*Path(member.name).parts[1:])
                wanted = inner.suffix == ".h" or inner.as_posix().removeprefix("src/") in OF_BULLET
                if wanted and inner.parts[0] in ("src", "examples") and (content := archive.extractfile(member)):
                    (unpacked / inner).parent.mkdir(parents=True, exist_ok=True)
                    (unpacked / inner).write_bytes(content.read())
        unpacked.rename(folder)
    return folder


def nanobind_folder() -> Path:
    """Return nanobind's package."""
    try:
        import nanobind
    except ImportError:
        raise MissingError("smartmesh_ros: nanobind is missing (pip install nanobind)") from None
    return Path(nanobind.__file__).parent


def _compiler() -> str:
    """Return the compiler's command."""
    compiler = os.environ.get("CXX", "c++")
    if shutil.which(compiler) is None:
        raise MissingError("smartmesh_ros: a C++ compiler is missing (Debian: apt install g++)")
    if not Path(sysconfig.get_path("include"), "Python.h").is_file():
        raise MissingError("smartmesh_ros: Python's headers are missing (Debian: apt install python3-dev)")
    return compiler


def _digest(sources: list[Path], flags: list[str]) -> str:
    """Return a digest of sources and all headers, but not of where they lie: pip builds in folders of new names."""
    found = hashlib.sha256("\n".join([sys.version, PYBULLET, version("nanobind"), *flags]).encode())
    for path in [*sources, *sorted((ROOT / CORE).rglob("*.h"))]:
        found.update(path.read_bytes())
    return found.hexdigest()[:16]


def _compile(source: Path, command: list[str], flags: list[str], folders: list[str]) -> str:
    """Compile a source, unless that was done before; return the object."""
    own = source.is_relative_to(ROOT / CORE)
    made = ROOT / "build" / "core" / "objects" / f"{_digest([source], flags)}_{source.stem}.o"
    if not made.is_file():
        part = made.with_suffix(f".{os.getpid()}.o")
        made.parent.mkdir(parents=True, exist_ok=True)
        foreign = [] if own else ["-w"]
        subprocess.run([*command, *flags, *folders, "-fPIC", *foreign, "-c", str(source), "-o", str(part)], check=True)
        part.rename(made)
    return str(made)


def build(target: Path, extra: tuple[str, ...] = ()) -> None:
    """Write the library ``target``; compile it, with ``extra`` flags, unless build/core has it. Raises `MissingError`,
    and ``CalledProcessError`` if the compiler fails."""
    compiler, binding = _compiler(), nanobind_folder()
    sources = [*sorted((ROOT / CORE).glob("*.cpp")), binding / "src/nb_combined.cpp"]
    includes = [binding / "include", binding / "ext/robin_map/include", Path(sysconfig.get_path("include"))]
    flags = [*FLAGS, *(["-DPy_LIMITED_API=0x030C0000"] if STABLE_ABI else []), *extra]
    with_bullet: list[str] = []  # for the file that names what the folder bullet adds
    try:
        bullet = bullet_sources()
    except MissingError as missing:
        # colcon shows the standard error alone.
        print(f"{missing}. Until then bodies stand on PyBullet's own height fields", file=sys.stderr)
    else:
        sources += [*sorted((ROOT / CORE / "bullet").glob("*.cpp")), *(bullet / "src" / path for path in OF_BULLET)]
        includes += [bullet / "src", bullet]
        with_bullet = ["-DSMARTMESH_BULLET"]
    library = ROOT / "build" / "core" / _digest(sources, [*flags, *with_bullet]) / "_core.so"
    if not library.is_file():
        folders = [f"-I{ROOT / CORE}", *(f"-isystem{path}" for path in includes)]

        def compile_one(source: Path) -> str:
            return _compile(source, [compiler], flags + (with_bullet if source.name == "bindings.cpp" else []), folders)

        with ThreadPoolExecutor(os.cpu_count() or 1) as pool:
            objects = list(pool.map(compile_one, sources))
        library.parent.mkdir(parents=True, exist_ok=True)
        linked = library.with_suffix(f".{os.getpid()}")
        subprocess.run([compiler, "-shared", "-o", str(linked), *objects, *extra], check=True)
        linked.rename(library)
    target.parent.mkdir(parents=True, exist_ok=True)
    part = target.with_suffix(f".{os.getpid()}")  # a library that is loaded somewhere must not be written over
    shutil.copy2(library, part)
    part.replace(target)


def library_name() -> str:
    """Return the file name of the library for this Python."""
    return "_core" + (".abi3.so" if STABLE_ABI else sysconfig.get_config_var("EXT_SUFFIX"))


if __name__ == "__main__":  # in place, for running from a checkout
    build(ROOT / CORE / library_name())
