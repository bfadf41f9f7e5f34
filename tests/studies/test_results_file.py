"""Results files hold what was found, a record a line."""

from pathlib import Path

from studies.results_file import read_results, save_results

DATA = {
    "quick": False,
    "scenes": {"flat": {"defaults": {"cost": 1.23456789, "spread": [1.0, 2.0], "note": ""}, "other": {"cost": 2.0}}},
    "stability": [{"row": "a", "figure": None}, {"row": "b", "figure": 0.1}],
}


def test_what_is_written_is_read_and_other_entries_stay(tmp_path: Path) -> None:
    path = tmp_path / "found.json"
    assert read_results(path) == {}
    save_results(path, DATA)
    save_results(path, {"quick": True})
    found = read_results(path)
    assert found["scenes"]["flat"]["defaults"] == {"cost": 1.2346, "spread": [1.0, 2.0], "note": ""}
    assert found["stability"] == DATA["stability"]
    assert found["quick"] is True
    lines = [line.strip().rstrip(",") for line in path.read_text().splitlines()]
    assert [line for line in lines if "cost" in line and "{" in line]
    assert len([line for line in lines if line.startswith('{"row"')]) == 2
