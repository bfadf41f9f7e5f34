"""The comparison as Markdown."""

from __future__ import annotations

import math
from collections.abc import Sequence

from studies.before_after.contest import Compared, Figures
from studies.tables import table

# Tolerances within which penetration counts as no worse.
MORE_BY_SHARE, MORE_BY_MM = 1.1, 0.05
# Maximum time of everything but PyBullet's own calls, as a fraction of those [-].
SHARE_TO_REACH = 0.5


def speed_table(compared: Sequence[Compared]) -> str:
    """Return a table with a row a case: update and step before and now, penetration, and targets."""
    rows = []
    for one in compared:
        case, before, now = one.case, one.before, one.now
        asked = "-" if case.to_reach is None else f"{case.to_reach:g}"
        rows.append(
            [
                case.title, _with_quartiles(before), _with_quartiles(now), _ratio(one), asked,
                _pair(before.step, now.step), _pair(before.longest, now.longest),
                _depths(one), f"{before.lost} / {now.lost}",
            ]
        )  # fmt: skip
    header = [
        "case", "update before [us]", "now [us]", "before / now", "to reach", "stepSimulation, before / now [us]",
        "update of a whole step, 99 % [ms]", "penetration, 99 % [mm]", "lost",
    ]  # fmt: skip
    return table(header, rows)


def calls_table(compared: Sequence[Compared]) -> str:
    """Return a table of the time of PyBullet's own calls in an update on a new map."""
    rows = []
    for one in compared:
        for side, figures in (("before", one.before), ("now", one.now)):
            calls = figures.calls
            if calls is not None:
                rows.append(
                    [
                        f"{one.case.title}, {side}", f"{calls.calls:.2f}", f"{calls.own:.2f}", f"{calls.else_:.2f}",
                        f"{calls.share:.2f}", f"{SHARE_TO_REACH:g}",
                    ]
                )  # fmt: skip
    header = [
        "steps in which a map comes", "PyBullet's own calls a body", "what they take [us]", "all else [us]",
        "all else / own calls", "to reach",
    ]  # fmt: skip
    return table(header, rows)


def kinds_table(compared: Sequence[Compared]) -> str:
    """*auto* against plain heightfields on each side, update and step together."""
    known = {one.case.name: one for one in compared}
    rows = []
    for name, auto in known.items():
        plain = known.get(f"{name}_heightfield")
        if plain is not None:
            ratios = [
                (mine.update + mine.step) / (theirs.update + theirs.step)
                for mine, theirs in ((auto.before, plain.before), (auto.now, plain.now))
            ]
            rows.append([auto.case.title, *(f"{ratio:.2f}" for ratio in ratios)])
    return table(["auto / heightfield, update and step", "before", "now"], rows)


def missed(compared: Sequence[Compared]) -> list[str]:
    """Return the missed targets as texts."""
    found = []
    for one in compared:
        case, before, now = one.case, one.before, one.now
        for side, figures in (("before", before), ("now", now)):
            if figures.note:
                found.append(f"{case.title}: {side} did not run: {figures.note.splitlines()[-1]}")
        if case.to_reach is not None and one.speed_up < case.to_reach:
            found.append(f"{case.title}: {one.speed_up:.2f} times as fast, not {case.to_reach:g}")
        if now.p99 > max(MORE_BY_SHARE * before.p99, before.p99 + MORE_BY_MM):
            found.append(f"{case.title}: penetration {now.p99:.2f} mm, {before.p99:.2f} before")
        if case.deepest is not None and now.p99 > 1e3 * case.deepest:
            found.append(f"{case.title}: penetration {now.p99:.2f} mm, not {1e3 * case.deepest:g}")
        if now.lost > before.lost:
            found.append(f"{case.title}: {now.lost} bodies lost, {before.lost} before")
        if now.calls is not None and now.calls.share > SHARE_TO_REACH:
            found.append(f"{case.title}: all but PyBullet's own calls is {now.calls.share:.2f} of them")
    return found


def _with_quartiles(figures: Figures) -> str:
    if math.isnan(figures.update):
        return "did not run"
    low, high = figures.quartiles
    return f"{figures.update:.2f} ({low:.2f}-{high:.2f})"


def _ratio(one: Compared) -> str:
    return "-" if math.isnan(one.speed_up) else f"{one.speed_up:.2f}"


def _depths(one: Compared) -> str:
    asked = "" if one.case.deepest is None else f" (<= {1e3 * one.case.deepest:g})"
    return f"{_pair(one.before.p99, one.now.p99)}{asked}"


def _pair(before: float, now: float) -> str:
    return " / ".join("-" if math.isnan(value) else f"{value:.2f}" for value in (before, now))
