"""``make robots``: robots on rough and moving ground, cost against accuracy, beside other engines."""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from smartmesh_ros.errors import InputError
from studies.chart import draw_all, draw_scene
from studies.configurations import Family
from studies.contest import Result
from studies.machine import describe, measured_on
from studies.markdown import table
from studies.pages import fill
from studies.progress import Progress
from studies.results_file import records, save_results
from studies.robots.configurations import configurations
from studies.robots.contest import run_scene
from studies.robots.scene import RobotScene, scenes
from studies.robots.strangers import MOST_RESCUES, Stranger, run_strangers
from studies.tables import all_tables, front_table, summary_table

Results = dict[str, dict[str, Result]]
# Largest penetration of the deepest link, 99 % [m], by motion of the ground.
DEEPEST = {"rest": 0.001, "wave": 0.003, "maps": 0.003}
PAGE, DATA, TABLES = "robot_charts.md", "robots.json", "robot_tables.md"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the scenes and the strangers; write JSON, pictures and tables."""
    options = _parser().parse_args(arguments)
    known = {scene.name: scene for scene in scenes(quick=False)}
    if unknown := set(options.scenes) - set(known):
        print(f"robots: there is no scene {', '.join(sorted(unknown))}; choose {', '.join(known)}", file=sys.stderr)
        return 2
    out = folder_of(options)
    images = out / "images" / "robots"
    images.mkdir(parents=True, exist_ok=True)
    say = Progress()

    chosen = [known[name] for name in options.scenes] or scenes(quick=options.quick)
    configured = configurations(quick=options.quick)
    families: dict[str, Family] = {one.name: one.family for one in configured}
    results: Results = {}
    data: dict[str, Any] = {"machine": describe(), "quick": options.quick}
    for scene in chosen:
        results[scene.name] = run_scene(scene, configured, say)
        draw_scene(images / f"{scene.name}.png", scene.title, results[scene.name], families, unit="robot")
        data["scenes"] = records(results)
        save_results(out / DATA, data)
    strangers = [] if options.scenes else run_strangers(say, quick=options.quick)
    data["strangers"] = [asdict(one) for one in strangers]
    save_results(out / DATA, data)
    print(file=sys.stderr)
    blocks = _blocks(chosen, results, families, strangers)
    draw_all(images / "all.png", _titles(chosen), results, families, unit="robot")
    (out / TABLES).write_text(_tables_page(chosen, results, blocks["machine"]))
    try:
        if (out / PAGE).exists():
            fill(out / PAGE, blocks)
        else:
            (out / PAGE).write_text("\n\n".join(blocks.values()) + "\n")
    except InputError as error:
        print(f"robots: {error}", file=sys.stderr)
        return 2
    print(limits_table(chosen, results))
    print(f"\nwrote {out}/{PAGE}, {TABLES}, {DATA} and {images} in {say.elapsed:.0f} s")
    return 0


def folder_of(options: argparse.Namespace) -> Path:
    """Return the output folder of a run. Only whole runs write into docs/."""
    folder: Path = options.out or Path("out/robots" if options.quick or options.scenes else "docs")
    return folder


def _titles(chosen: Sequence[RobotScene]) -> dict[str, str]:
    return {scene.name: scene.title for scene in chosen}


def _blocks(
    chosen: Sequence[RobotScene], results: Results, families: Mapping[str, Family], strangers: Sequence[Stranger]
) -> dict[str, str]:
    """Return the blocks of the page by name."""
    titles = _titles(chosen)
    return {
        "machine": f"{measured_on(describe())}.",
        "summary": summary_table(titles, results, families),
        "front": front_table(titles, results, families),
        "depths": depths_table(chosen, results),
        "refused": refused(results),
        "strangers": strangers_table(strangers),
    }


def depths_table(chosen: Sequence[RobotScene], results: Results) -> str:
    """Return the penetration of the defaults' deepest links."""
    names = ("defaults", "defaults, never asleep")
    rows = [[scene.title, *(f"{1e3 * results[scene.name][name].p99:.2f}" for name in names)] for scene in chosen]
    return table(["deepest link, 99 % [mm]", "defaults", "never asleep"], rows)


def limits_table(chosen: Sequence[RobotScene], results: Results) -> str:
    """Return the penetration of the defaults' deepest links beside its limit, which the study prints."""
    rows = []
    for scene in chosen:
        own, awake = (results[scene.name][name] for name in ("defaults", "defaults, never asleep"))
        limit = DEEPEST[scene.motion]
        worst = max(own.p99, awake.p99)
        verdict = "yes" if worst <= limit else "**no**"
        rows.append([scene.title, f"{1e3 * own.p99:.2f}", f"{1e3 * awake.p99:.2f}", f"{1e3 * limit:g}", verdict])
    return table(["deepest link, 99 % [mm]", "defaults", "never asleep", "limit", "kept"], rows)


def refused(results: Results) -> str:
    """Return which engines did not run which robots, and why."""
    notes: dict[str, list[str]] = {}
    for scene, found in results.items():
        for name, result in found.items():
            if result.note:
                notes.setdefault(f"{name}: {result.note.splitlines()[0]}", []).append(scene)
    if not notes:
        return "Every engine ran every scene to its end."
    return "\n".join(f"- {note} ({', '.join(names)})" for note, names in notes.items())


def strangers_table(strangers: Sequence[Stranger]) -> str:
    """Return drift and rescues of the robots that nobody tuned for."""
    rows = [
        [
            f"{one.name}, {'braked' if one.braked else 'limp'}, ground {'heaving' if one.moving else 'at rest'}",
            f"{1e3 * one.drift:.1f}" if math.isfinite(one.drift) else "left the map",
            str(one.rescues),
            f"{MOST_RESCUES}",
            "yes" if one.passed else "**no**",
        ]
        for one in strangers
    ]
    return table(["robot", "drift [mm]", "rescues", "limit", "kept"], rows)


def _tables_page(chosen: Sequence[RobotScene], results: Results, machine: str) -> str:
    head = f"# Robots: every figure of every scene\n\nWritten by `make robots`. {machine}\n"
    head += "See [robots in the charts](robot_charts.md) for what the figures mean.\n\n"
    return head + all_tables("robots", _titles(chosen), results)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="robots", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="a few scenes and engines, under two minutes")
    parser.add_argument("--out", type=Path, help="folder to write to (docs; out/robots for a part of a run)")
    parser.add_argument("--scenes", nargs="+", default=[], metavar="SCENE", help="these scenes only")
    return parser


if __name__ == "__main__":
    sys.exit(main())
