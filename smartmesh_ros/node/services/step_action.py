"""The action ``~/simulate_steps`` of simulation_interfaces: steps of a paused simulation with feedback after each,
which can be cancelled."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import Any

from rclpy.action import ActionServer, CancelResponse

from smartmesh_ros.errors import InputError
from smartmesh_ros.node.services.turns import NextTurn, Work
from smartmesh_ros.node.session import REFUSED, Session

NAME = "simulate_steps"


class StepAction:
    """Serves the action of this ``kind`` by calls of ``step``; ``results``: the message class Result. The steps are
    done in turns, between which the node takes messages and calls."""

    def __init__(self, session: Session, step: Callable[[int], Awaitable[None]], kind: Any, results: Any) -> None:
        self._session, self._step, self._kind, self._results = session, step, kind, results
        self._ends: dict[bytes, tuple[str, str]] = {}  # how goals ended, until their clients are told
        node: Any = session.node
        ActionServer(
            node, kind, f"~/{NAME}", self._conclude, handle_accepted_callback=self._accept,
            cancel_callback=lambda _: CancelResponse.ACCEPT,
        )  # fmt: skip

    def _accept(self, goal: Any) -> None:
        self._session.handled += 1
        self._session.turns.add(Work(self._run(goal)), lambda _: goal.execute())

    async def _run(self, goal: Any) -> None:
        """Do the steps of a goal, and note how it ended."""
        session, count, done = self._session, goal.request.steps, 0
        try:
            if not count:
                raise InputError("steps", "0 steps; ask for 1 or more")
            while done < count and not goal.is_cancel_requested:
                await self._step(1)
                done += 1
                goal.publish_feedback(self._kind.Feedback(completed_steps=done, remaining_steps=count - done))
                await NextTurn()
            end = ("succeed", "") if done == count else ("canceled", f"cancelled after {done} of {count} steps")
        except REFUSED as error:
            session.refusals.add(NAME, error)
            end = ("abort", f"{error} ({done} of {count} steps are done)")
        self._ends[bytes(goal.goal_id.uuid)] = end

    def _conclude(self, goal: Any) -> Any:
        """Tell the client how its goal ended."""
        end, words = self._ends.pop(bytes(goal.goal_id.uuid))
        getattr(goal, end)()
        result = self._kind.Result()
        failed, ok = self._results.RESULT_OPERATION_FAILED, self._results.RESULT_OK
        result.result.result, result.result.error_message = failed if words else ok, words
        return result
