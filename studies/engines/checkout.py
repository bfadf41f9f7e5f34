"""`World` of another checkout of this repository as an engine: it runs in a process of its own."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import smartmesh_ros
from smartmesh_ros.errors import InputError
from smartmesh_ros.terrain.grid import FloatArray
from studies.engines import checkout_process
from studies.engines.engine import Engine, EngineBody, Setup

HERE = Path(smartmesh_ros.__file__).parents[1]


@dataclass(frozen=True, kw_only=True)
class CheckoutOptions:
    """``folder``: directory that holds ``smartmesh_ros/``."""

    folder: Path = HERE


class Checkout(Engine):
    """`World` with its defaults, by the package of a folder. Raises `InputError` if the folder holds no package, or if
    its code cannot run the scene."""

    def __init__(self, setup: Setup, options: CheckoutOptions | None = None) -> None:
        chosen = options or CheckoutOptions()
        package = (chosen.folder / "smartmesh_ros").resolve()
        if not (package / "__init__.py").is_file():
            raise InputError("checkout", f"{chosen.folder} holds no smartmesh_ros/; name a checkout of this repository")
        path = os.pathsep.join([str(package.parent), os.environ.get("PYTHONPATH", "")]).rstrip(os.pathsep)
        # -P: the script's own folder is no place to import from.
        self._process = subprocess.Popen(
            [sys.executable, "-P", checkout_process.__file__],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, env={**os.environ, "PYTHONPATH": path},
        )  # fmt: skip
        try:
            runs = Path(self._call("package")).resolve().parent
            if runs != package:
                raise InputError("checkout", f"{chosen.folder} was asked for, but the code that runs lies in {runs}")
            self._call(
                "start",
                heights=setup.heights, resolution=setup.resolution, rate=1.0 / setup.dt, gravity=setup.gravity,
                slide=setup.slide,
                bodies=[_plain(body) for body in setup.bodies],
            )  # fmt: skip
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

    def positions(self) -> FloatArray:
        return self._array("positions")

    def orientations(self) -> FloatArray:
        return self._array("orientations")

    def velocities(self) -> FloatArray:
        return self._array("velocities")

    def close(self) -> None:
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                pipe.close()
        self._process.wait()

    def _array(self, name: str) -> FloatArray:
        found: FloatArray = self._call(name)
        return found

    def _call(self, name: str, **arguments: Any) -> Any:
        stdin, stdout = self._process.stdin, self._process.stdout
        assert stdin is not None and stdout is not None
        try:
            pickle.dump((name, arguments), stdin)
            stdin.flush()
            result, error = pickle.load(stdout)
        except (EOFError, BrokenPipeError):
            code = self._process.wait()
            raise InputError("checkout", f"the process ended with {code}; its output is above") from None
        if error:
            raise InputError("checkout", error)
        return result


def _plain(body: EngineBody) -> tuple[Any, ...]:
    """Return a body without classes of this checkout, which the other may define otherwise."""
    shape, state = body.shape, body.state
    return type(shape).__name__, asdict(shape), body.mass, asdict(state), body.friction, body.restitution
