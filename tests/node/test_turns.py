"""Long answers in turns: each gets as many as the others, and none blocks what is between them."""

from collections.abc import Coroutine
from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from smartmesh_ros.node.services.turns import NextTurn, Turns, Work


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
