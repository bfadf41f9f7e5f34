"""The defaults pass rows of the matrix, which fail for methods that are wrong on purpose."""

import pytest

from studies.matrix import moving_ground, still_ground, touching
from studies.matrix.run import ROWS, run_cell
from studies.report.config import ReportConfig

NARROW = ReportConfig(kind="heightfield", rings=1)  # 3 x 3 samples, whatever the body's size
SELDOM = ReportConfig(kind="heightfield", rings=1, rate=1.0)  # the same for a second
HULL = ReportConfig(kind="hull", rings=1)  # what is hollow filled in, and built anew for every update
UNCARRIED = ReportConfig(carry_velocity=False)
# All rows that take no longer than a few seconds.
WHOLE = {row.name for part in (still_ground, moving_ground, touching) for row in part.ROWS}
BY_DEFAULTS = [row.name for row in ROWS if row.quick or row.name in WHOLE]
# Rows on ground that moves or changes, for height fields of PyBullet; of two rows of waves the harder one.
MOVING = {row.name for row in moving_ground.ROWS} | {"T4 raised above all before"}
BY_FIELDS = [row.name for row in ROWS if row.quick and row.name in MOVING - {"waves, w = 4"}]


@pytest.mark.parametrize(
    ("name", "method", "passes"),
    [
        *((name, "defaults", True) for name in BY_DEFAULTS), *((name, "heightfield", True) for name in BY_FIELDS),
        *((name, "rebuilt trimesh", False) for name in ("T1 sliding box", "T5 ground rising, 3 m/s")),
    ],
)  # fmt: skip
def test_what_is_right_passes_and_the_reports_collider_fails(name: str, method: str, passes: bool) -> None:
    [row] = [row for row in ROWS if row.name == name]
    outcome = run_cell(row, method)
    assert outcome.passed is passes, outcome


@pytest.mark.parametrize(
    ("name", "wrong"),
    [
        ("ball on the corner of four cells", HULL),
        ("small box on the corner of four cells", HULL),
        ("rolling along a seam", HULL),
        ("rolling over corners of cells", SELDOM),
        ("box across a valley, cells of 1 and 0.1 m", NARROW),
        ("box across a ridge, cells of 1 and 0.1 m", SELDOM),
        ("a bar that spins into a wall", NARROW),
        ("ball on the lips of a trench", NARROW),
        ("one of them sinks away", NARROW),
        ("long thin box on fine noise", NARROW),
        ("hit to 6 m/s, colliders at 4 Hz", HULL),
        ("hit over an edge, colliders at 4 Hz", NARROW),
        ("hit against a step", SELDOM),
        ("hit against a step, colliders at 4 Hz", NARROW),
        ("T5 ground rising, 3 m/s", UNCARRIED),
        ("T5 ground sliding, 0.5 m/s", UNCARRIED),
        ("waves, w = 16", SELDOM),
    ],
)
def test_what_is_wrong_on_purpose_fails(name: str, wrong: ReportConfig) -> None:
    [row] = [row for row in ROWS if row.name == name]
    assert row.figure(wrong) > row.limit
