"""``make before-after``: the code of another checkout against this one's, in the scenes of the accuracy study."""

from __future__ import annotations

import argparse
import math
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from smartmesh_ros.errors import InputError
from smartmesh_ros.tools.evaluation.scene import Scene, read_scenes
from studies.body_contest import run_scene
from studies.configurations import Configuration
from studies.contest import Result
from studies.engines.checkout import HERE, CheckoutOptions
from studies.machine import describe
from studies.markdown import table
from studies.progress import Progress
from studies.results_file import records, save_results

BEFORE, NOW = "before", "now"


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the scenes; writes JSON and a table."""
    options = _parser().parse_args(arguments)
    folders = {BEFORE: options.before, NOW: options.now}
    scenes = [scene for scene in read_scenes() if scene.quick or not options.quick]
    if options.scenes:
        scenes = [scene for scene in read_scenes() if scene.name in options.scenes]
    say = Progress()
    try:
        results = {scene.title: compare(scene, folders, options.kind, say) for scene in scenes}
    except InputError as error:
        print(f"\nbefore_after: {error}", file=sys.stderr)
        return 2
    print(file=sys.stderr)
    commits = {side: commit_of(folder) for side, folder in folders.items()}
    page = f"# Before and now\n\nBefore: {commits[BEFORE]}; now: {commits[NOW]}. {HEAD}\n\n{speed_table(results)}\n"
    options.out.mkdir(parents=True, exist_ok=True)
    (options.out / "before_after.md").write_text(page)
    data = {"machine": describe(), "commits": commits, "kind": options.kind, "scenes": records(results)}
    save_results(options.out / "before_after.json", data)
    print(page)
    print(f"wrote {options.out}/before_after.md and .json in {say.elapsed:.0f} s")
    return 0


HEAD = (
    "`World` at 240 Hz with its defaults. Processor time per body and simulated second, median of the pieces of a run, "
    "in which both sides took turns; update = all but `stepSimulation`. Same = every figure but the times is equal."
)


def compare(scene: Scene, folders: Mapping[str, Path], kind: str, say: Any) -> dict[str, Result]:
    """Return the results of a scene by side, on the code of ``folders``; raises `InputError` if a side cannot run."""
    sides = [
        Configuration(name=side, family="ours", engine="checkout", options=CheckoutOptions(folder=folder, kind=kind))
        for side, folder in folders.items()
    ]
    results = run_scene(replace(scene, reference="none"), sides, say)
    for side, result in results.items():
        if math.isnan(result.cost):
            raise InputError("checkout", f"{scene.name}, {side}: {result.note}")
    return results


def same(before: Result, now: Result) -> bool:
    """Return True if every figure but the times is equal."""
    one, other = (repr(replace(side, cost=0.0, spread=(0.0, 0.0), update=0.0, note="")) for side in (before, now))
    return one == other


def speed_table(results: Mapping[str, Mapping[str, Result]]) -> str:
    """Return a table with a row a scene: cost and accuracy before and now."""
    rows = []
    for title, sides in results.items():
        before, now = sides[BEFORE], sides[NOW]
        rows.append(
            [
                title, f"{_ms(before.update)} / {_ms(now.update)}", f"{now.update / before.update:.2f}",
                f"{_ms(before.cost)} / {_ms(now.cost)}", f"{now.cost / before.cost:.2f}",
                f"{1e3 * before.p99:.3f} / {1e3 * now.p99:.3f}", f"{1e3 * before.hover:.3f} / {1e3 * now.hover:.3f}",
                f"{before.lost} / {now.lost}", "yes" if same(before, now) else "no",
            ]
        )  # fmt: skip
    header = [
        "scene, before / now", "update [ms]", "now / before", "update and step [ms]", "now / before",
        "penetration, 99 % [mm]", "hover, 99 % [mm]", "lost", "same",
    ]  # fmt: skip
    return table(header, rows)


def _ms(microseconds: float) -> str:
    return f"{1e-3 * microseconds:.3f}"


def commit_of(folder: Path) -> str:
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
    parser.add_argument("--now", type=Path, default=HERE, help="a checkout to compare it with (this one)")
    parser.add_argument("--quick", action="store_true", help="a few scenes")
    parser.add_argument("--scenes", nargs="+", default=[], choices=[scene.name for scene in read_scenes()])
    parser.add_argument("--kind", default="auto", help="of patches (auto)")
    parser.add_argument("--out", type=Path, default=Path("out/before_after"), help="folder to write to")
    return parser


if __name__ == "__main__":
    sys.exit(main())
