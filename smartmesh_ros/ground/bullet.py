"""PyBullet calls that run for every body in every step, and what undoes half of an operation when PyBullet fails.

A `BulletClient` adds the client to each call as a keyword, which costs as much as the call itself. These functions pass
it by position. All other calls go through the client.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from inspect import isroutine
from itertools import chain
from typing import Any

import numpy as np
import pybullet as pb

from smartmesh_ros.errors import InputError
from smartmesh_ros.terrain.grid import FloatArray


class NumberedClient:
    """PyBullet's functions for the client of a number. The caller who connected the client disconnects it."""

    def __init__(self, number: int) -> None:
        self._client = number

    def __getattr__(self, name: str) -> Any:
        """Return one of PyBullet's functions or constants."""
        found = getattr(pb, name)
        return partial(found, physicsClientId=self._client) if isroutine(found) else found


class NoClient:
    """Takes the place of a client that is not there, and of all that works in it: refuses whatever is asked, and says
    ``why``."""

    def __init__(self, why: str) -> None:
        self.why = why

    def __getattr__(self, name: str) -> Any:
        """Raise `InputError`."""
        if name.startswith("__"):
            raise AttributeError(name)
        raise InputError("client", self.why)

    def close(self) -> None:
        """There is nothing to close."""


def connected_client(client: Any) -> Any:
    """Return a client with PyBullet's functions as methods: a `BulletClient`, the module ``pybullet`` itself, or the
    client of a number, as users of ``physicsClientId=`` have it. Raises `InputError` if it is none of these, or not
    connected."""
    if type(client) is int or isinstance(client, np.integer):
        client = NumberedClient(int(client))
    if not hasattr(client, "getConnectionInfo"):
        raise InputError(
            "client", f"the client is of type {type(client).__name__}; pass the module pybullet, a BulletClient, or "
            "the number that pybullet.connect returned"
        )  # fmt: skip
    if not client.getConnectionInfo()["isConnected"]:
        number = getattr(client, "_client", 0)
        raise InputError("client", f"PyBullet's client {number} is not connected; call pybullet.connect before")
    return client


class BulletCalls:
    """Calls on one client; see `connected_client`."""

    def __init__(self, client: Any) -> None:
        self._client: int = getattr(client, "_client", 0)

    def step(self) -> None:
        """Run ``stepSimulation``."""
        pb.stepSimulation(self._client)

    def states(self, bodies: list[int]) -> FloatArray:
        """Return position, orientation (x, y, z, w), velocity and angular velocity of each body (n, 13) [m, m/s,
        rad/s]."""
        pose, velocity, client = pb.getBasePositionAndOrientation, pb.getBaseVelocity, self._client
        numbers = chain.from_iterable(chain(*pose(body, client), *velocity(body, client)) for body in bodies)
        return np.fromiter(numbers, np.float64, 13 * len(bodies)).reshape(-1, 13)

    def poses(self, bodies: list[int]) -> FloatArray:
        """Return position and orientation (x, y, z, w) of each body (n, 7) [m]."""
        pose, client = pb.getBasePositionAndOrientation, self._client
        numbers = chain.from_iterable(chain(*pose(body, client)) for body in bodies)
        return np.fromiter(numbers, np.float64, 7 * len(bodies)).reshape(-1, 7)

    def state(self, body: int, link: int) -> FloatArray:
        """Return the state of a body (``link`` = -1) or of a robot's link (13,), as `states` does."""
        if link < 0:
            return np.asarray(self.states([body])[0])
        found = pb.getLinkState(body, link, 1, 1, self._client)  # else the pose would be that before the last step
        return np.array([*found[0], *found[1], *found[6], *found[7]])


@contextmanager
def own_client() -> Iterator[Any]:
    """Give the block a client of its own, to try or measure something in."""
    client = NumberedClient(pb.connect(pb.DIRECT))  # prints nothing, unlike a `BulletClient`
    try:
        yield client
    finally:
        client.disconnect()


def is_fixed(client: Any, body: int) -> bool:
    """Return True if the base of a body has no mass, so that physics does not move it."""
    return float(client.getDynamicsInfo(body, -1)[0]) == 0.0


@contextmanager
def undone(undo: Callable[[], object]) -> Iterator[None]:
    """Call ``undo`` if the block raises, and let its error pass, with a note if ``undo`` fails, too."""
    try:
        yield
    except BaseException as error:
        try:
            undo()
        except Exception as failed:  # noqa: BLE001 - whatever it is, it came second
            error.add_note(f"what was done before is not undone: {failed}")
        raise
