"""PyBullet clients, and a scene that is the same in each."""

from functools import partial
from typing import Any

import pybullet as pb

from tests.ground.scene import DT, Scene


class Client:
    """A client by its number, without a `BulletClient`'s output and limits."""

    def __init__(self, *connection: Any, **options: Any) -> None:
        self._client = pb.connect(*connection, **options)
        assert self._client >= 0

    def __getattr__(self, name: str) -> Any:
        return partial(getattr(pb, name), physicsClientId=self._client)


def run(client: Any) -> bytes:
    """Run a scene for a sixth of a second; returns the states after each step to the last digit."""
    scene = Scene(client)
    states = scene.run(40)
    scene.ground.close()
    return states.tobytes()


def in_real_time(client: Any) -> tuple[int, bytes]:
    """Let the server of a client step a scene on its own for a while; returns the steps, and the state after them."""
    scene = Scene(client)
    client.setRealTimeSimulation(1)
    while scene.ground.clock < 0.2:
        client.getNumBodies()
    client.setRealTimeSimulation(0)
    return round(scene.ground.clock / DT), scene.state().tobytes()


def by_steps(client: Any, steps: int) -> bytes:
    """Let a client run the steps of `in_real_time`; returns the state after them."""
    scene = Scene(client)
    for _ in range(steps):
        client.stepSimulation()
    return scene.state().tobytes()
