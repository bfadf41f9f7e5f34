"""Runs the cases on both sides in turns, piece by piece, and computes the figures."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np

from smartmesh_ros.errors import InputError
from smartmesh_ros.terrain.grid import FloatArray
from studies.before_after.case import PHYSICS_RATE, Case
from studies.before_after.inputs import measure, write_inputs
from studies.before_after.side import Piece, Side

SIDES = ("before", "now")
# Columns of what a piece took.
UPDATE, STEP, OWN, CALLS, MAP_CAME, MAP = range(6)


@dataclass(frozen=True, kw_only=True)
class Calls:
    """Steps with a new map, per body [us]: time of PyBullet's own calls without ``stepSimulation``, and of everything
    else; ``calls``: number of calls per body."""

    own: float
    else_: float
    calls: float

    @property
    def share(self) -> float:
        """All but PyBullet's own calls, as a share of them [-]."""
        return self.else_ / self.own


@dataclass(frozen=True, kw_only=True)
class Figures:
    """One side in one case. ``update``: all but ``stepSimulation``, per body and step [us], median over the pieces, and
    its ``quartiles``; ``step``: ``stepSimulation`` [us]. ``longest``: the update of a whole step [ms], 99 %.
    Penetration ``p99`` [mm], and bodies ``lost``. ``note``: why there is nothing."""

    update: float = math.nan
    quartiles: tuple[float, float] = (math.nan, math.nan)
    step: float = math.nan
    longest: float = math.nan
    p99: float = math.nan
    lost: int = 0
    calls: Calls | None = None
    note: str = ""


@dataclass(frozen=True, kw_only=True)
class Compared:
    """Both sides in one case."""

    case: Case
    before: Figures
    now: Figures

    @property
    def speed_up(self) -> float:
        """Return the ratio of the update times, before / now; NaN if a side did not run."""
        return self.before.update / self.now.update


def compare(
    folders: Mapping[str, Path], chosen: list[Case], pieces: int, scratch: Path, say: Callable[[str], None]
) -> list[Compared]:
    """All cases on the code of both ``folders``, whose keys are `SIDES`; a piece of one, then a piece of the other."""
    with Side(folders["before"]) as before, Side(folders["now"]) as now:
        sides = {"before": before, "now": now}
        found = {case.name: _timed(case, sides, pieces, scratch, say) for case in chosen}
    counted: dict[str, dict[str, list[Piece] | str]] = {}
    with Side(folders["before"], count_calls=True) as before, Side(folders["now"], count_calls=True) as now:
        sides = {"before": before, "now": now}
        for case in (case for case in chosen if case.calls):
            counted[case.name] = take_turns(case, sides, range(max(3, pieces // 2) + 1), scratch, say, "calls")
    compared = []
    for case in chosen:
        figures = {
            side: _figures(case, found[case.name][side], counted.get(case.name, {}).get(side, [])) for side in SIDES
        }
        compared.append(Compared(case=case, before=figures["before"], now=figures["now"]))
    return compared


def _timed(
    case: Case, sides: Mapping[str, Side], pieces: int, scratch: Path, say: Callable[[str], None]
) -> dict[str, list[Piece] | str]:
    write_inputs(case, scratch / case.name)
    # One more, for warming up.
    return take_turns(case, sides, range(pieces + 1), scratch, say, "timing")


class Titled(Protocol):
    """What all cases have: a name, which their files have too, and a title."""

    @property
    def name(self) -> str: ...

    @property
    def title(self) -> str: ...


def take_turns(
    case: Titled, sides: Mapping[str, Side], parts: range, scratch: Path, say: Callable[[str], None], what: str
) -> dict[str, list[Piece] | str]:
    """Return the pieces of each side; or the reason why a side cannot run the case."""
    found: dict[str, list[Piece] | str] = {name: [] for name in SIDES}
    for part in parts:
        say(f"{case.title}: {what}, piece {part + 1} of {len(parts)}")
        for name in SIDES if part % 2 else SIDES[::-1]:
            mine = found[name]
            if isinstance(mine, str):
                continue
            try:
                mine.append(sides[name].run(scratch / case.name))
            except InputError as error:
                found[name] = str(error).strip()
    return found


def _figures(case: Case, timed: list[Piece] | str, counted: list[Piece] | str) -> Figures:
    if isinstance(timed, str):
        return Figures(note=timed)
    skip = round(case.settle * PHYSICS_RATE)
    warm, *pieces = timed
    taken = 1e6 / case.count * np.array([piece.taken[skip:, :2] for piece in pieces])  # (pieces, steps, 2) [us]
    means = taken.mean(axis=1)
    low, middle, high = np.percentile(means[:, UPDATE], (25, 50, 75)).tolist()
    measured = warm.times > case.settle
    depth = measure(case, warm.times[measured], warm.positions[measured], warm.orientations[measured])
    return Figures(
        update=middle,
        quartiles=(low, high),
        step=float(np.median(means[:, STEP])),
        longest=1e-3 * case.count * float(np.percentile(_typical(taken)[:, UPDATE], 99)),
        p99=1e3 * depth.p99,
        lost=depth.lost,
        calls=_calls(case, pieces, counted) if counted and not isinstance(counted, str) else None,
    )


def _typical(taken: FloatArray) -> FloatArray:
    """Return the median of each step over the pieces. All pieces are identical, so that differences are noise."""
    return np.asarray(np.median(taken, axis=0))


def _calls(case: Case, pieces: list[Piece], counted: list[Piece]) -> Calls:
    skip = round(case.settle * PHYSICS_RATE)
    undisturbed, disturbed = (
        _typical(np.array([piece.taken[skip:] for piece in group])) for group in (pieces, counted)
    )
    fresh = disturbed[:, MAP_CAME] > 0.0
    whole = 1e6 / case.count * float(undisturbed[fresh, UPDATE].mean())
    own = 1e6 / case.count * float(disturbed[fresh, OWN].mean())
    return Calls(own=own, else_=whole - own, calls=float(disturbed[fresh, CALLS].mean()) / case.count)
