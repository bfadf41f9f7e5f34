"""Blocks of pages, which say which code they were measured with."""

import json
from pathlib import Path

import pytest

from smartmesh_ros.errors import InputError
from studies.pages import SUBJECTS, blocks_of, digest, digest_of, fill, main, save, stale_blocks

ROOT = Path(__file__).parents[2]
PAGE = "words\n<!-- generated: one of core, code old -->\nold\n<!-- end -->\nmore\n"


@pytest.fixture
def page(tmp_path: Path) -> Path:
    """A page with one block that was measured with other code."""
    (tmp_path / "a.md").write_text(PAGE)
    return tmp_path / "a.md"


def test_only_marked_blocks_are_replaced_and_note_the_code_and_are_stale_before(
    page: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert [line.split(" (")[0] for line in stale_blocks(page.parent)] == ["a.md: one"]
    assert main(page.parent) == 1
    assert "1 of 1 generated blocks" in capsys.readouterr().out
    fill(page, {"one": "| new |"})
    assert page.read_text() == (
        f"words\n<!-- generated: one of core, code {digest_of('core')} -->\n| new |\n<!-- end -->\nmore\n"
    )
    assert stale_blocks(page.parent) == []
    assert main(page.parent) == 0


def test_a_block_that_is_missing_is_refused_and_nothing_is_written(page: Path) -> None:
    with pytest.raises(InputError, match="no block <!-- generated: two"):
        fill(page, {"one": "new", "two": "nowhere"})
    assert page.read_text() == PAGE


def test_code_counts_and_words_do_not() -> None:
    code = 'def f(x):\n    """Twice."""\n    return 2 * x  # why\n'
    same = 'def f(x):\n    """Return twice the value."""\n\n    return 2 * x\n'
    assert digest({"f.py": code}) == digest({"f.py": same})
    assert digest({"f.py": code}) != digest({"f.py": code.replace("2 *", "3 *")})
    assert digest({"f.py": code}) != digest({"g.py": code})
    compiled = "// Twice.\ndouble f(double x) { return 2 * x; }\n"
    assert digest({"f.cpp": compiled}) == digest({"f.cpp": "double f(double x) {\n  return 2 * x;  // why\n}"})
    assert digest({"f.cpp": compiled}) != digest({"f.cpp": compiled.replace("2 *", "3 *")})


def test_the_subjects_differ_and_every_mark_of_a_page_is_read() -> None:
    assert len({digest_of(subject) for subject in SUBJECTS}) == len(SUBJECTS)
    for page in (ROOT / "docs").glob("*.md"):
        assert page.read_text().count("<!-- generated") == len(blocks_of(page)), page.name


DATA = {
    "quick": False,
    "scenes": {"flat": {"defaults": {"cost": 1.23456789, "spread": [1.0, 2.0], "note": ""}, "other": {"cost": 2.0}}},
    "stability": [{"row": "a", "figure": None}, {"row": "b", "figure": 0.1}],
}


def test_what_is_written_is_read_and_other_entries_stay(tmp_path: Path) -> None:
    path = tmp_path / "found.json"
    save(path, DATA)
    save(path, {"quick": True})
    found = json.loads(path.read_text())
    assert found["scenes"]["flat"]["defaults"] == {"cost": 1.2346, "spread": [1.0, 2.0], "note": ""}
    assert found["stability"] == DATA["stability"]
    assert found["quick"] is True
    lines = [line.strip().rstrip(",") for line in path.read_text().splitlines()]
    assert [line for line in lines if "cost" in line and "{" in line]
    assert len([line for line in lines if line.startswith('{"row"')]) == 2
