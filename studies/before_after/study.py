"""``make before-after``: the code of another folder against this one's, in one run."""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import smartmesh_ros
from smartmesh_ros.errors import InputError
from smartmesh_ros.evaluation.machine import describe
from studies.before_after.case import cases
from studies.before_after.contest import Compared, compare
from studies.before_after.picture import draw
from studies.before_after.robots import SIDE, compare_robots, records, robot_cases, robots_missed, robots_table
from studies.before_after.tables import calls_table, kinds_table, missed, speed_table
from studies.progress import Progress

PIECES, QUICK_PIECES, ROBOT_PIECES = 9, 3, 2


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the cases; writes JSON, a table and a picture."""
    options = _parser().parse_args(arguments)
    folders = {"before": options.before, "now": options.now or Path(smartmesh_ros.__file__).parents[1]}
    known = cases(quick=options.quick)
    chosen = [case for case in cases(quick=False) if case.name in options.cases] if options.cases else known
    pieces = options.pieces or (QUICK_PIECES if options.quick else PIECES)
    say = Progress()
    if options.robots:
        return _robots(options, folders, say)
    try:
        with TemporaryDirectory() as scratch:
            compared = compare(folders, chosen, pieces, Path(scratch), say)
    except InputError as error:
        print(f"\nbefore_after: {error}", file=sys.stderr)
        return 2
    print(file=sys.stderr)
    commits = {side: _commit(folder) for side, folder in folders.items()}
    page = _page(compared, commits, pieces)
    options.out.mkdir(parents=True, exist_ok=True)
    (options.out / "before_after.md").write_text(page)
    data = {"machine": describe(), "commits": commits, "pieces": pieces, "cases": [asdict(one) for one in compared]}
    (options.out / "before_after.json").write_text(json.dumps(data, indent=1) + "\n")
    draw(options.out / "before_after.png", compared)
    print(page)
    print(f"wrote {options.out}/before_after.md, .json and .png in {say.elapsed:.0f} s")
    return 0


def _robots(options: argparse.Namespace, folders: dict[str, Path], say: Progress) -> int:
    """Run the cases with robots; write JSON and a table."""
    pieces = options.pieces or ROBOT_PIECES
    try:
        with TemporaryDirectory() as scratch:
            compared = compare_robots(folders, robot_cases(), pieces, Path(scratch), say)
    except InputError as error:
        print(f"\nbefore_after: {error}", file=sys.stderr)
        return 2
    print(file=sys.stderr)
    commits = {side: _commit(folder) for side, folder in folders.items()}
    wanting = robots_missed(compared)
    page = "\n\n".join(
        [
            "# Before and now: robots",
            f"Written by `make before-after ARGS=--robots`. Before: {commits['before']}; now: {commits['now']}. "
            "`World` at 240 Hz, patches at 60 Hz, four robots that never sleep, on hills with noise of 1 cm, on a map "
            f"of {SIDE:g} x {SIDE:g} m. Processor time of `World.step`, without reading in maps: median of {pieces} "
            "pieces; both sides took turns in one run.",
            robots_table(compared),
            "Everything that was asked for is there."
            if not wanting
            else "Not reached:\n\n" + "\n".join(f"- {line}" for line in wanting),
        ]
    )
    options.out.mkdir(parents=True, exist_ok=True)
    (options.out / "robots.md").write_text(page + "\n")
    data = {"machine": describe(), "commits": commits, "pieces": pieces, "cases": records(compared)}
    (options.out / "robots.json").write_text(json.dumps(data, indent=1) + "\n")
    print(page)
    print(f"wrote {options.out}/robots.md and .json in {say.elapsed:.0f} s")
    return 0


def _page(compared: list[Compared], commits: dict[str, str], pieces: int) -> str:
    found = describe()
    versions: Any = found["versions"]
    words = ", ".join(f"{name} {version}" for name, version in versions.items() if version != "not installed")
    wanting = missed(compared)
    parts = [
        "# Before and now",
        f"Written by `make before-after`. Before: {commits['before']}; now: {commits['now']}. Physics at 240 Hz, "
        f"patches at 60 Hz, maps at 60 Hz unless a row says otherwise. Processor time per body and step: median of "
        f"{pieces} pieces, quartiles; both sides took turns in one run. Update = all but `stepSimulation`. Penetration "
        "is measured against the main mesh. `Ground` in a plain PyBullet world, without landing and guard; or `World`, "
        "where a row says so.",
        f"Measured on {found['cores']} cores of {found['cpu']}; {words}.",
        speed_table(compared),
        "![](before_after.png)",
        calls_table(compared),
        kinds_table(compared),
        "Everything that was asked for is there."
        if not wanting
        else "Not reached:\n\n" + "\n".join(f"- {line}" for line in wanting),
    ]
    return "\n\n".join(parts) + "\n"


def _commit(folder: Path) -> str:
    """Return the checked-out commit of a folder, and a mark if files were changed since."""
    words = []
    for arguments in (("rev-parse", "--short", "HEAD"), ("status", "--porcelain", "--untracked-files=no")):
        try:
            found = subprocess.run(["git", "-C", str(folder), *arguments], capture_output=True, text=True, check=True)
        except (OSError, subprocess.CalledProcessError):
            return "unknown"
        words.append(found.stdout.strip())
    return f"{words[0]} with changes" if words[1] else words[0]


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="before_after", description=__doc__)
    parser.add_argument("--before", type=Path, required=True, help="a checkout of the code to compare with")
    parser.add_argument("--now", type=Path, help="a checkout to compare it with (the code that runs this)")
    parser.add_argument("--quick", action="store_true", help="a few cases and pieces, under 40 s")
    parser.add_argument("--robots", action="store_true", help="husky and laikago instead of the bodies, two minutes")
    parser.add_argument("--cases", nargs="+", default=[], choices=[case.name for case in cases(quick=False)])
    parser.add_argument("--pieces", type=int, help=f"timed pieces of each side and case ({PIECES})")
    parser.add_argument("--out", type=Path, default=Path("out/before_after"), help="folder to write to")
    return parser


if __name__ == "__main__":
    sys.exit(main())
