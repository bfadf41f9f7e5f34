"""The comparison with another checkout: the same code is equal to itself, and the figures are its own."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from smartmesh_ros.errors import InputError
from smartmesh_ros.tools.evaluation.scene import Bodies, Scene
from studies import before_after
from studies.before_after import BEFORE, NOW, compare, same, speed_table
from studies.contest import Result
from studies.engines.checkout import HERE, Checkout, CheckoutOptions
from studies.engines.engine import Setup

DT = 1.0 / 240.0
SMALL = Scene(
    name="small", title="Small", ground={"kind": "waves", "amplitude": 0.25, "number": 1.5, "frequency": 4.0},
    grid=(41, 0.25), bodies=Bodies(count=3, spread=(2.0, 2.0)), map_rate=60.0, duration=0.5, settle=0.25,
    samples=24.0, reference="none",
)  # fmt: skip


def test_the_same_code_is_equal_to_itself_and_the_table_says_so() -> None:
    found = compare(SMALL, {BEFORE: HERE, NOW: HERE}, "auto", lambda line: None)
    assert same(found[BEFORE], found[NOW])
    assert found[NOW].p99 >= 0.0 and found[NOW].lost == 0
    assert 0.0 < found[NOW].update < found[NOW].cost
    assert speed_table({"Small": found}).endswith("| yes |")
    other = replace(found[NOW], p99=found[NOW].p99 + 1e-9)
    assert speed_table({"Small": {BEFORE: found[BEFORE], NOW: other}}).endswith("| no |")


def test_times_do_not_make_results_differ() -> None:
    result = Result(cost=2.0, update=1.0, p99=0.001)
    assert same(result, replace(result, cost=3.0, spread=(1.0, 4.0), update=0.5))
    assert not same(result, replace(result, lost=1))


def test_a_folder_without_the_package_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="holds no smartmesh_ros"):
        Checkout(Setup(heights=np.zeros((9, 9)), resolution=0.5, bodies=[], dt=DT), CheckoutOptions(folder=tmp_path))


def test_code_that_cannot_run_a_scene_says_why(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(before_after, "read_scenes", lambda: [SMALL])
    options = ["--before", str(HERE), "--scenes", "small", "--kind", "jelly", "--out", str(tmp_path)]
    assert before_after.main(options) == 2
    assert "jelly" in capsys.readouterr().err
