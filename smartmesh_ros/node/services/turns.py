"""Long work of services, done in turns between the steps of the physics."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Coroutine, Generator, Iterator
from typing import Any, NamedTuple


class NextTurn:
    """``await NextTurn()`` ends a turn: the node may step before the work continues."""

    def __await__(self) -> Generator[None, None, None]:
        yield


def parts_of(count: int, size: int) -> Iterator[slice]:
    """Yield slices of up to ``size`` items that cover ``count`` items."""
    for start in range(0, count, size):
        yield slice(start, min(start + size, count))


class Work(NamedTuple):
    """The work of a call: a coroutine that returns the response. Executors would await the coroutine itself at once."""

    steps: Coroutine[Any, Any, Any]


class Turns:
    """Work under way; calls take turns."""

    def __init__(self) -> None:
        self._waiting: deque[tuple[Coroutine[Any, Any, Any], Callable[[Any], None]]] = deque()

    def add(self, work: Work, send: Callable[[Any], None]) -> None:
        """Add work; ``send`` is called with its response."""
        self._waiting.append((work.steps, send))

    def advance(self) -> bool:
        """Do one turn of the work that waits longest. Return False if there is none."""
        if not self._waiting:
            return False
        steps, send = self._waiting.popleft()
        try:
            steps.send(None)
        except StopIteration as end:
            send(end.value)
        else:
            self._waiting.append((steps, send))
        return True

    def close(self) -> None:
        """Give up all work."""
        while self._waiting:
            self._waiting.popleft()[0].close()
