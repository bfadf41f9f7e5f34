"""Folder of machine code that persists between runs and never is older than its sources.

Numba's own cache detects a change of a compiled function, but not of a function it calls. Here the folder's name
contains a digest of all compiled sources and their imports, and the versions of Python, NumPy, Numba and the kind of
processor. The folder lies in the package if that is writable, else in the user's cache. ``make``, ``colcon build`` and
the wheel fill it. The folder is complete when it contains the file `COMPLETE`. This module imports neither Numba nor
NumPy, so that a node can report at once that it has to compile.
"""

from __future__ import annotations

import hashlib
import logging
import os
import platform
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from math import ceil
from pathlib import Path

if sys.platform != "win32":
    import fcntl

PACKAGE = Path(__file__).resolve().parent
# Folder inside the package. Version control ignores it.
FOLDER_NAME = "_machine_code"
COMPLETE = "complete"
# Environment variable with a folder that replaces all others. Use one folder for each installation.
FOLDER_VARIABLE = "SMARTMESH_MACHINE_CODE"
# Time to compile everything in one process on an idle machine, and time to start and end the processes [s].
COMPILE_TIME, START_TIME = 85.0, 3.0
# How many times as long a slow or busy machine takes.
SLOWEST = 6
# Maximum number of processes. More gain nothing, because the longest call chain takes a third of the time.
MAX_PROCESSES = 4

_IMPORT = re.compile(rb"^[ \t]*from smartmesh_ros([.\w]*) import (\([^)]*\)|[^\n]*)", re.MULTILINE)
_NAME = re.compile(rb"\w+")
log = logging.getLogger("smartmesh_ros")
_logged: set[str] = set()


class NotCompiledError(Exception):
    """The reason why functions could not be compiled in advance."""


def digest_of(package: Path) -> str:
    """Return a short hash of the sources in a folder that machine code depends on; takes milliseconds."""
    contents = _contents(package)
    digest = hashlib.sha256()
    for name in sorted(_compiled_from(contents)):
        digest.update(name.encode() + b"\0" + hashlib.sha256(contents[name]).digest())
    return digest.hexdigest()[:16]


def _contents(package: Path) -> dict[str, bytes]:
    """Return the content of the Python files below a folder, by relative path."""
    contents = {}
    for folder, _, files in os.walk(package):
        for name in files:
            if name.endswith(".py"):
                path = os.path.join(folder, name)  # noqa: PTH118  # making a Path takes as long as reading the file
                with open(path, "rb") as file:  # noqa: PTH123
                    contents[os.path.relpath(path, package)] = file.read()
    return contents


def _compiled_from(contents: dict[str, bytes]) -> set[str]:
    """Return the files with compiled functions, the warm-up that selects them, and all files these import."""
    wanted = {name for name, content in contents.items() if b"\n@compiled\n" in content or name == "warm_up.py"}
    taken: set[str] = set()
    while wanted:
        taken.add(name := wanted.pop())
        for module, imported in _IMPORT.findall(contents[name]):
            path = module.decode().strip(".").replace(".", "/")
            below = [f"{path}/{found.decode()}.py".strip("/") for found in _NAME.findall(imported)]
            wanted |= ({f"{path}.py", f"{path}/__init__.py", *below} & contents.keys()) - taken
    return taken


@cache
def digest_of_all(folder: Path) -> str:
    """Return a short hash of all sources in a folder, for compiled functions outside this package."""
    contents = _contents(folder)
    return hashlib.sha256(b"".join(name.encode() + contents[name] for name in sorted(contents))).hexdigest()[:16]


DIGEST = digest_of(PACKAGE)  # of the sources at the time of the import


@cache
def platform_tag() -> str:
    """Return the versions and platform that machine code depends on beside its sources, as part of a file name."""
    python = f"py{sys.version_info.major}.{sys.version_info.minor}{getattr(sys, 'abiflags', '')}"
    numpy = ".".join(_version_of("numpy").split(".")[:2])
    return f"{python}-numba{_version_of('numba')}-numpy{numpy}-{sys.platform}-{platform.machine()}"


def _version_of(distribution: str) -> str:
    try:
        return version(distribution)
    except PackageNotFoundError:
        return "none"


def name() -> str:
    """Return the name of the folder with the machine code of this process."""
    return f"{DIGEST}-{platform_tag()}"


def parent_folders() -> list[Path]:
    """Return the folders that may contain machine code folders (of any sources and versions), preferred first."""
    if chosen := os.environ.get(FOLDER_VARIABLE):
        return [Path(chosen)]
    place = hashlib.sha256(str(PACKAGE).encode()).hexdigest()[:8]
    user = os.environ.get("NUMBA_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME") or Path("~/.cache").expanduser()
    return [PACKAGE / FOLDER_NAME, Path(user) / "smartmesh_ros" / place]


def complete() -> Path | None:
    """Return the folder with the machine code of all functions, None if it does not exist yet."""
    return next((parent / name() for parent in parent_folders() if (parent / name() / COMPLETE).exists()), None)


@cache
def _writable(parents: tuple[Path, ...], name: str) -> Path | None:
    for parent in parents:
        try:
            (parent / name).mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=parent / name):
                return parent / name
        except OSError:
            continue
    return None


def writable() -> Path | None:
    """Return the first writable folder for machine code, created if missing; None if no folder is writable."""
    return _writable(tuple(parent_folders()), name())


def folder() -> Path | None:
    """Return the folder to load machine code from and to write it to, None if there is none."""
    return complete() or writable()


def sources_changed() -> bool:
    """Return True if the sources have changed since this process imported them."""
    return digest_of(PACKAGE) != DIGEST


def remove_old(parent: Path, digest: str = DIGEST) -> None:
    """Remove machine code whose sources have another ``digest``."""
    for found in parent.iterdir() if parent.is_dir() else ():
        if found.is_dir() and not found.name.startswith(f"{digest}-"):
            shutil.rmtree(found, ignore_errors=True)


def processes() -> int:
    """Return the number of processes that compile in parallel."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return min(cores, MAX_PROCESSES)


def log_once(message: str) -> None:
    """Log a warning once in a process; it goes to the standard error if logging is not configured."""
    if message not in _logged:
        _logged.add(message)
        log.warning("smartmesh_ros: %s", message)


def announce() -> None:
    """Log that this process will compile, or wait for another process that does, with the expected time."""
    if _obstacle() or complete() or (place := writable()) is None:
        return
    found = [path for parent in parent_folders() for path in parent.glob(f"{DIGEST}-*/{COMPLETE}")]
    others = {path.parent.name.partition("-")[2] for path in found}
    reason = f"; existing machine code is for {', '.join(sorted(others))}, not {platform_tag()}" if others else ""
    log_once(
        f"compiling once, {_minutes(processes())} on {processes()} cores{reason}; later starts load it from "
        f"{place.parent}"
    )


def _minutes(cores: int) -> str:
    """Return the expected time for compiling, from that of an idle machine to that of a slow one."""
    time = START_TIME + COMPILE_TIME / cores
    return f"{max(1, round(time / 60))} to {ceil(SLOWEST * time / 60)} minutes"


def prepare() -> Path | None:
    """Compile all functions as `compile_all` does; return the folder, or None and log the reason if one is needed."""
    try:
        return None if _obstacle() else compile_all()
    except NotCompiledError as reason:
        log_once(str(reason))
        return None


def compile_all(*, progress: bool = False) -> Path:
    """Compile all functions in separate processes if needed; return the folder. Raises `NotCompiledError`.

    Other processes that need the same code wait for a file lock, which the operating system releases when the
    compiling process ends.
    """
    if reason := _obstacle():
        raise NotCompiledError(reason)
    if (place := complete()) is not None:
        return place
    if find_spec("pybullet") is None:
        raise NotCompiledError("PyBullet is not installed, which compiling in advance needs")
    if (place := writable()) is None:
        tried = ", ".join(map(str, parent_folders()))
        raise NotCompiledError(
            f"no folder for machine code is writable (tried {tried}): every start compiles for {_minutes(1)}; "
            f"set {FOLDER_VARIABLE} to a writable folder"
        )
    announce()
    with _locked(place) as lock:
        if not complete():
            _compile(place, lock, progress)
    return place


def _compile(place: Path, lock: int, progress: bool) -> None:
    """Run `smartmesh_ros.compiling` in a process that inherits the lock, in case this process is killed."""
    # The script removes the working directory from the import path, where Python would search first.
    script = "import sys; sys.path[:] = [sys.argv.pop(1), *filter(None, sys.path)]; "
    script += "from smartmesh_ros.compiling import fill; fill()"
    arguments = [str(PACKAGE.parent), str(place), DIGEST, str(os.getpid()), *["progress"] * progress]
    command, fds, problem = [sys.executable, "-c", script, *arguments], [lock] if lock >= 0 else [], ""
    try:
        done = subprocess.run(command, env=_environment(), pass_fds=fds, stderr=subprocess.PIPE, text=True, check=False)
        sys.stderr.write(done.stderr)
        if code := done.returncode:
            last = done.stderr.rstrip().rpartition("\n")[2]
            problem = f"ended by signal {-code}" if code < 0 else f"ended with {code}: {last}"
    except OSError as error:
        problem = str(error)
    if problem:
        raise NotCompiledError(f"compiling in advance failed ({problem}): functions are compiled at their first call")


def _environment() -> dict[str, str]:
    """Return this environment without Numba's settings and with a generic processor as the target.

    Generic code is as fast here as code for this processor, and runs on other machines of the same kind.
    """
    kept = {name: value for name, value in os.environ.items() if not name.startswith("NUMBA_")}
    return {**kept, "NUMBA_CPU_NAME": "generic", "OPENBLAS_NUM_THREADS": "1"}


def _obstacle() -> str:
    """Return why functions are not compiled at all, or not in separate processes; empty if they are."""
    if os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0"):
        return "the environment variable NUMBA_DISABLE_JIT is set"
    if not hasattr(os, "fork"):
        return f"processes cannot be forked on {sys.platform}"
    return "Numba is not installed" if _version_of("numba") == "none" else ""


def wait_for(lock: int, message: str = "") -> None:
    """Lock an open file for this process; log a ``message`` if another process holds the lock.

    Does nothing if the file system has no locks. Processes then compile the same code twice, which is harmless.
    """
    if sys.platform == "win32":
        return
    with suppress(OSError):
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            if message:
                log_once(message)
            fcntl.flock(lock, fcntl.LOCK_EX)


@contextmanager
def _locked(place: Path) -> Iterator[int]:
    """Hold the lock beside a folder; yield its file descriptor, -1 if the lock file cannot be opened."""
    try:
        lock = os.open(place.parent / "lock", os.O_RDWR | os.O_CREAT, 0o666)
    except OSError:
        yield -1
        return
    try:
        wait_for(lock, "another process compiles the same functions; waiting for it")
        yield lock
    finally:
        os.close(lock)
