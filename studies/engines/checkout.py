"""`World` of another checkout of this repository as an engine: it runs in a process of its own."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import asdict
from multiprocessing import Pipe
from pathlib import Path
from typing import Any

import numpy as np

import smartmesh_ros
from smartmesh_ros.errors import InputError
from smartmesh_ros.terrain.grid import FloatArray
from studies.engines import checkout_process
from studies.engines.engine import Engine, EngineBody, Setup

HERE = Path(smartmesh_ros.__file__).parents[1]


class Checkout(Engine):
    """`World` with its defaults, by the ``smartmesh_ros/`` of a ``folder``. Raises `InputError` if the folder holds no
    package, or if its code cannot run the scene."""

    def __init__(self, setup: Setup, *, folder: Path = HERE) -> None:
        package = (folder / "smartmesh_ros").resolve()
        if not (package / "__init__.py").is_file():
            raise InputError("checkout", f"{folder} holds no smartmesh_ros/; name a checkout of this repository")
        path = os.pathsep.join([str(package.parent), os.environ.get("PYTHONPATH", "")]).rstrip(os.pathsep)
        self._calls, there = Pipe()
        # -P: the script's own folder is no place to import from. PyBullet prints onto the standard output.
        self._process = subprocess.Popen(
            [sys.executable, "-P", checkout_process.__file__, str(there.fileno())],
            pass_fds=[there.fileno()], stdout=subprocess.DEVNULL, env={**os.environ, "PYTHONPATH": path},
        )  # fmt: skip
        there.close()
        try:
            file = self._call(
                "start", heights=setup.heights, resolution=setup.resolution, rate=1.0 / setup.dt, slide=setup.slide,
                gravity=setup.gravity, bodies=[_plain(body) for body in setup.bodies],
            )  # fmt: skip
            if (runs := Path(file).resolve().parent) != package:
                raise InputError("checkout", f"{folder} was asked for, but the code that runs lies in {runs}")
        except InputError:
            self.close()
            raise

    def ready(self, heights: Any) -> Any:
        return heights

    def set_ground(self, ready: Any) -> None:
        self._call("set_ground", heights=ready)

    def step(self) -> None:
        self._call("step")

    def taken(self) -> tuple[float, float]:
        """Return the processor time [s] since the last call of everything but ``stepSimulation``, and of that."""
        found: tuple[float, float] = self._call("taken")
        return found

    def poses(self) -> FloatArray:
        return np.asarray(self._call("poses"))

    def velocities(self) -> FloatArray:
        return np.asarray(self._call("velocities"))

    def close(self) -> None:
        self._calls.close()
        self._process.wait()

    def _call(self, name: str, **arguments: Any) -> Any:
        try:
            self._calls.send((name, arguments))
            result, error = self._calls.recv()
        except (EOFError, OSError):
            code = self._process.wait()
            raise InputError("checkout", f"the process ended with {code}; its output is above") from None
        if error:
            raise InputError("checkout", error)
        return result


def _plain(body: EngineBody) -> tuple[Any, ...]:
    """Return a body without classes of this checkout, which the other may define otherwise."""
    shape, state = body.shape, body.state
    return type(shape).__name__, asdict(shape), body.mass, asdict(state), body.friction, body.restitution
