"""Runs a node at a fixed period until a signal stops it."""

from __future__ import annotations

import gc
import os
import re
import signal
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from time import monotonic
from typing import Any

import rclpy
from rclpy.exceptions import NameValidationException
from rclpy.executors import Executor, SingleThreadedExecutor
from rclpy.experimental import EventsExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.logging import get_logging_directory
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import try_shutdown

from smartmesh_ros.errors import InputError
from smartmesh_ros.node.parameters.declaring import warn_of_unused_overrides
from smartmesh_ros.node.refusals import Refusals, unexpected

# Longest wait for messages before signals are checked and ``idle()`` is called, because ``/clock`` may stand still [s].
LONGEST_WAIT = 0.1

# Errors of rclpy about names and the environment: too long a name, a peer or a security enclave that is not there.
OF_RCL = (rclpy_implementation.RCLError, NameValidationException)

# Most messages and calls that a late loop handles between two steps.
MOST_WHEN_LATE = 8

# Expected time of one turn of a long answer [s]. With less time until the next step, only one turn is done.
TURN = 1e-3


class Stop:
    """Notes SIGINT and SIGTERM in ``asked`` (bool).

    While ``starting``, the first signal also raises `KeyboardInterrupt`, which ends what the start waits for.
    """

    def __init__(self) -> None:
        self.asked, self.starting = False, True
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._on_signal)

    def _on_signal(self, number: int, _: object) -> None:
        first, self.asked = not self.asked, True
        if self.starting and first:
            raise KeyboardInterrupt


def init(args: Sequence[str] | None = None) -> None:
    """Initialise rclpy without signal handlers; without log files if their folder is not writable, or there is no home
    for it, because rclpy would not start."""
    given = list(sys.argv if args is None else args)
    try:
        folder = Path(get_logging_directory())
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except (OSError, RuntimeError) as error:  # RuntimeError: no HOME
        print(f"no log files: {error}; set ROS_LOG_DIR to a folder that can be written", file=sys.stderr)
        given += ["--ros-args", "--disable-external-lib-logs"]
    rclpy.init(args=given, signal_handler_options=SignalHandlerOptions.NO)


@contextmanager
def started(make_node: Callable[[], Any], args: Sequence[str] | None) -> Iterator[tuple[Any, Stop]]:
    """Make a node, and destroy it after the block; exits with 2 and the reason if the node refuses its settings, and
    with 0 after a signal during the start."""
    stop, node = Stop(), None
    try:
        init(args)
        node = make_node()
        stop.starting = False
        warn_of_unused_overrides(node)
        yield node, stop
    except BaseException as error:
        if stop.starting and stop.asked:  # whatever the error is: compiled code makes others of the interrupt
            sys.exit()
        if node is not None or not isinstance(error, (InputError, *OF_RCL)):
            raise
        print(f"cannot start: {_reason(error)}", file=sys.stderr)
        sys.exit(2)
    finally:
        # Otherwise, if Python ends without freeing its objects, peers may send to the shared memory of this node, and
        # not to that of the next one.
        if node is not None:
            node.destroy_node()
        try_shutdown()


def _reason(error: BaseException) -> str:
    """Return why a node cannot start; of rcl's errors the first line, without the places in its sources."""
    if isinstance(error, InputError):
        return str(error)
    secured = os.environ.get("ROS_SECURITY_ENABLE", "").lower() == "true"
    words = "no security, which ROS_SECURITY_ENABLE asks for: " if secured else ""
    return words + re.sub(r"(, at \S+:\d+)+", "", str(error)).partition("\n")[0].rstrip(":")


def spin(make_node: Callable[[], Any], args: Sequence[str] | None = None) -> None:
    """Make a node without a loop of its own, as `started` does, and handle its messages until SIGINT or SIGTERM.
    Input that rclpy rejects is logged."""
    with started(make_node, args) as (node, stop), ExitStack() as ends:
        executor = SingleThreadedExecutor()
        ends.callback(executor.shutdown)
        executor.add_node(node)
        refusals = Refusals(node.get_logger())
        while not stop.asked:
            _handle(executor, refusals, LONGEST_WAIT)


def run(make_node: Callable[[], Any], args: list[str] | None = None) -> None:
    """Make a node, as `started` does, call its ``tick(pacer.advance)`` at each deadline of its ``pacer``, and handle
    messages in between, until SIGINT or SIGTERM.

    This loop keeps the deadlines and calls ``spin_once`` of the events executor, which costs a tenth of the others at
    240 Hz. Long answers continue in between by the node's ``turn()``. Input that rclpy rejects (a malformed request, a
    parameter without a type) is counted in the node's ``refusals``.
    """
    with started(make_node, args) as (node, stop), ExitStack() as ends:
        executor = EventsExecutor()
        executor.add_node(node)
        ends.callback(executor.remove_node, node)
        gc.collect()
        gc.freeze()  # the objects so far live as long as the node; each collection of them would take 20 ms
        node.pacer.restart()
        worked = monotonic()
        while not stop.asked:
            if node.pacer.remaining() <= 0.0:
                _handle_some(executor, node)
                node.turn()
            turned = False
            while not stop.asked and (left := node.pacer.remaining()) > 0.0:
                if node.pacer.follows_clock:  # it may stand still, and its next message ends the wait
                    left = LONGEST_WAIT
                works = (left > TURN or not turned) and node.turn()
                turned |= works
                _handle(executor, node.refusals, 0.0 if works else min(left, LONGEST_WAIT))
                if monotonic() - worked > LONGEST_WAIT:
                    node.idle()
                    worked = monotonic()
            if not stop.asked:
                node.tick(node.pacer.advance)
                worked = monotonic()


def _handle_some(executor: Executor, node: Any) -> None:
    """Handles up to `MOST_WHEN_LATE` waiting messages; stops at the first empty call, because calls are expensive."""
    for _ in range(MOST_WHEN_LATE):
        handled = node.session.handled
        _handle(executor, node.refusals, 0.0)
        if node.session.handled == handled:
            return


def _handle(executor: Executor, refusals: Refusals, seconds: float) -> None:
    """Waits for a message and handles it. Counts malformed requests, which rclpy raises here before any callback."""
    try:
        executor.spin_once(timeout_sec=seconds)
    except Exception as error:  # noqa: BLE001  # no peer may stop the node, and rclpy's errors have no common base
        refusals.add("rclpy", unexpected(error, "malformed"))
