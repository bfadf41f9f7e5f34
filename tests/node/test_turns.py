"""Long answers in turns: each gets as many as the others, and none blocks what is between them."""

from collections.abc import Coroutine
from typing import Any, get_args

import pytest
import rclpy
from hypothesis import given
from hypothesis import strategies as st
from std_srvs.srv import SetBool

from smartmesh_ros.node.running import ExecutorKind, executor_of
from smartmesh_ros.node.services.turns import NextTurn, Turns, Work, parts_of
from tests.node.shared import wait_until


async def work(name: str, turns: int, log: list[str]) -> str:
    for _ in range(turns):
        log.append(name)
        await NextTurn()
    return name


@given(st.lists(st.integers(0, 9), max_size=5))
def test_answers_take_turns_and_each_is_sent_once(lengths: list[int]) -> None:
    turns, log, sent = Turns(), [], []
    for index, length in enumerate(lengths):
        turns.add(Work(work(str(index), length, log)), sent.append)
    between = 0
    while turns.advance():
        between += 1
    assert between == sum(length + 1 for length in lengths), "one part of one answer in each turn"
    assert sorted(sent) == [str(index) for index in range(len(lengths))]
    for round_ in range(max(lengths, default=0)):
        wanted = [str(index) for index, length in enumerate(lengths) if length > round_]
        assert log[: len(wanted)] == wanted, "nobody gets two turns while another waits"
        del log[: len(wanted)]


def test_work_that_is_given_up_ends() -> None:
    ended: list[str] = []

    async def endless() -> None:
        try:
            while True:
                await NextTurn()
        finally:
            ended.append("closed")

    turns, sent = Turns(), list[Any]()
    made: Coroutine[Any, Any, None] = endless()
    turns.add(Work(made), sent.append)
    assert turns.advance()
    turns.close()
    assert ended == ["closed"] and not turns.advance() and not sent


@pytest.mark.parametrize("executor", get_args(ExecutorKind))
def test_every_executor_sends_late_answers_and_early_ones(domain: int, executor: ExecutorKind) -> None:
    """Calls with ``data`` are answered in turns, after the others; each gets its own answer."""
    rclpy.init(domain_id=domain)
    try:
        node = rclpy.create_node("turns")
        turns, order = Turns(), list[str]()

        async def late(response: SetBool.Response) -> SetBool.Response:
            for _ in range(5):
                await NextTurn()
            order.append("late")
            response.message = "late"
            return response

        def start(request: SetBool.Request, response: SetBool.Response) -> Any:
            if request.data:
                return Work(late(response))
            order.append("early")
            response.message = "early"
            return response

        turns.answer_later(node.create_service(SetBool, "~/answer", start))
        client = node.create_client(SetBool, "~/answer")
        spinner = executor_of(executor)
        spinner.add_node(node)
        wait_until(client.service_is_ready)
        calls = [client.call_async(SetBool.Request(data=data)) for data in (True, False, True, False)]

        def all_answered() -> bool:
            spinner.spin_once(timeout_sec=0.01)
            if order.count("early") == 2:
                turns.advance()
            return all(call.done() for call in calls)

        wait_until(all_answered)
        assert [call.result().message for call in calls] == ["late", "early", "late", "early"]
        assert order == ["early", "early", "late", "late"]
        spinner.remove_node(node)
        node.destroy_node()
    finally:
        rclpy.shutdown()


@given(st.integers(0, 1000), st.integers(1, 300))
def test_parts_cover_all_items_once(count: int, size: int) -> None:
    items = list(range(count))
    parts = [items[part] for part in parts_of(count, size)]
    assert [item for part in parts for item in part] == items
    assert all(0 < len(part) <= size for part in parts)
