"""The tables of docs/performance.md."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

from studies.load.summary import UPDATE, Summary
from studies.markdown import table

# The page of the load study and the soak, and the folder of its pictures and what they show.
PAGE, PICTURES = Path("docs/performance.md"), Path("docs/images/load")


def runs(summaries: list[Summary]) -> str:
    """All runs of one group."""
    head = [
        "bodies", "map", "input", "physics [Hz]", "whole step 50 / 99 % [ms]", "update a step [ms]",
        "`stepSimulation` [ms]", "markers [ms]", "ingest [ms]", "real-time factor", "late 50 / 99 / 100 % [ms]",
        "missed", "in to out 50 / 99 / 100 % [ms]", "lost", "CPUs", "memory [MiB]",
    ]  # fmt: skip
    return table(head, [_run(summary) for summary in summaries])


def executors(summaries: list[Summary]) -> str:
    """Ways to run the loop, side by side."""
    head = ["way", "bodies", "map", "physics [Hz]", "real-time factor", "missed", "late 50 / 99 / 100 % [ms]",
            "markers [ms]", "ingest [ms]", "in to out 50 / 99 / 100 % [ms]", "CPUs", "lost"]  # fmt: skip
    rows = [
        [
            s.case.executor, str(s.case.bodies), f"{s.case.side}^2", f"{s.case.physics_rate:g}",
            f"{s.real_time_factor:.2f}", f"{100 * s.missed:.2f} %", _three(s.stage("lateness")),
            _ms(s.stage("publish")[0]), _ms(s.stage("ingest")[0]), _three(s.latency),
            f"{s.result['cpus']['node']:.2f}", _lost(s),
        ]
        for s in summaries
    ]  # fmt: skip
    return table(head, rows)


def memory(summaries: list[Summary]) -> str:
    """Memory against the map's size."""
    head = ["map", "input", "map's bytes [MiB]", "resident [MiB]", "of that shared with DDS", "peak [MiB]"]  # fmt: skip
    rows = []
    for s in summaries:
        size = 4.0 * s.case.side**2 / 2**20
        m = s.memory
        rows.append([f"{s.case.side}^2", s.case.mode, f"{size:.1f}", f"{m['resident']:.0f}", f"{m['shared']:.0f}",
                     f"{m['peak']:.0f}"])  # fmt: skip
    return table(head, rows)


def targets(groups: dict[str, list[Summary]]) -> str:
    """Return the table of targets, which the study prints and no page shows."""
    grid = groups["grid"]

    def find(bodies: int, rate: float, side: int = 1024, mode: str = "regions") -> Summary | None:
        found = [s for s in grid if (s.case.bodies, s.case.physics_rate, s.case.side, s.case.mode)
                 == (bodies, rate, side, mode)]  # fmt: skip
        return max(found, key=lambda s: s.case.map_rate) if found else None

    lines = []

    def add(what: str, summary: Summary | None, measure: Callable[[Summary], float], most: float, unit: str) -> None:
        value = measure(summary) if summary else math.nan
        verdict = "not measured" if math.isnan(value) else "reached" if value <= most else "**missed**"
        lines.append([what, f"{most:.3g} {unit}", f"{value:.3g} {unit}", verdict])

    hundred, thousand = find(100, 240.0), find(1000, 60.0)
    for name, s, most, markers in (
        ("100 bodies, 240 Hz", hundred, 2.0, 0.3),
        ("1000 bodies, 60 Hz", thousand, 14.0, 2.0),
    ):
        step = s.stage("step")[0] if s else 0.0
        add(f"{name}: update and step, median", s, lambda s: s.stage("total")[0], most, "ms")
        add(f"{name}: the same, from the medians of its stages", s, lambda s: s.update_and_step, most, "ms")
        add(f"{name}: missed deadlines", s, lambda s: 100 * s.missed, 0.1, "%")
        add(f"{name}: markers built and published, median", s, lambda s: s.stage("publish")[0], markers, "ms")
        add(f"{name}: processor time a step of everything but `stepSimulation`", s,
            lambda s: s.cpu_per_step - s.stage("step")[0], step, "ms")  # fmt: skip
        add(f"{name}: the same without search, collect and collider", s,
            _ros_side, step, "ms")  # fmt: skip
    full = find(100, 240.0, mode="full")
    add("full 1024^2 map taken, median", full, lambda s: s.stage("ingest")[0], 2.0, "ms")
    add("64^2 region taken, median", hundred, lambda s: s.stage("ingest")[0], 0.2, "ms")
    add("region in to marker out, 100 bodies, 99 %", hundred, lambda s: s.latency[1] if s.latency else math.nan, 10.0,
        "ms")  # fmt: skip
    for mode, what in (("full", "full 4096^2 maps at 5 Hz"), ("regions", "regions of 4096^2 at 60 Hz")):
        add(f"{what}: lost", find(100, 240.0, 4096, mode), lambda s: s.lost, 0.0, "messages")
    return table(["figure", "at most", "measured", ""], lines)


def _ros_side(s: Summary) -> float:
    """Processor time a step without patches and physics [ms]; NaN where waiting for a processor hides it in them."""
    rest = s.cpu_per_step - s.update_and_step
    return rest if rest >= 0.0 else math.nan


def _run(s: Summary) -> list[str]:
    return [
        str(s.case.bodies), f"{s.case.side}^2", f"{s.case.mode} at {s.case.map_rate:g} Hz", f"{s.case.physics_rate:g}",
        " / ".join(map(_ms, s.stage("total")[:2])), _ms(s.a_step(*UPDATE)), _ms(s.stage("step")[0]),
        _ms(s.stage("publish")[0]), _ms(s.stage("ingest")[0]), f"{s.real_time_factor:.2f}",
        _three(s.stage("lateness")), f"{100 * s.missed:.2f} %", _three(s.latency), _lost(s),
        f"{s.result['cpus']['node']:.2f}", f"{s.memory['resident']:.0f}",
    ]  # fmt: skip


def _lost(s: Summary) -> str:
    return f"{s.lost} of {s.result['sent']}"


def _ms(value: float) -> str:
    return f"{value:.3g}" if math.isfinite(value) else "-"


def _three(values: tuple[float, float, float] | None) -> str:
    return " / ".join(_ms(value) for value in values) if values else "-"
