"""Entry points of the executables, and their standard output: without what PyBullet's C++ code prints there, and with a
quiet end when nobody reads it."""

from __future__ import annotations

import errno
import importlib
import os
import select
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from importlib.util import find_spec
from io import TextIOWrapper
from pathlib import Path

# If set to 1, ROS logs to standard output, which is then not silenced.
LOGS_TO_STDOUT = "RCUTILS_LOGGING_USE_STDOUT"
STDOUT, STDERR = 1, 2
# Exit code of a command that a signal ends before it has done its work.
INTERRUPTED = 130


def executable(name: str, package: str = "smartmesh_ros", hint: str = "build and source the workspace") -> Path:
    """Return the path of an installed executable, looked up in the ament index like ``ros2 run``. Raises
    `FileNotFoundError` with the remedy ``hint``."""
    from ament_index_python.packages import PackageNotFoundError, get_package_prefix  # commands start without it

    with suppress(PackageNotFoundError):
        path = Path(get_package_prefix(package)) / "lib" / package / name
        if path.is_file():
            return path
    raise FileNotFoundError(f"package {package} has no executable {name}; {hint}")


def prepare_streams() -> None:
    """Open those standard streams that the parent closed, and print characters that the encoding lacks as escapes."""
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            setattr(sys, name, Path(os.devnull).open(mode))  # noqa: SIM115  # has the lowest free number: the stream's
    if isinstance(sys.stdout, TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")


def silence_pybullet() -> None:
    """Discard what C++ code prints to standard output; Python still prints there. Then import PyBullet quietly. Call
    this before the first import of PyBullet, which prints its build time to standard error."""
    if os.environ.get(LOGS_TO_STDOUT, "0") != "1":
        sys.stdout.flush()
        sys.stdout = os.fdopen(os.dup(STDOUT), "w", buffering=1, errors="backslashreplace")
        with Path(os.devnull).open("w") as nowhere:
            os.dup2(nowhere.fileno(), STDOUT)
    import_pybullet_quietly()


def import_pybullet_quietly() -> None:
    """Import PyBullet with standard error discarded, because the import prints its build time. Standard output stays
    usable for child processes."""
    sys.stderr.flush()
    kept = os.dup(STDERR)
    try:
        with Path(os.devnull).open("w") as nowhere:
            os.dup2(nowhere.fileno(), STDERR)
        import pybullet  # noqa: F401
    finally:
        os.dup2(kept, STDERR)
        os.close(kept)


@contextmanager
def ending_with_reader() -> Iterator[None]:
    """End the process without an error if the reader of its standard output ends, as in ``command --help | head``, and
    with the reason and exit code 1 if a disk is full."""
    try:
        try:
            yield
        finally:
            sys.stdout.flush()
    except OSError as error:
        full = error.errno == errno.ENOSPC
        if not full and not (isinstance(error, BrokenPipeError) and _reader_has_ended()):
            raise
        with Path(os.devnull).open("w") as nowhere:
            os.dup2(nowhere.fileno(), sys.stdout.fileno())  # Python flushes once more when it exits
        sys.exit(f"{Path(sys.argv[0]).name}: the output cannot be written: {error.strerror}" if full else 0)


def _reader_has_ended() -> bool:
    poll = select.poll()
    poll.register(sys.stdout.fileno(), 0)  # errors are always reported
    return any(events & select.POLLERR for _, events in poll.poll(0))


def _exit_on_signals(code: int) -> None:
    """Exit at once on SIGINT or SIGTERM, with this code, until the executable installs its own handlers.

    Call this before the imports, which take a second and leave nothing to clean up. Without these handlers, SIGINT
    would be lost in a background job, because shells start background jobs with SIGINT ignored.
    """
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: os._exit(code))


def _start(module: str, before: Callable[[], None] | None = silence_pybullet, interrupted: int = 0) -> None:
    """Run ``main`` of a module, which may import PyBullet after the call of ``before``, and exit with its result.
    ``interrupted``: exit code after a signal during the imports."""
    _exit_on_signals(interrupted)
    prepare_streams()
    if before is not None:
        before()
    try:
        importlib.import_module("smartmesh_ros.startup.dds").require_domain()
        main = importlib.import_module(module).main
    except ModuleNotFoundError as error:
        if find_spec("rclpy") and find_spec("smartmesh_msgs"):
            raise
        sys.exit(f"{Path(sys.argv[0]).name} needs ROS 2 and smartmesh_msgs ({error}); source your workspace")
    try:
        with ending_with_reader():
            sys.exit(main())
    finally:
        # What follows takes a moment, in which Python would let a further signal end the process as an error.
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, signal.SIG_IGN)


terrain_collider = partial(_start, "smartmesh_ros.node.terrain_collider")
terrain_source = partial(_start, "smartmesh_ros.tools.demo.terrain_source", None)
terrain_sensor = partial(_start, "smartmesh_ros.node.sensor.terrain_sensor")
terrain_score = partial(_start, "smartmesh_ros.tools.score.terrain_score")
fleet_front = partial(_start, "smartmesh_ros.node.fleet.front")
fleet = partial(_start, "smartmesh_ros.tools.fleet", None)
replay = partial(_start, "smartmesh_ros.tools.replay.cli", interrupted=INTERRUPTED)
tune = partial(_start, "smartmesh_ros.tools.tune.cli", interrupted=INTERRUPTED)
# Their standard output stays usable for child processes.
rover = partial(_start, "smartmesh_ros.tools.demo.rover", import_pybullet_quietly)
demo = partial(_start, "smartmesh_ros.tools.demo.demo", import_pybullet_quietly)
view = partial(_start, "smartmesh_ros.tools.view.main", import_pybullet_quietly)

# The executables, which `smartmesh run` starts by name.
STARTED_BY_NAME = {name: start for name, start in globals().items() if isinstance(start, partial)}


def smartmesh() -> None:
    """Do what a command line asks for, or start another executable: ``smartmesh run NAME ...``."""
    match sys.argv[1:]:
        case ["run", name, *rest] if name in STARTED_BY_NAME:
            sys.argv = [name, *rest]
            STARTED_BY_NAME[name]()
        case _:
            _start("smartmesh_ros.tools.client.command", None, INTERRUPTED)
