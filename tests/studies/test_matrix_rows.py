"""Rows of the matrix are seen to fail for methods that are wrong on purpose: what passes everything shows nothing."""

import pytest

from smartmesh_ros.patches.config import PatchConfig
from studies.matrix.run import ROWS

NARROW = PatchConfig(kind="heightfield", rings=1)  # 3 x 3 samples, whatever the body's size
SELDOM = PatchConfig(kind="heightfield", rings=1, rate=1.0)  # the same for a second
HULL = PatchConfig(kind="hull", rings=1)  # what is hollow filled in, and built anew for every update


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
        ("hit to 6 m/s, patches at 4 Hz", HULL),
        ("hit over an edge, patches at 4 Hz", NARROW),
        ("hit against a step", SELDOM),
        ("hit against a step, patches at 4 Hz", NARROW),
    ],
)
def test_what_is_wrong_on_purpose_fails(name: str, wrong: PatchConfig) -> None:
    [row] = [row for row in ROWS if row.name == name]
    assert row.figure(wrong) > row.limit


def test_rows_have_names_of_their_own() -> None:
    assert len({row.name for row in ROWS}) == len(ROWS)
