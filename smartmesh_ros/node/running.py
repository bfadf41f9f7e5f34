"""Runs a node to a steady beat until it is told to stop."""

from __future__ import annotations

import gc
import os
import signal
import sys
import tempfile
import traceback
from collections.abc import Callable
from functools import partial
from pathlib import Path
from time import monotonic
from typing import Any, Literal

import rclpy
from rclpy.executors import Executor, MultiThreadedExecutor, SingleThreadedExecutor
from rclpy.experimental import EventsExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.logging import get_logging_directory
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import try_shutdown

from smartmesh_ros.errors import InputError

# Time may stand still; signals are obeyed nevertheless, and ``idle()`` is called so often [s].
LONGEST_WAIT = 0.1

# Messages and calls handled between two steps by a loop that is late.
MOST_WHEN_LATE = 8

ExecutorKind = Literal["events", "single_threaded", "multi_threaded"]


def executor_of(kind: ExecutorKind) -> Executor:
    """An executor by the name that the parameter ``executor`` uses."""
    makers: dict[ExecutorKind, Callable[[], Executor]] = {
        "events": EventsExecutor,
        "single_threaded": SingleThreadedExecutor,
        "multi_threaded": partial(MultiThreadedExecutor, num_threads=2),
    }
    return makers[kind]()


def run(make_node: Callable[[], Any], args: list[str] | None = None) -> None:
    """Makes a node and calls its ``tick(skipped)`` at each deadline of its ``pacer``, handling messages in between.
    The first deadline is counted from the moment that the node is ready, by its ``restart()``.

    The events executor is driven by ``spin_once``: at 240 Hz it costs a tenth of what the others do, and a loop of our
    own keeps the deadlines. What rclpy itself cannot take (a request that is none, a parameter of no type) is noted in
    the node's ``refusals``. Ends on SIGINT and SIGTERM; exits with 2 if the node's settings are impossible.
    """
    rclpy.init(args=_with_logs_that_can_be_written(args), signal_handler_options=SignalHandlerOptions.NO)
    stop: list[int] = []
    try:
        try:
            node = make_node()  # may wait for processes that compile; signals end that at once
            for number in (signal.SIGINT, signal.SIGTERM):
                signal.signal(number, lambda received, _: stop.append(received))
        except KeyboardInterrupt:
            return
        except InputError as error:
            print(f"cannot start: {error}", file=sys.stderr)
            sys.exit(2)
        except rclpy_implementation.RCLError as error:
            if os.environ.get("ROS_SECURITY_ENABLE", "").lower() != "true":
                raise
            print(f"cannot start: no security, which ROS_SECURITY_ENABLE asks for: {error}", file=sys.stderr)
            sys.exit(2)
        executor = executor_of(node.settings.executor)
        executor.add_node(node)
        gc.collect()
        gc.freeze()  # what there is by now stays; to go through it again takes 20 ms
        node.restart()
        worked = monotonic()
        try:
            while not stop:
                if node.pacer.remaining() <= 0.0:
                    _handle_some(executor, node)
                while not stop and (left := node.pacer.remaining()) > 0.0:
                    _handle(executor, node, min(left, LONGEST_WAIT))
                    if monotonic() - worked > LONGEST_WAIT:
                        node.idle()
                        worked = monotonic()
                if not stop:
                    node.tick(node.pacer.advance())
                    worked = monotonic()
        finally:
            executor.remove_node(node)
            node.destroy_node()
    finally:
        try_shutdown()


def _handle_some(executor: Executor, node: Any) -> None:
    """Handles some of the messages that wait while the loop is late; a call of the executor costs too much to ask
    again when there was none."""
    for _ in range(MOST_WHEN_LATE):
        handled = node.handled
        _handle(executor, node, 0.0)
        if node.handled == handled:
            return


def _with_logs_that_can_be_written(args: list[str] | None) -> list[str]:
    """The arguments, with log files turned off where there is no place for them: rclpy would not start without."""
    given = sys.argv if args is None else args
    folder = Path(get_logging_directory())
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return list(given)
    except OSError as error:
        print(f"no log files: {folder} cannot be written ({error}); set ROS_LOG_DIR to another", file=sys.stderr)
        return [*given, "--ros-args", "--disable-external-lib-logs"]


def _handle(executor: Executor, node: Any, seconds: float) -> None:
    """Waits for a message and handles it. rclpy raises malformed requests here, before any callback of ours."""
    try:
        executor.spin_once(timeout_sec=seconds)
    except Exception as error:  # noqa: BLE001  # no peer may end the node, and rclpy's errors have no common base
        where = traceback.extract_tb(error.__traceback__)[-1]
        reason = f"{type(error).__name__}: {error} ({Path(where.filename).name}:{where.lineno})"
        node.refusals.add("rclpy", InputError("malformed", reason))
