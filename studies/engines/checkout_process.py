"""The process of `studies.engines.checkout`: it steps the `World` of the smartmesh_ros in its PYTHONPATH.

This script uses only the package's public API, so that it runs with other versions of the package. It receives pairs
(name of a method of `Run`, arguments) through the pipe that it inherits, and answers with pairs (result, error).
"""

from __future__ import annotations

import sys
import traceback
from multiprocessing.connection import Connection
from time import process_time
from typing import Any

import numpy as np


class Run:
    """A scene, and the processor time that it took."""

    def __init__(self) -> None:
        self._taken = [0.0, 0.0]

    def start(self, *, heights: Any, resolution: float, rate: float, gravity: Any, slide: Any, bodies: Any) -> str:
        """Make the world; return the path of the package that runs. ``bodies``: shape's class, its arguments, mass,
        state, friction, restitution of each."""
        import smartmesh_ros as package

        self._package, self._slide = package, slide
        self._map: Any = {"resolution": resolution}
        self._heightmap = package.HeightMap(heights, **self._map)
        physics = package.PhysicsConfig(rate=rate, gravity=gravity)
        self._world = package.World(self._heightmap, package.WorldConfig(physics=physics))
        for index, (shape, arguments, mass, state, *_) in enumerate(bodies):
            made = getattr(package, shape)(**arguments)
            self._world.spawn(f"body_{index}", made, mass, package.BodyState(**state))
        self._client: Any = self._world.client
        self._uids = [body.uid for body in self._world.bodies.values()]
        for uid, (*_, friction, restitution) in zip(self._uids, bodies, strict=True):
            self._client.changeDynamics(uid, -1, lateralFriction=friction, restitution=restitution)
        return str(package.__file__)

    def set_ground(self, *, heights: Any) -> None:
        """Take a map."""
        package, begin, time = self._package, process_time(), self._world.time
        if any(self._slide):
            # A new map at another position tells the terrain that the ground slides.
            origin = (self._slide[0] * time, self._slide[1] * time)
            moved = package.HeightMap(heights, origin=origin, time=time, **self._map)
            self._world.terrain.put("", moved)
        else:
            self._heightmap.replace(heights, time=time)
        self._taken[0] += process_time() - begin

    def step(self) -> None:
        """Step the world."""
        begin = process_time()
        self._world.step()
        self._taken[1] += process_time() - begin

    def taken(self) -> tuple[float, float]:
        """Return the processor time since the last call [s]: of taking maps, and of steps."""
        update, step = self._taken
        self._taken = [0.0, 0.0]
        return update, step

    def poses(self) -> Any:
        """Return positions [m] and orientations of the bodies (N, 7)."""
        return np.array([np.concatenate(self._client.getBasePositionAndOrientation(uid)) for uid in self._uids])

    def velocities(self) -> Any:
        """Return the velocities of the bodies (N, 6) [m/s, rad/s]."""
        return np.array([np.concatenate(self._client.getBaseVelocity(uid)) for uid in self._uids])


def main() -> None:
    """Answers calls until the pipe is closed."""
    calls, run = Connection(int(sys.argv[1])), Run()
    while True:
        try:
            name, arguments = calls.recv()
        except EOFError:
            return
        try:
            calls.send((getattr(run, name)(**arguments), ""))
        except Exception:  # noqa: BLE001  the other checkout runs on, and the table says what failed
            calls.send((None, traceback.format_exc()))


if __name__ == "__main__":
    main()
