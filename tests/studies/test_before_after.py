"""The comparison with another checkout: both sides run what they are told, and the figures are theirs."""

from dataclasses import replace
from pathlib import Path

import pytest

import smartmesh_ros
from smartmesh_ros.errors import InputError
from studies.before_after.case import CASES, cases
from studies.before_after.contest import Calls, Compared, Figures, compare
from studies.before_after.robots import (
    RobotCase,
    RobotFigures,
    RobotsCompared,
    compare_robots,
    robot_cases,
    robots_missed,
)
from studies.before_after.side import Side
from studies.before_after.tables import missed, speed_table
from studies.robots.robot import HUSKY

HERE = Path(smartmesh_ros.__file__).parents[1]
[BALLS] = [case for case in CASES if case.name == "waves_10"]


@pytest.mark.parametrize("driver", ["ground", "world"])
def test_the_same_code_is_equal_to_itself(tmp_path: Path, driver: str) -> None:
    case = replace(BALLS, driver=driver, count=3, seconds=0.5, settle=0.25, calls=True)  # type: ignore[arg-type]
    [found] = compare({"before": HERE, "now": HERE}, [case], 1, tmp_path, lambda line: None)
    assert found.before.p99 == found.now.p99 >= 0.0
    assert (found.before.lost, found.now.lost, found.now.note) == (0, 0, "")
    assert 0.2 < found.speed_up < 5.0
    assert found.now.update > 0.0 and found.now.step > 0.0
    # Position and velocity of each body are read at least.
    assert found.now.calls is not None and found.now.calls.calls >= 2.0
    assert 0.0 < found.now.calls.own < 10.0 * found.now.update


def test_every_case_has_its_own_name_and_the_quick_run_has_some_of_them() -> None:
    assert {case.name for case in cases(quick=True)} < {case.name for case in cases(quick=False)}
    assert len({case.name for case in CASES}) == len(CASES)


def test_a_folder_without_the_package_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="holds no smartmesh_ros"):
        Side(tmp_path)


def test_code_that_cannot_run_a_case_leaves_its_side_empty(tmp_path: Path) -> None:
    case = replace(BALLS, count=1, seconds=0.5, kind="no such kind")
    [found] = compare({"before": HERE, "now": HERE}, [case], 1, tmp_path, lambda line: None)
    assert "no such kind" in found.before.note
    assert "did not run" in speed_table([found])
    assert len(missed([found])) == 2


def test_what_was_asked_for_and_is_not_there_is_said() -> None:
    before = Figures(update=10.0, step=5.0, p99=1.0)
    case = replace(BALLS, to_reach=4.0, deepest=0.002)
    good = Figures(update=2.0, step=5.0, p99=1.04, calls=Calls(own=1.0, else_=0.4, calls=4.0))
    assert missed([Compared(case=case, before=before, now=good)]) == []
    bad = Figures(update=5.0, step=5.0, p99=2.5, lost=1, calls=Calls(own=1.0, else_=0.6, calls=4.0))
    assert len(missed([Compared(case=case, before=before, now=bad)])) == 5


def test_robots_of_the_same_code_have_the_same_fields_and_a_whole_map_has_none(tmp_path: Path) -> None:
    case = RobotCase(robot=HUSKY, resolution=0.1, moving=True, seconds=0.5, settle=0.25)
    [found] = compare_robots({"before": HERE, "now": HERE}, [case], 1, tmp_path, lambda line: None)
    assert found.before.wheel == found.now.wheel >= 4.0
    assert found.now_whole.wheel != found.now_whole.wheel, "no number"
    for figures in (found.before, found.now, found.before_whole, found.now_whole):
        assert figures.step > 0.0 and figures.own > 0.0 and not figures.note


def test_a_robot_case_that_misses_its_targets_says_each() -> None:
    before, whole = RobotFigures(step=400.0, own=100.0, wheel=289.0), RobotFigures(step=500.0, own=0.0)
    [case] = [case for case in robot_cases() if case.name == "husky_4cm_rest_auto"]

    def compared(now: RobotFigures) -> RobotsCompared:
        return RobotsCompared(case=case, before=before, now=now, before_whole=whole, now_whole=whole)

    assert robots_missed([compared(RobotFigures(step=250.0, own=40.0, wheel=25.0))]) == []
    assert len(robots_missed([compared(before)])) == 3
    assert len({case.name for case in robot_cases()}) == len(robot_cases()) == 8
