"""Clients with a window: the contacts of DIRECT clients, and a picture of the ground. The window is one of Xvfb."""

import os
import shutil
import subprocess
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from multiprocessing import get_context
from typing import Any

import numpy as np
import pybullet as pb
import pytest

from tests.ground.scene import Client, by_steps, in_real_time, run
from tests.ground.test_shown_ground import close_up, picture, rays

Run = Callable[..., Any]
# Longest time of one call in a window [s], drawn without a graphics card on a busy machine.
PATIENCE = 120.0


def _set(environment: dict[str, str]) -> None:
    os.environ |= environment


@cache
def _window() -> Any:
    """The window of this process. It draws pictures alone, because a step waits for what else it draws, and for the
    next time at which it may."""
    client = Client(pb.GUI, options="--width=320 --height=240 --minGraphicsUpdateTimeMs=0")
    for what in (pb.COV_ENABLE_GUI, pb.COV_ENABLE_SHADOWS, pb.COV_ENABLE_RENDERING):
        client.configureDebugVisualizer(what, 0)
    return client


def _call(function: Callable[..., Any], *args: Any) -> Any:
    _window().resetSimulation()
    return function(_window(), *args)


@pytest.fixture(scope="module")
def in_window() -> Iterator[Run]:
    """Calls a function with a client that has a window, in a process of its own: PyBullet ends its process if there is
    no display."""
    server = shutil.which("Xvfb")
    if server is None:
        pytest.skip("no Xvfb is installed (Debian: apt install xvfb)")
    read, write = os.pipe()
    command = [server, "-displayfd", str(write), "-screen", "0", "1024x768x24", "-nolisten", "tcp"]
    with subprocess.Popen(command, pass_fds=(write,), stderr=subprocess.DEVNULL) as display:
        os.close(write)
        with os.fdopen(read) as numbers:
            number = numbers.readline().strip()
        assert number, "Xvfb has not started"
        environment = {"DISPLAY": f":{number}", "LIBGL_ALWAYS_SOFTWARE": "1"}
        with ProcessPoolExecutor(1, get_context("spawn"), _set, (environment,)) as process:
            yield lambda function, *args: process.submit(_call, function, *args).result(PATIENCE)
        display.terminate()


def test_contacts_in_a_window_are_those_of_a_direct_client(in_window: Run, client: Any) -> None:
    """To the last digit, and after a reset also where it steps in real time."""
    assert in_window(run) == run(client)
    steps, states = in_window(in_real_time)
    client.resetSimulation()
    assert states == by_steps(client, steps)


def test_a_window_shows_the_ground_as_a_picture_of_a_direct_client_does(in_window: Run, client: Any) -> None:
    """Holes and colours are at the same places, and proxies at none."""
    shown, wanted = in_window(picture, pb.ER_BULLET_HARDWARE_OPENGL), picture(client, pb.ER_TINY_RENDERER)
    assert np.mean(shown == wanted) > 0.98
    assert in_window(close_up, pb.ER_BULLET_HARDWARE_OPENGL) == {-1, 0}


def test_rays_in_a_window_meet_the_ground(in_window: Run, client: Any) -> None:
    np.testing.assert_array_equal(in_window(rays), rays(client))
