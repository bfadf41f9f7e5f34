"""Which point is chosen, and what a search says at its end: which limit binds, what was measured when."""

import argparse
import math
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from optuna.distributions import IntDistribution
from optuna.trial import create_trial

from smartmesh_ros.errors import InputError
from smartmesh_ros.tools.tune import chart, space
from smartmesh_ros.tools.tune.cli import parser
from smartmesh_ros.tools.tune.confirm import SAME_PENETRATION, Verdict, nearest, ranked
from smartmesh_ros.tools.tune.figures import Asked, Figures, Limits, Point
from smartmesh_ros.tools.tune.report import binding, closing_lines
from smartmesh_ros.tools.tune.search import BASE, FIGURES, VALUES, Search, open_study
from smartmesh_ros.tools.tune.session import open_case, open_search
from tests.examples import examples

BASE_FIGURES = Figures(cost=0.2, longest=2e-3, penetration=1e-3, hover=1e-3, deviation=1e-2)
VALUES_TRIED = {**space.defaults(), "physics.rate": 120.0}


def figures(**changes: Any) -> Figures:
    return replace(BASE_FIGURES, **changes)


def verdict(asked: Asked, found: Figures, short: Figures) -> Verdict:
    """One setting that was confirmed, beside defaults that were the same in both runs."""
    limits, chosen = Limits.of(asked, BASE_FIGURES), Point(VALUES_TRIED, found)
    defaults = Point(space.defaults(), BASE_FIGURES)
    return Verdict(
        chosen=chosen, keeps=not limits.excess(found), limits=limits, short=short, others={},
        confirmed=(chosen, defaults),
    )  # fmt: skip


def a_search(folder: Path, asked: Asked, tried: list[Figures]) -> Search:
    study = open_study(str(folder / "tune.journal"), "case", None)
    study.set_user_attr(BASE, asdict(BASE_FIGURES))
    for one in tried:
        attributes = {VALUES: VALUES_TRIED, FIGURES: asdict(one)}
        study.add_trial(
            create_trial(
                values=[one.cost, one.error], user_attrs=attributes, params={"a": 0},
                distributions={"a": IntDistribution(0, 1)},
            )
        )  # fmt: skip
    return Search(open_case(parser().parse_args(["flat"])), asked, study)


def said(folder: Path, asked: Asked, found: Figures, short: Figures, tried: list[Figures]) -> str:
    return "\n".join(closing_lines(a_search(folder, asked, tried), verdict(asked, found, short)))


def test_a_limit_that_nobody_asked_for_is_named_with_its_value(tmp_path: Path) -> None:
    asked = Asked(budget=0.1)
    tried = [figures(cost=0.08, hover=4e-3), figures(cost=0.5)]
    words = said(tmp_path, asked, figures(cost=0.09, hover=5e-3), figures(cost=0.08, hover=4e-3), tried)
    assert "Not possible here: cost at most 0.1 of a core" in words
    assert "hover 5 mm (at most 2 mm: twice the defaults', as --hover is not given)" in words
    assert "What binds in the search is the limit of hover: without it the others could be met" in words


def test_limits_that_bind_only_together_are_all_named() -> None:
    limits = Limits.of(Asked(budget=0.1), BASE_FIGURES)
    both = Point({}, figures(cost=0.05, hover=5e-3, deviation=0.5))
    assert binding([both, Point({}, figures(cost=0.5, hover=9e-3, lost=2))], limits) == ("hover", "deviation")
    assert binding([both, Point({}, figures(cost=0.05, deviation=0.03))], limits) == ("deviation",)
    assert binding([], limits) == ()


def test_what_held_in_the_search_only_is_said(tmp_path: Path) -> None:
    short = figures(penetration=1.9e-3)
    words = said(tmp_path, Asked(penetration=2e-3), figures(penetration=2.2e-3), short, [short])
    assert "penetration 2.2 mm (at most 2 mm, as asked)" in words
    assert "1 of 1 settings kept it in the search, none of the best ones for longer" in words


def test_the_figures_of_the_search_stand_beside_the_confirmed_ones(tmp_path: Path) -> None:
    found, short = figures(cost=0.12, penetration=9e-4), figures(cost=0.1, penetration=5e-4)
    words = said(tmp_path, Asked(), found, short, [])
    [mine, searched] = [line.split() for line in words.split("\n")[1:3]]
    assert mine[:6] == ["this", "file", "0.12", "of", "a", "core"] and "0.9" in mine
    assert searched[:7] == ["in", "the", "search", "0.1", "of", "a", "core"] and "0.5" in searched


def test_dots_that_exceed_a_limit_have_colours_of_their_own(tmp_path: Path) -> None:
    asked = Asked(budget=0.3)
    tried = [
        figures(cost=0.1), figures(cost=0.12, penetration=5e-3, hover=9e-3),
        figures(cost=0.14, penetration=5e-3, deviation=9.0), figures(cost=0.16, penetration=5e-3, lost=2),
        figures(cost=1.0, penetration=4e-3),
    ]  # fmt: skip
    search = a_search(tmp_path, asked, tried)
    axes = chart.draw(tmp_path / "chart.png", search, verdict(asked, BASE_FIGURES, BASE_FIGURES))
    dots = {line.get_label(): len(line.get_xdata()) for line in axes.get_lines()}
    assert dots["tried"] == 2
    assert dots["exceeds the limit of hover"] == dots["exceeds the limit of deviation"] == 1
    assert dots["exceeds the limit of bodies lost or put back"] == 1
    assert "exceeds the limit of the longest step" not in dots, "no mark that is not there"


@pytest.mark.parametrize("content", [b"{\n{\n", bytes(range(256)), b'{"op": 99}\n'])
def test_a_storage_that_is_none_is_refused_in_our_words(tmp_path: Any, content: bytes) -> None:
    path = tmp_path / "tune.journal"
    path.write_bytes(content)
    with pytest.raises(InputError, match="no journal of a search, or it is damaged") as refused:
        open_study(str(path), "name", None)
    assert "codec" not in str(refused.value) and "JSON" not in str(refused.value)


@pytest.mark.parametrize("where", ["nosuchsql://x", "sqlite:////no/such/folder/x.db", "mysql://host/x"])
def test_a_database_that_does_not_open_is_refused_in_our_words(where: str) -> None:
    with pytest.raises(InputError, match="does not open") as refused:
        open_study(where, "name", None)
    assert not any(word in str(refused.value).lower() for word in ("sqlalche", "plugin", "module", "errno"))


COSTS = st.floats(1e-3, 10.0)
LENGTHS = st.floats(0.0, 0.1)
ANY_FIGURES = st.builds(
    Figures, cost=COSTS, longest=st.floats(1e-5, 0.1), penetration=LENGTHS | st.just(math.nan), hover=LENGTHS,
    deviation=LENGTHS | st.just(math.nan), lost=st.integers(0, 2),
)  # fmt: skip
POINTS = st.lists(st.builds(lambda figures: Point({}, figures), ANY_FIGURES), min_size=1, max_size=30)
WANTED = st.none() | st.floats(1e-4, 1.0)
ASKED = st.builds(Asked, budget=WANTED, penetration=WANTED, deadline=WANTED, hover=WANTED, deviation=WANTED)


@given(POINTS, ASKED, ANY_FIGURES)
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
