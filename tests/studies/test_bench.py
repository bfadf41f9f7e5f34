"""The bench runs from end to end, and what it writes says what it measured."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import pytest

from studies.bench import study
from studies.bench.measure import QUICK, Bench, Case, Effort
from studies.pages import number, times


def test_a_quick_run_writes_every_kind_of_figure_and_a_table_for_each_of_the_reports(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of two frames a case."""
    monkeypatch.setattr(study, "QUICK", replace(QUICK, frames=2, seconds=0.0))
    assert study.main(["--quick", "--out", str(tmp_path)]) == 0
    data = json.loads((tmp_path / study.RESULTS).read_text())
    assert set(data["machine"]) == {"cores", "cpu", "load", "versions"}
    measured = {entry["what"] for entry in data["timings_us"]}
    assert measured >= {"simple", "smart", "local", "search", "search_map", "collect", "update", "ingest"}
    for entry in data["timings_us"]:
        assert 0.0 < entry["low"] <= entry["median"] <= entry["high"]
    tables = (tmp_path / study.TABLES).read_text()
    assert all(f"### Table {index}:" in tables for index in range(1, 7))


def test_each_run_is_prepared_and_enough_frames_are_measured() -> None:
    calls: list[str] = []
    bench = Bench(Effort(frames=7, least=2))
    case = Case("a", "first")
    assert bench.time(case, lambda: calls.append("1"), lambda: calls.append("p")).frames == 7
    text = "".join(calls)
    assert text == "p1" * (len(text) // 2)
    bench = Bench(Effort(frames=1000, least=3, seconds=0.0))
    assert bench.time(case, lambda: None).frames == 3


def test_what_was_not_measured_is_no_figure() -> None:
    assert math.isnan(Bench().us("simple", "physx", side=3))
    assert number(math.nan) == times(math.nan) == "-"
