"""The services that add and remove bodies, one at a time or many at once."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from functools import partial
from typing import Any

from smartmesh_msgs.msg import BodyFailure
from smartmesh_msgs.srv import RemoveBodies, RemoveBody, SpawnBodies, SpawnBody

from smartmesh_ros.errors import InputError, listed
from smartmesh_ros.ground.shapes import Shape
from smartmesh_ros.node.inputs import conversions
from smartmesh_ros.node.refusals import shortened
from smartmesh_ros.node.services.initial_bodies import adding
from smartmesh_ros.node.session import REFUSED, Session, require_name
from smartmesh_ros.world.robots.prepared import PreparedRobot

# Number of failures that a response's message quotes. The list of failures in the response is complete.
QUOTED = 3
# What a refused call has done, unless PyBullet failed.
NOTHING = "so nothing was changed"


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
        standing = {"on_ground": body.on_ground, "clearance": body.clearance, "align": body.align}
        add = adding(session.world, body.id, what, body.mass, state, **standing)

        def action() -> str:
            session.require_room([body.id])
            add()
            return session.start_of(body.id, state, on_ground=body.on_ground)

        return action

    async def _on_spawn(self, request: SpawnBody.Request, response: SpawnBody.Response) -> None:
        action = await self._ready(request)
        with self._session.lock:
            response.message = action()

    async def _on_spawn_all(self, request: SpawnBodies.Request, response: SpawnBodies.Response) -> None:
        world, added, told, counts = self._session.world, [], [], Counter(body.id for body in request.bodies)
        tasks: dict[str, Callable[[], Any]] = {}

        def add(name: str, action: Callable[[], str]) -> None:
            told.append(action())
            added.append(name)

        for body in request.bodies:
            try:
                conversions.require_once(body.id, counts)
                tasks[body.id] = partial(add, body.id, await self._ready(body))
            except REFUSED as error:
                tasks[body.id] = partial(_refuse, error)
        with self._session.lock:
            failures = _failures_of(tasks.items())
            left = _failures_of((name, partial(world.remove, name)) for name in added) if failures else []
        stay = f"but some were added and stay, because PyBullet failed: {', '.join(body.id for body in left)}"
        response.failures = failures
        _require_all(failures, len(request.bodies), stay if left else NOTHING)
        response.message = shortened("; ".join(filter(None, told)))

    def _on_remove_all(self, request: RemoveBodies.Request, response: RemoveBodies.Response) -> None:
        session, counts = self._session, Counter(request.ids)

        def check(name: str) -> None:
            session.world.body(name)
            conversions.require_once(name, counts)

        failures, outcome = _failures_of((name, partial(check, name)) for name in counts), NOTHING
        if not failures:
            failures = _failures_of((name, partial(session.remove, name)) for name in counts)
            outcome = "but the others are removed"
        response.failures = failures
        _require_all(failures, len(request.ids), outcome)


def _require_all(failures: list[BodyFailure], count: int, outcome: str) -> None:
    """Raise `InputError` if some of ``count`` bodies are refused, and say what the ``outcome`` is."""
    if failures:
        reasons = listed([failure.reason for failure in failures], QUOTED, between="; ")
        raise InputError("batch", f"{len(failures)} of {count} bodies are refused, {outcome}: {reasons}")


def _refuse(error: Exception) -> None:
    raise error


def _failures_of(tasks: Iterable[tuple[str, Callable[[], Any]]]) -> list[BodyFailure]:
    """Do tasks (body name, action) in order; return those whose action raised `InputError`."""
    failures = []
    for name, action in tasks:
        try:
            action()
        except REFUSED as error:
            failures.append(BodyFailure(id=shortened(name), reason=shortened(str(error))))
    return failures
