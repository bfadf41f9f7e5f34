"""What a search says at its end: which limit binds, what was measured when, and which dots break a limit."""

from typing import Any

import pytest
from smartmesh_ros.tools.tune.front import Point
from smartmesh_ros.tools.tune.store import Store, open_storage
from smartmesh_ros.tools.tune.words import binding, closing_lines

from smartmesh_ros.errors import InputError
from smartmesh_ros.tools.tune import chart, space
from smartmesh_ros.tools.tune.confirm import Verdict
from smartmesh_ros.tools.tune.figures import Asked, Figures, Limits

BASE = Figures(cost=0.2, longest=2e-3, penetration=1e-3, hover=1e-3, deviation=1e-2, bodies=3, ran=1.5)


def figures(**changes: Any) -> Figures:
    return Figures(**{**BASE.as_json(), **changes})


def verdict(asked: Asked, found: Figures, short: Figures) -> Verdict:
    """One setting that was confirmed, beside defaults that were the same in both runs."""
    limits = Limits.of(asked, BASE)
    values = {**space.defaults(), "physics.rate": 120.0}
    return Verdict(
        chosen=Point(values, found), keeps=not limits.excess(found), on_front=False, defaults=BASE, others={},
        limits=limits, searched=limits, short=short, confirmed=(Point(values, found),),
    )  # fmt: skip


def said(asked: Asked, found: Figures, short: Figures, tried: list[Figures]) -> str:
    points = [Point({}, one) for one in tried]
    return "\n".join(closing_lines("The case", asked, verdict(asked, found, short), points, "file.yaml"))


def test_a_limit_that_nobody_asked_for_is_named_with_its_value() -> None:
    asked = Asked(budget=0.1)
    found = figures(cost=0.09, hover=5e-3, ran=3.0)
    words = said(asked, found, figures(cost=0.08, hover=4e-3), [figures(cost=0.08, hover=4e-3), figures(cost=0.5)])
    assert "Not possible here: at most 0.1 of a core" in words
    assert "hover 5 mm (at most 2 mm: twice the defaults', as --hover is not given)" in words
    assert "What binds is the limit of hover: without it 1 of 2 settings would do" in words


def test_limits_that_bind_only_together_are_all_named() -> None:
    asked = Asked(budget=0.1)
    limits = Limits.of(asked, BASE)
    both = figures(cost=0.05, hover=5e-3, deviation=0.5)
    assert binding([both, figures(cost=0.5, hover=9e-3, lost=2)], limits) == ("hover", "deviation")
    assert binding([both, figures(cost=0.05, deviation=0.03)], limits) == ("deviation",)
    assert binding([], limits) == ()


def test_what_held_in_the_search_only_is_said() -> None:
    asked = Asked(penetration=2e-3)
    short = figures(penetration=1.9e-3)
    words = said(asked, figures(penetration=2.2e-3, ran=3.0), short, [short])
    assert "penetration 2.2 mm (at most 2 mm, as asked)" in words
    assert "1 of 1 settings kept it over the 1.5 s of the search, none of the 1 confirmed ones over 3 s" in words


def test_the_figures_of_the_search_stand_beside_the_confirmed_ones() -> None:
    words = said(Asked(), figures(cost=0.12, penetration=9e-4, ran=3.0), figures(cost=0.1, penetration=5e-4), [])
    assert "Chosen: 0.120 of a core (0.100 in the search), 0.9 mm of penetration (0.5 mm in the search)" in words


def test_better_dots_are_explained() -> None:
    tried = [figures(cost=0.1, hover=9e-3), figures(cost=0.1, hover=9e-3, deviation=9.0), figures(cost=0.1, lost=1)]
    words = said(Asked(), figures(cost=0.15, ran=3.0), figures(cost=0.15), tried)
    assert "3 dots are cheaper than the chosen settings without more penetration; 2 break the limit of hover" in words
    assert "1 loses bodies" in words


def test_dots_that_break_a_limit_have_marks_of_their_own() -> None:
    asked = Asked(budget=0.3)
    tried = [
        figures(cost=0.1), figures(cost=0.12, penetration=5e-3, hover=9e-3),
        figures(cost=0.14, penetration=5e-3, deviation=9.0), figures(cost=0.16, penetration=5e-3, lost=2),
        figures(cost=1.0, penetration=4e-3),
    ]  # fmt: skip
    picture = chart.in_terminal([Point({}, one) for one in tried], verdict(asked, BASE, BASE))
    body, legend = picture.split("cost [share of a core]")
    for mark in ("h", "d", "l", ","):
        assert mark in body.split("penetration 99 % [mm]")[1], mark
    assert "h breaks the limit of hover" in legend and "l loses bodies" in legend and "d breaks" in legend
    assert "t breaks" not in legend, "no mark that is not there"


@pytest.mark.parametrize("content", [b"{\n{\n", bytes(range(256)), b'{"op": 99}\n'])
def test_a_storage_that_is_none_is_refused_in_our_words(tmp_path: Any, content: bytes) -> None:
    path = tmp_path / "tune.journal"
    path.write_bytes(content)
    with pytest.raises(InputError, match="no journal of a search, or it is damaged") as refused:
        Store(open_storage(str(path)), "name")
    assert "codec" not in str(refused.value) and "JSON" not in str(refused.value)


@pytest.mark.parametrize("where", ["nosuchsql://x", "sqlite:////no/such/folder/x.db", "mysql://host/x"])
def test_a_database_that_does_not_open_is_refused_in_our_words(where: str) -> None:
    with pytest.raises(InputError, match="does not open") as refused:
        Store(open_storage(where), "name")
    assert not any(word in str(refused.value).lower() for word in ("sqlalche", "plugin", "module", "errno"))
