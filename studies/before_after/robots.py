"""Robots in the comparison: cost of a whole step, and size of the fields under the wheels."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from smartmesh_ros.terrain.grid import FloatArray
from studies.before_after.case import PHYSICS_RATE
from studies.before_after.contest import MAP, SIDES, STEP, UPDATE, take_turns
from studies.before_after.side import Piece, Side
from studies.matrix.arena import square
from studies.robots.ground import HEAVING, STILL, RoughHills
from studies.robots.robot import HUSKY, LAIKAGO, Robot
from studies.tables import table

# Side of the map [m], and where the robots start on it: side by side, with room to drive along x [m].
SIDE = 8.0
STARTS = ((-1.4, -2.7), (-1.4, -0.9), (-1.4, 0.9), (-1.4, 2.7))
# Gap below the lowest point of a robot that is spawned over the highest ground around it [m].
GAP = 0.005
WHOLE = "whole_heightfield"


@dataclass(frozen=True, kw_only=True)
class RobotCase:
    """Four robots on rough hills, which do not sleep.

    ``resolution`` [m]: of the map. ``moving``: the hills heave, maps come at 20 Hz, and wheels are driven; otherwise
    there is one map, and wheels are braked. ``kind``: of patches. ``settle`` [s]: beginning of ``seconds`` [s] that is
    not timed. ``whole``, ``own``: targets of the whole step and of the own share, as shares of those before;
    ``beside``: of the whole step beside ``whole_heightfield``; ``field``: largest number of samples under a wheel.
    None = no target.
    """

    robot: Robot
    resolution: float
    moving: bool = False
    kind: str = "auto"
    map_rate: float = 20.0
    seconds: float = 1.25
    settle: float = 0.75
    whole: float | None = None
    own: float | None = None
    beside: float | None = None
    field: int | None = None

    @property
    def name(self) -> str:
        """Unique name, also of its files."""
        return f"{self.robot.name}_{100.0 * self.resolution:.0f}cm_{'moving' if self.moving else 'rest'}_{self.kind}"

    @property
    def title(self) -> str:
        """Name in the table."""
        how = f"maps at {self.map_rate:g} Hz" if self.moving else "at rest"
        return f"{self.robot.name}, {100.0 * self.resolution:.0f} cm, {how}"

    @property
    def ground(self) -> RoughHills:
        """The hills."""
        samples = round(SIDE / self.resolution) + 1
        return RoughHills(square(samples, self.resolution), HEAVING if self.moving else STILL)


def robot_cases() -> list[RobotCase]:
    """Return all cases; those with small patches have the targets."""
    found = [
        RobotCase(robot=robot, resolution=resolution, moving=moving)
        for robot in (HUSKY, LAIKAGO)
        for resolution in (0.1, 0.04)
        for moving in (False, True)
    ]
    targets: dict[tuple[str, bool], dict[str, Any]] = {
        ("husky", False): {"whole": 0.6, "beside": 0.6, "field": 25},
        ("husky", True): {"own": 0.5},
        ("laikago", False): {"whole": 0.6},
        ("laikago", True): {"whole": 0.6, "own": 0.5},
    }
    return [
        replace(case, **targets[case.robot.name, case.moving]) if case.resolution == 0.04 else case for case in found
    ]


@dataclass(frozen=True, kw_only=True)
class RobotFigures:
    """One side in one case, per robot and step [us], medians over the pieces: ``step`` is ``stepSimulation``, ``own``
    is all else of `World.step`. ``wheel``: median number of samples of the field under a wheel at the end. ``note``:
    why there is nothing."""

    step: float = math.nan
    own: float = math.nan
    wheel: float = math.nan
    note: str = ""

    @property
    def whole(self) -> float:
        """Return the time of `World.step`."""
        return self.step + self.own


@dataclass(frozen=True, kw_only=True)
class RobotsCompared:
    """Both sides in one case, and both with one height field of the whole map."""

    case: RobotCase
    before: RobotFigures
    now: RobotFigures
    before_whole: RobotFigures
    now_whole: RobotFigures


def compare_robots(
    folders: Mapping[str, Path], cases: Sequence[RobotCase], pieces: int, scratch: Path, say: Callable[[str], None]
) -> list[RobotsCompared]:
    """Run all cases on the code of both ``folders``, whose keys are `SIDES`, in turns."""
    compared = []
    with Side(folders["before"]) as before, Side(folders["now"]) as now:
        sides = {"before": before, "now": now}
        for case in cases:
            figures: dict[str, RobotFigures] = {}
            for one in (case, replace(case, kind=WHOLE)):
                write_inputs(one, scratch / one.name)
                found = take_turns(one, sides, range(pieces), scratch, say, "timing")
                suffix = "" if one is case else "_whole"
                figures |= {f"{side}{suffix}": _figures(one, found[side]) for side in SIDES}
            compared.append(RobotsCompared(case=case, **figures))
    return compared


def write_inputs(case: RobotCase, folder: Path) -> None:
    """Write the case, its maps (M, R, C) [m] and where its robots start (4, 3) [m] into a new folder."""
    folder.mkdir()
    ground, robot = case.ground, case.robot
    settings = {
        "resolution": case.resolution,
        "origin": ground.geometry.origin,
        "kind": case.kind,
        "driver": "robots",
        "seconds": case.seconds,
        "rate": PHYSICS_RATE,
        "map_rate": case.map_rate if case.moving else 0.0,
        "early": 0.0,
        "urdf": robot.urdf,
        "positions": dict(robot.stance),
        "velocities": dict.fromkeys(robot.wheels, robot.speed if case.moving else 0.0),
    }
    (folder / "case.json").write_text(json.dumps(settings))
    count = int(case.seconds * case.map_rate) + 2 if case.moving else 1
    np.save(folder / "maps.npy", np.stack([ground.heights(index / case.map_rate) for index in range(count)]))
    np.save(folder / "starts.npy", start_positions(robot, ground, STARTS))


def start_positions(robot: Robot, ground: RoughHills, places: Sequence[tuple[float, float]]) -> FloatArray:
    """Return where robots start (N, 3) [m]: level, just above the highest ground within their reach."""
    heights = np.asarray(ground.heights(0.0), np.float64)
    found = []
    for x, y in places:
        near = np.hypot(ground.x - x, ground.y - y) <= robot.reach
        found.append((x, y, heights[near].max() + robot.height + GAP))
    return np.array(found)


def _figures(case: RobotCase, timed: list[Piece] | str) -> RobotFigures:
    if isinstance(timed, str):
        return RobotFigures(note=timed)
    skip = round(case.settle * PHYSICS_RATE)
    taken = 1e6 / len(STARTS) * np.array([piece.taken[skip:] for piece in timed])  # (pieces, steps, columns) [us]
    own = (taken[..., UPDATE] - taken[..., MAP]).mean(axis=1)
    last = timed[-1]
    wheels = [index for index, link in enumerate(last.links.tolist()) if "wheel" in link]
    sizes = last.fields[-1, wheels] if case.kind == "auto" and wheels else np.empty(0)
    return RobotFigures(
        step=float(np.median(taken[..., STEP].mean(axis=1))),
        own=float(np.median(own)),
        wheel=float(np.median(sizes)) if sizes.size else math.nan,
    )


def robots_table(compared: Sequence[RobotsCompared]) -> str:
    """Return a table with a row a case."""
    rows = []
    for one in compared:
        before, now, case = one.before, one.now, one.case
        rows.append(
            [
                case.title, f"{before.whole:.0f} / {now.whole:.0f}", _share(now.whole, before.whole, case.whole),
                f"{before.step:.0f} / {now.step:.0f}", f"{before.own:.0f} / {now.own:.0f}",
                _share(now.own, before.own, case.own), f"{one.before_whole.whole:.0f} / {one.now_whole.whole:.0f}",
                f"{before.whole / one.before_whole.whole:.2f}",
                _share(now.whole, one.now_whole.whole, case.beside), _wheels(one),
            ]
        )  # fmt: skip
    header = [
        "four robots, per robot and step", "whole step, before / now [us]", "now / before", "stepSimulation [us]",
        "all else [us]", "now / before", "the same with a whole heightfield [us]", "ours / whole heightfield, before",
        "now", "samples under a wheel",
    ]  # fmt: skip
    return table(header, rows)


def robots_missed(compared: Sequence[RobotsCompared]) -> list[str]:
    """Return the missed targets as texts."""
    found = []
    for one in compared:
        case, before, now = one.case, one.before, one.now
        for side in ("before", "now", "before_whole", "now_whole"):
            figures: RobotFigures = getattr(one, side)
            if figures.note:
                found.append(f"{case.title}: {side} did not run: {figures.note.splitlines()[-1]}")
        for what, share, target in (
            ("the whole step takes", now.whole / before.whole, case.whole),
            ("all but stepSimulation takes", now.own / before.own, case.own),
            ("beside a whole heightfield a step takes", now.whole / one.now_whole.whole, case.beside),
        ):
            if target is not None and share > target:
                found.append(f"{case.title}: {what} {share:.2f} times as long, not {target:g}")
        if case.field is not None and now.wheel > case.field:
            found.append(f"{case.title}: {now.wheel:.0f} samples under a wheel, not {case.field}")
    return found


def records(compared: Sequence[RobotsCompared]) -> list[dict[str, Any]]:
    """Return the figures for a JSON file."""
    sides = ("before", "now", "before_whole", "now_whole")
    return [{"case": one.case.name} | {side: asdict(getattr(one, side)) for side in sides} for one in compared]


def _share(now: float, before: float, target: float | None) -> str:
    return f"{now / before:.2f}" + ("" if target is None else f" (<= {target:g})")


def _wheels(one: RobotsCompared) -> str:
    if math.isnan(one.now.wheel):
        return "-"
    target = "" if one.case.field is None else f" (<= {one.case.field})"
    return f"{one.before.wheel:.0f} / {one.now.wheel:.0f}{target}"
