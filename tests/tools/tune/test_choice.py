"""Which point is chosen, whatever was found."""

import argparse
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from smartmesh_ros.errors import InputError
from smartmesh_ros.tools.tune.cli import parser
from smartmesh_ros.tools.tune.confirm import SAME_PENETRATION, nearest, ranked
from smartmesh_ros.tools.tune.figures import Asked, Figures, Limits, Point
from smartmesh_ros.tools.tune.session import open_search
from tests.examples import examples

COSTS = st.floats(1e-3, 10.0)
LENGTHS = st.floats(0.0, 0.1)
FIGURES = st.builds(
    Figures, cost=COSTS, longest=st.floats(1e-5, 0.1), penetration=LENGTHS | st.just(math.nan), hover=LENGTHS,
    deviation=LENGTHS | st.just(math.nan), lost=st.integers(0, 2),
)  # fmt: skip
POINTS = st.lists(st.builds(lambda figures: Point({}, figures), FIGURES), min_size=1, max_size=30)
WANTED = st.none() | st.floats(1e-4, 1.0)
ASKED = st.builds(Asked, budget=WANTED, penetration=WANTED, deadline=WANTED, hover=WANTED, deviation=WANTED)


@given(POINTS, ASKED, FIGURES)
@examples(100)
def test_what_is_chosen_keeps_everything_that_is_asked(points: list[Point], asked: Asked, base: Figures) -> None:
    kept = ranked(points, asked, Limits.of(asked, base))
    for chosen in kept[:1]:
        found = chosen.figures
        assert found.cost <= (asked.budget or math.inf)
        assert found.penetration <= (asked.penetration or math.inf)
        assert found.longest <= (asked.deadline or math.inf)
        assert found.hover <= (asked.hover or math.inf)
        assert math.isnan(found.deviation) or found.deviation <= (asked.deviation or math.inf)
        assert found.lost + found.rescued <= base.lost + base.rescued


@given(POINTS, ASKED, FIGURES)
@examples(100)
def test_nothing_that_keeps_it_is_better(points: list[Point], asked: Asked, base: Figures) -> None:
    limits = Limits.of(asked, base)
    kept = ranked(points, asked, limits)
    able = [point for point in points if not limits.excess(point.figures)]
    assert sorted(map(id, kept)) == sorted(map(id, able))
    if kept and asked.penetration is None and (asked.budget or asked.deadline):
        assert kept[0].figures.error <= SAME_PENETRATION * min(point.figures.error for point in able) * (1.0 + 1e-9)
    elif kept:
        assert kept[0].figures.cost == min(point.figures.cost for point in able)
    else:
        worst = {id(point): max(limits.excess(point.figures).values()) for point in points}
        assert worst[id(nearest(points, limits)[0])] == min(worst.values())


@pytest.mark.parametrize("name", ["budget", "penetration", "deadline"])
@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf])
def test_an_impossible_wish_is_refused(name: str, value: float) -> None:
    with pytest.raises(InputError, match=f"--{name} is .* greater than zero"):
        Asked(**{name: value})


def test_numbers_of_the_command_line_are_checked() -> None:
    for words, match in ((["--trials", "0"], "--trials is 0"), (["--seconds", "-1"], "--seconds is -1")):
        options: argparse.Namespace = parser().parse_args(["flat", *words])
        with pytest.raises(InputError, match=match):
            open_search(options)
