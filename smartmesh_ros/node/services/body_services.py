"""The services that add and remove bodies, one at a time or many at once."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from smartmesh_msgs.msg import BodyFailure
from smartmesh_msgs.srv import RemoveBodies, RemoveBody, SpawnBodies, SpawnBody

from smartmesh_ros.errors import InputError, counted, listed
from smartmesh_ros.ground.shapes import Shape
from smartmesh_ros.node.inputs import conversions
from smartmesh_ros.node.refusals import shortened
from smartmesh_ros.node.services.initial_bodies import add_to
from smartmesh_ros.node.session import REFUSED, Session, require_name
from smartmesh_ros.world.robots.prepared import PreparedRobot

# Number of failures that a response's message quotes. The list of failures in the response is complete.
QUOTED = 3
# What a refused call has done, unless PyBullet failed.
NOTHING = "so nothing was changed"


@contextmanager
def noting(refused: dict[str, str], name: str) -> Iterator[None]:
    """Note in ``refused`` why the block was refused for the body of this name, and go on after it."""
    try:
        yield
    except REFUSED as error:
        refused[name] = str(error)


def failures_of(refused: dict[str, str]) -> list[BodyFailure]:
    """Return the messages of why bodies were refused, by name."""
    return [BodyFailure(id=shortened(name), reason=shortened(reason)) for name, reason in refused.items()]


class BodyServices:
    """Serves ``~/spawn_body``, ``~/remove_body``, ``~/spawn_bodies`` and ``~/remove_bodies``."""

    def __init__(self, session: Session) -> None:
        self._session = session
        session.serve(SpawnBody, "spawn_body", self._on_spawn)
        session.serve(RemoveBody, "remove_body", lambda request, _: session.remove(request.id))
        session.serve(SpawnBodies, "spawn_bodies", self._on_spawn_all)
        session.serve(RemoveBodies, "remove_bodies", self._on_remove_all)

    async def _ready(self, body: Any) -> Callable[[], str]:
        """Return the action that adds a body, and returns how it starts otherwise than asked, empty if it does not; it
        raises `InputError` and adds nothing if the world refuses the body. A robot is prepared before. Raises
        `InputError`."""
        session = self._session
        require_name(body.id)
        session.require_room([body.id])
        state = conversions.state_from(body.pose, body.twist)
        what: Shape | PreparedRobot
        if body.urdf:
            what = await session.files.prepared(body.urdf, session.settings)
        else:
            what = conversions.shape_of_primitive(body.shape)

        def action() -> str:
            session.require_room([body.id])
            add_to(session.world, body.id, what, state, body)
            return session.start_of(body.id, state, on_ground=body.on_ground)

        return action

    async def _on_spawn(self, request: SpawnBody.Request, response: SpawnBody.Response) -> None:
        action = await self._ready(request)
        with self._session.lock:
            response.message = action()

    async def _on_spawn_all(self, request: SpawnBodies.Request, response: SpawnBodies.Response) -> None:
        session, counts = self._session, Counter(body.id for body in request.bodies)
        actions: dict[str, Callable[[], str]] = {}
        told: dict[str, str] = {}
        refused: dict[str, str] = {}
        left: dict[str, str] = {}
        for body in request.bodies:
            with noting(refused, body.id):
                conversions.require_once(body.id, counts)
                actions[body.id] = await self._ready(body)
        with session.lock:
            for name, action in actions.items():
                with noting(refused, name):
                    told[name] = action()
            for name in told if refused else ():
                with noting(left, name):
                    session.world.remove(name)
        stay = f"but some were added and stay, because PyBullet failed: {', '.join(left)}"
        _require_all(response, refused, len(request.bodies), stay if left else NOTHING)
        response.message = shortened("; ".join(filter(None, told.values())))

    def _on_remove_all(self, request: RemoveBodies.Request, response: RemoveBodies.Response) -> None:
        session, counts = self._session, Counter(request.ids)
        refused: dict[str, str] = {}
        for name in counts:
            with noting(refused, name):
                session.world.body(name)
                conversions.require_once(name, counts)
        outcome = NOTHING if refused else "but the others are removed"
        for name in () if refused else counts:
            with noting(refused, name):
                session.remove(name)
        _require_all(response, refused, len(request.ids), outcome)


def _require_all(response: Any, refused: dict[str, str], count: int, outcome: str) -> None:
    """Write which of ``count`` bodies are ``refused`` into a response, and raise `InputError`, which says what the
    ``outcome`` is, if some are."""
    response.failures = failures_of(refused)
    if refused:
        reasons = listed([failure.reason for failure in response.failures], QUOTED, between="; ")
        raise InputError("batch", f"{len(refused)} of {counted(count)} refused, {outcome}: {reasons}")
