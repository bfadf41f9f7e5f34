"""Where machine code is kept between runs, so that it is there when it is needed and never older than its sources.

Numba's own cache notices that a compiled function changed, but not that a function which it calls did. Here the folder
is named by a digest of all sources that are compiled, with all that they import, and by what else the code depends on:
Python, NumPy, Numba and the kind of processor. The folder stands in the package where that can be written to, else in
the user's cache. ``make``, ``colcon build`` and the wheel fill it. It counts as complete once the file `COMPLETE` is in
it. This module needs neither Numba nor NumPy, so that a node can say within a moment that it has to compile.
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
from pathlib import Path

if sys.platform != "win32":
    import fcntl

PACKAGE = Path(__file__).resolve().parent
# Below the package; what version control and newcomers' copies leave out.
HOME = "_machine_code"
COMPLETE = "complete"
# Names a folder that takes the place of all others. It should belong to one installation only.
CHOSEN = "SMARTMESH_MACHINE_CODE"
# Time to compile everything in one process of an idle machine, and to start and end the processes [s].
WORK, OVERHEAD = 24.0, 3.0
# The longest chain of functions that call each other takes a third of the work: more processes gain nothing.
MOST_PROCESSES = 4

_IMPORT = re.compile(rb"^[ \t]*from smartmesh_ros([.\w]*) import (\([^)]*\)|[^\n]*)", re.MULTILINE)
_NAME = re.compile(rb"\w+")
log = logging.getLogger("smartmesh_ros")
_said: set[str] = set()


def digest_of(package: Path) -> str:
    """A short hash of all sources in a folder that machine code depends on; takes milliseconds."""
    contents = _contents(package)
    digest = hashlib.sha256()
    for name in sorted(_compiled_from(contents)):
        digest.update(name.encode() + b"\0" + hashlib.sha256(contents[name]).digest())
    return digest.hexdigest()[:16]


def _contents(package: Path) -> dict[str, bytes]:
    """The Python files below a folder, by their path in it."""
    contents = {}
    for folder, _, files in os.walk(package):
        for name in files:
            if name.endswith(".py"):
                path = os.path.join(folder, name)  # noqa: PTH118  # a Path for each file takes as long as to read it
                with open(path, "rb") as file:  # noqa: PTH123
                    contents[os.path.relpath(path, package)] = file.read()
    return contents


def _compiled_from(contents: dict[str, bytes]) -> set[str]:
    """Files with compiled functions, the one that tells which are compiled beforehand, and all that those import."""
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
    """A short hash of all sources in a folder, for compiled functions that are not of this package."""
    contents = _contents(folder)
    return hashlib.sha256(b"".join(name.encode() + contents[name] for name in sorted(contents))).hexdigest()[:16]


DIGEST = digest_of(PACKAGE)  # of the sources that this process imports


@cache
def made_by() -> str:
    """What machine code depends on beside its sources, as a name."""
    python = f"py{sys.version_info.major}.{sys.version_info.minor}{getattr(sys, 'abiflags', '')}"
    numpy = ".".join(_version_of("numpy").split(".")[:2])
    return f"{python}-numba{_version_of('numba')}-numpy{numpy}-{sys.platform}-{platform.machine()}"


def _version_of(distribution: str) -> str:
    try:
        return version(distribution)
    except PackageNotFoundError:
        return "none"


def name() -> str:
    """The name of the folder with the machine code of this process."""
    return f"{DIGEST}-{made_by()}"


def homes() -> list[Path]:
    """Folders that may hold machine code of several sources and versions, the preferred one first."""
    if chosen := os.environ.get(CHOSEN):
        return [Path(chosen)]
    place = hashlib.sha256(str(PACKAGE).encode()).hexdigest()[:8]
    user = os.environ.get("NUMBA_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME") or Path("~/.cache").expanduser()
    return [PACKAGE / HOME, Path(user) / "smartmesh_ros" / place]


def complete() -> Path | None:
    """The folder that holds the machine code of all functions, None where there is none yet."""
    return next((home / name() for home in homes() if (home / name() / COMPLETE).exists()), None)


@cache
def _writable(homes: tuple[Path, ...], name: str) -> Path | None:
    for home in homes:
        try:
            (home / name).mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=home / name):
                return home / name
        except OSError:
            continue
    return None


def writable() -> Path | None:
    """The first folder that machine code can be written to, made if need be; None if there is none."""
    return _writable(tuple(homes()), name())


def folder() -> Path | None:
    """The folder to load machine code from, and to add it to."""
    return complete() or writable()


def sources_changed() -> bool:
    """Return True if the sources are others than those that this process imported."""
    return digest_of(PACKAGE) != DIGEST


def remove_old(home: Path, digest: str = DIGEST) -> None:
    """Removes machine code of other sources than those of a ``digest``."""
    for found in home.iterdir() if home.is_dir() else ():
        if found.is_dir() and not found.name.startswith(f"{digest}-"):
            shutil.rmtree(found, ignore_errors=True)


def processes() -> int:
    """How many processes compile side by side."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return min(cores, MOST_PROCESSES)


def say_once(message: str) -> None:
    """Logs a line, once in a process. Without any set-up of logging it goes to the standard error."""
    if message not in _said:
        _said.add(message)
        log.warning("smartmesh_ros: %s", message)


def announce() -> None:
    """Says that this process will have to compile or to wait for another that does, and for how long."""
    if not _wanted() or complete():
        return
    if (place := writable()) is None:
        tried = ", ".join(map(str, homes()))
        say_once(
            f"machine code can be kept in none of {tried}: every start compiles for about {WORK:.0f} s; "
            f"name a folder in {CHOSEN}"
        )
        return
    others = {path.parent.name.partition("-")[2] for home in homes() for path in home.glob(f"{DIGEST}-*/{COMPLETE}")}
    reason = f"; there is machine code for {', '.join(sorted(others))} and this is {made_by()}" if others else ""
    say_once(
        f"compiling once, about {OVERHEAD + WORK / processes():.0f} s on {processes()} cores{reason}; "
        f"later starts load it from {place.parent}"
    )


def prepare(*, progress: bool = False) -> Path | None:
    """Has everything compiled, in processes of their own, unless it is; returns the folder, None if nothing is kept.

    Processes that need the same code wait for the one that compiles: for a lock of the operating system, which ends
    with the process that holds it.
    """
    if not _wanted():
        return None
    if (place := complete()) is not None:
        return place
    announce()
    if (place := writable()) is None:
        return None
    with _locked(place) as lock:
        if not complete():
            _compile(place, lock, progress)
    return complete()


def _compile(place: Path, lock: int, progress: bool) -> None:
    """Runs `smartmesh_ros.compiling` in a process that also holds the lock, should this one be killed."""
    # Nothing is imported from the working directory, which Python would look into first.
    script = "import sys; sys.path[:] = [sys.argv.pop(1), *filter(None, sys.path)]; "
    script += "from smartmesh_ros.compiling import fill; fill()"
    command = [sys.executable, "-c", script, str(PACKAGE.parent), str(place), DIGEST]
    command += ["progress"] if progress else []
    try:
        done = subprocess.run(command, env=_environment(), pass_fds=[lock] if lock >= 0 else [], check=False)
        problem = f"ended with {done.returncode}" if done.returncode else ""
    except OSError as error:
        problem = str(error)
    if problem:
        say_once(f"could not compile beforehand ({problem}): functions are compiled when they are first called")


def _environment() -> dict[str, str]:
    """This environment without settings of Numba's, for a processor of the kind rather than this one: such code runs as
    fast here, and runs on other machines."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith("NUMBA_")}
    return {**kept, "NUMBA_CPU_NAME": "generic", "OPENBLAS_NUM_THREADS": "1"}


def _wanted() -> bool:
    """Whether functions are compiled at all, and processes can be made that do it side by side."""
    enabled = os.environ.get("NUMBA_DISABLE_JIT", "0") in ("", "0")
    return enabled and hasattr(os, "fork") and _version_of("numba") != "none"


def wait_for(lock: int, message: str = "") -> None:
    """Locks an open file for this process, saying a ``message`` if another has it now.

    Does nothing where the file system knows no locks: what is compiled twice is the same.
    """
    if sys.platform == "win32":
        return
    with suppress(OSError):
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            if message:
                say_once(message)
            fcntl.flock(lock, fcntl.LOCK_EX)


@contextmanager
def _locked(place: Path) -> Iterator[int]:
    """Holds the lock of a folder's home; yields its file descriptor, -1 where the file system knows no locks."""
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
