"""Which point is chosen, and what is said at the end: which limit binds."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from smartmesh_ros.errors import InputError
from smartmesh_ros.tools.tune.case import Case
from smartmesh_ros.tools.tune.chart import draw
from smartmesh_ros.tools.tune.figures import Asked, Figures, Limits, Point
from smartmesh_ros.tools.tune.grid import (
    GRID,
    KNOWN,
    SAME_PENETRATION,
    Measured,
    front,
    nearest,
    ranked,
    settings_to_try,
)
from smartmesh_ros.tools.tune.report import Result, binding, closing_lines, parameter_file
from tests.examples import examples

BASE = Figures(cost=0.2, longest=2e-3, penetration=1e-3, hover=1e-3, deviation=1e-2)
CASE = Case(source=Path("flat.yaml"), title="Flat", length=1.0, settle=0.1, remaps=[("~/heightmap", "/maps")])
OTHER = {**KNOWN, "physics.rate": 120.0}


def figures(**changes: Any) -> Figures:
    return replace(BASE, **changes)


def result(asked: Asked, *tried: Figures) -> Result:
    defaults = Point(KNOWN, BASE)
    return Result(CASE, asked, Measured(points=[defaults, *(Point(OTHER, one) for one in tried)], defaults=defaults))


def test_what_is_better_is_chosen_and_said() -> None:
    found = result(Asked(), figures(cost=0.1))
    assert found.keeps and found.changed == {"physics.rate": 120.0}
    said = "\n".join(closing_lines(found))
    assert "Kept." in said and "0.50 times the cost" in said and "Changed: physics.rate 120.0." in said
    text = parameter_file(found)
    assert "physics.rate (default 240.0)" in text and "-r ~/heightmap:=/maps" in text


def test_a_limit_that_nobody_asked_for_is_named_with_its_value() -> None:
    found = result(Asked(budget=0.1), figures(cost=0.09, hover=6e-3), figures(cost=0.5))
    said = "\n".join(closing_lines(found))
    assert not found.keeps and "NOT POSSIBLE" in parameter_file(found)
    assert "Not possible here: cost at most 0.1 of a core" in said
    assert "cost 0.2 of a core (at most 0.1 of a core, as asked)" in said, "the defaults are nearest"
    assert "What binds is the limit of cost" in said or "What binds is the limit of hover" in said


def test_limits_that_bind_only_together_are_all_named() -> None:
    limits = Limits.of(Asked(budget=0.1), BASE)
    both = Point({}, figures(cost=0.05, hover=5e-3, deviation=0.5))
    assert binding([both, Point({}, figures(cost=0.5, hover=9e-3, lost=2))], limits) == ("hover", "deviation")
    assert binding([both, Point({}, figures(cost=0.05, deviation=0.03))], limits) == ("deviation",)
    assert binding([], limits) == ()


def test_dots_that_exceed_a_limit_have_colours_of_their_own(tmp_path: Path) -> None:
    tried = [
        figures(cost=0.1), figures(cost=0.12, penetration=5e-3, hover=9e-3),
        figures(cost=0.14, penetration=5e-3, deviation=9.0), figures(cost=0.16, penetration=5e-3, lost=2),
        figures(cost=1.0, penetration=4e-3),
    ]  # fmt: skip
    axes = draw(tmp_path / "chart.png", result(Asked(budget=0.3), *tried))
    dots = {line.get_label(): len(line.get_xdata()) for line in axes.get_lines()}
    assert dots["tried"] == 3
    assert dots["exceeds the limit of hover"] == dots["exceeds the limit of deviation"] == 1
    assert dots["exceeds the limit of bodies lost or put back"] == 1
    assert "exceeds the limit of the longest step" not in dots, "no mark that is not there"


def test_the_users_settings_are_tried_beside_the_grid() -> None:
    size = math.prod(map(len, GRID.values()))
    assert len(settings_to_try({})) == len(settings_to_try({"physics.rate": 120.0, "bodies.timeout": 5.0})) == size
    assert settings_to_try({"physics.rate": 100})[-1] == {**KNOWN, "physics.rate": 100.0}


COSTS = st.floats(1e-3, 10.0)
LENGTHS = st.floats(0.0, 0.1)
ANY_FIGURES = st.builds(
    Figures, cost=COSTS, longest=st.floats(1e-5, 0.1), penetration=LENGTHS | st.just(math.nan), hover=LENGTHS,
    deviation=LENGTHS | st.just(math.nan), lost=st.integers(0, 2),
)  # fmt: skip
POINTS = st.lists(st.builds(lambda figures: Point({}, figures), ANY_FIGURES), min_size=1, max_size=30)
WANTED = st.none() | st.floats(1e-4, 1.0)
ASKED = st.builds(Asked, budget=WANTED, penetration=WANTED, deadline=WANTED)


@given(POINTS, ASKED, ANY_FIGURES)
@examples(100)
def test_what_is_chosen_keeps_everything_that_is_asked(points: list[Point], asked: Asked, base: Figures) -> None:
    for chosen in ranked(points, asked, Limits.of(asked, base))[:1]:
        found = chosen.figures
        assert found.cost <= (asked.budget or math.inf)
        assert found.penetration <= (asked.penetration or math.inf)
        assert found.longest <= (asked.deadline or math.inf)
        assert found.failed <= base.failed


@given(POINTS, ASKED, ANY_FIGURES)
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


@given(POINTS)
@examples(100)
def test_no_point_beats_one_of_the_front(points: list[Point]) -> None:
    found = [(one.figures.cost, one.figures.error) for one in front(points)]
    for cost, error in found:
        assert not any(
            (one.figures.cost < cost and one.figures.error <= error)
            or (one.figures.cost <= cost and one.figures.error < error)
            for one in points
        )


@pytest.mark.parametrize("name", ["budget", "penetration", "deadline"])
@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf])
def test_an_impossible_wish_is_refused(name: str, value: float) -> None:
    with pytest.raises(InputError, match=f"--{name} is .* greater than zero"):
        Asked(**{name: value})
