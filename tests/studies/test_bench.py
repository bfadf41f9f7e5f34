"""The bench runs from end to end, and what it writes says what it measured."""

import math

from studies.bench.measure import Bench
from studies.bench.study import all_tables, measure
from studies.pages import number, times


def test_a_quick_run_fills_every_table() -> None:
    bench = Bench(most=2, least=2, seconds=0.0, quick=True)
    measure(bench)
    tables = all_tables(bench).split("### ")[1:]
    assert [f"Table {index}:" in "".join(tables) for index in range(1, 7)] == [True] * 6
    for one in tables:
        if "Left out" not in one:
            cells = [line.strip("|").split("|")[1:] for line in one.splitlines() if line.startswith("|")][2:]
            assert any(cell.strip() != "-" for row in cells for cell in row), one


def test_each_run_is_prepared_and_enough_frames_are_measured() -> None:
    calls: list[str] = []
    bench = Bench(most=7, least=2)
    bench.time(("a", "first", 1), lambda: calls.append("1"), lambda: calls.append("p"))
    assert bench.found["a", "first", 1][3] == 7
    text = "".join(calls)
    assert text == "p1" * (len(text) // 2)
    bench = Bench(most=1000, least=3, seconds=0.0)
    bench.time(("a", "first", 1), lambda: None)
    median, low, high, frames = bench.found["a", "first", 1]
    assert low <= median <= high
    assert frames == 3


def test_what_was_not_measured_is_no_figure() -> None:
    assert math.isnan(Bench().us("simple", "physx", 3))
    assert number(math.nan) == times(math.nan) == "-"
