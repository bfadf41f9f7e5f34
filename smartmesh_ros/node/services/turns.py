"""Long work of services, done in turns between the steps of the physics."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Coroutine, Generator, Iterator
from contextlib import suppress
from types import coroutine
from typing import Any, NamedTuple

from rclpy.service import Service

from smartmesh_ros.errors import InputError


@coroutine
def next_turn(waits: bool = False) -> Generator[bool, None, None]:
    """End a turn when it is awaited: the node may step before the work continues. ``waits``: the work waits for
    another thread, and the node need not hurry with the next turn."""
    yield waits


def parts_of(count: int, size: int) -> Iterator[slice]:
    """Yield slices of up to ``size`` items that cover ``count`` items; an empty one for none."""
    for start in range(0, max(count, 1), size):
        yield slice(start, min(start + size, count))


class Work(NamedTuple):
    """The work of a call: a coroutine that returns the response. Executors would await the coroutine itself at once."""

    steps: Coroutine[Any, Any, Any]


class Turns:
    """Work under way; calls take turns. Its length is the number of calls."""

    def __init__(self) -> None:
        self._waiting: deque[tuple[Coroutine[Any, Any, Any], Callable[[Any], None]]] = deque()

    def __len__(self) -> int:
        return len(self._waiting)

    def add(self, work: Work, send: Callable[[Any], None]) -> None:
        """Add work; ``send`` is called with its response."""
        self._waiting.append((work.steps, send))

    def begin(self, steps: Coroutine[Any, Any, Any]) -> None:
        """Do the first turn of some work, which has no response, now, and the others in turns."""
        with suppress(StopIteration):
            steps.send(None)
            self.add(Work(steps), lambda _: None)

    def answer_later(self, service: Service) -> None:
        """Let a service's callback return the `Work` that makes the response in turns, in place of the response.

        The public way to answer later is a coroutine as callback, which the events executor does not await. All
        executors pass what the callback returned to the service's ``send_response``, so this takes that place.
        """
        send = service.send_response

        def respond(found: Any, header: Any) -> None:
            if isinstance(found, Work):
                self.add(found, lambda response: send(response, header))
            else:
                send(found, header)

        service.send_response = respond

    def advance(self) -> bool:
        """Do one turn of the work that waits longest. Return False if there is none, or all waits for other threads."""
        for _ in range(len(self._waiting)):
            steps, send = self._waiting.popleft()
            try:
                waits = steps.send(None)
            except StopIteration as end:
                send(end.value)
                return True
            self._waiting.append((steps, send))
            if not waits:
                return True
        return False

    def close(self) -> None:
        """Give up all work; callers that wait for it are told."""
        while self._waiting:
            steps, send = self._waiting.popleft()
            try:
                steps.throw(InputError("ended", "the node ends before this is done"))
            except StopIteration as end:
                send(end.value)
            except InputError:  # work that has not begun
                pass
            steps.close()
