"""Which point is chosen, and what is said at the end: which limit binds."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from smartmesh_ros.tools.tune.case import Case
from smartmesh_ros.tools.tune.chart import draw
from smartmesh_ros.tools.tune.figures import SAME_PENETRATION, Figures, best, binding, excess, front, limits_of
from smartmesh_ros.tools.tune.grid import KNOWN
from smartmesh_ros.tools.tune.report import Result, parameter_file
from tests.examples import examples

BASE = Figures(values=KNOWN, cost=0.2, longest=2e-3, penetration=1e-3, hover=1e-3, deviation=1e-2)
CASE = Case(source=Path("flat.yaml"), title="Flat", length=1.0, settle=0.1, remaps=[("~/heightmap", "/maps")])
OTHER = {**KNOWN, "physics.rate": 120.0}


def figures(**changes: Any) -> Figures:
    return replace(BASE, **changes)


def result(asked: dict[str, float], *tried: Figures) -> Result:
    return Result(CASE, asked, [BASE, *(replace(one, values=OTHER) for one in tried)])


def test_what_is_better_is_chosen_and_a_limit_that_binds_is_named() -> None:
    """Also one that nobody asked for, with its value, and all that bind only together."""
    found = result({}, figures(cost=0.1))
    text = parameter_file(found)
    assert found.keeps and found.changed == {"physics.rate": 120.0} and "Kept." in text
    assert "Changed: physics.rate 120.0 (default 240.0)." in text and "-r '~/heightmap:=/maps'" in text
    found = result({"cost": 0.1}, figures(cost=0.09, hover=6e-3), figures(cost=0.5))
    text = parameter_file(found)
    said = text.replace("\n# ", " ")
    assert not found.keeps and "NOT POSSIBLE: the nearest settings exceed the limits of cost." in said
    [most, nearest] = [next(line for line in text.splitlines() if row in line) for row in ("at most", "this file")]
    assert "0.1 of a core" in most and "0.2 of a core" in nearest, "the defaults are nearest"
    assert "What binds is the limit of cost" in said or "What binds is the limit of hover" in said
    limits, both = limits_of({"cost": 0.1}, BASE), figures(cost=0.05, hover=5e-3, deviation=0.5)
    assert binding([both, figures(cost=0.5, hover=9e-3, failed=2)], limits) == ("hover", "deviation")
    assert binding([both, figures(cost=0.05, deviation=0.03)], limits) == ("deviation",)


def test_the_chart_shows_what_was_tried(tmp_path: Path) -> None:
    tried = [figures(cost=0.1), figures(cost=0.12, penetration=5e-3, hover=9e-3), figures(penetration=math.nan)]
    axes = draw(tmp_path / "chart.png", result({"cost": 0.3}, *tried))
    dots = {line.get_label(): len(line.get_xdata()) for line in axes.get_lines()}
    assert (dots["tried"], dots["defaults"], dots["chosen"]) == (3, 1, 1), "but what could not be measured"


COSTS = st.floats(1e-3, 10.0)
LENGTHS = st.floats(0.0, 0.1)
ANY_FIGURES = st.builds(
    Figures, cost=COSTS, longest=st.floats(1e-5, 0.1), penetration=LENGTHS | st.just(math.nan), hover=LENGTHS,
    deviation=LENGTHS | st.just(math.nan), failed=st.integers(0, 2),
)  # fmt: skip
POINTS = st.lists(ANY_FIGURES, min_size=1, max_size=30)
ASKED = st.dictionaries(st.sampled_from(["cost", "penetration", "longest"]), st.floats(1e-4, 1.0))


@given(POINTS, ASKED, ANY_FIGURES)
@examples(100)
def test_none_that_keeps_the_limits_is_better(points: list[Figures], asked: dict[str, float], base: Figures) -> None:
    limits = limits_of(asked, base)
    chosen = best(points, asked, limits)
    able = [point for point in points if not excess(point, limits)]
    if not able:
        worst = [max(excess(one, limits).values()) for one in (chosen, *points)]
        assert worst[0] == min(worst)
        return
    assert chosen.cost <= asked.get("cost", math.inf) and chosen.longest <= asked.get("longest", math.inf)
    assert chosen.penetration <= asked.get("penetration", math.inf)
    assert chosen.failed <= base.failed
    if asked and "penetration" not in asked:
        assert chosen.error <= SAME_PENETRATION * min(one.error for one in able) * (1.0 + 1e-9)
    else:
        assert chosen.cost == min(one.cost for one in able)


@given(POINTS)
@examples(100)
def test_no_point_beats_one_of_the_front(points: list[Figures]) -> None:
    found = [(one.cost, one.error) for one in front(points)]
    for cost, error in found:
        as_good = {(one.cost, one.error) for one in points if one.cost <= cost and one.error <= error}
        assert as_good == {(cost, error)}
