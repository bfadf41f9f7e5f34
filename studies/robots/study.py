"""``make robots``: robots on rough and moving ground, cost against accuracy, beside other engines."""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from smartmesh_ros.errors import InputError
from studies.configurations import robot_configurations
from studies.machine import describe, measured_on
from studies.markdown import table
from studies.pages import fill
from studies.progress import Progress
from studies.results_file import save_results
from studies.robots.contest import run_scene
from studies.robots.scene import RobotScene, scenes
from studies.robots.strangers import MOST_RESCUES, Stranger, run_strangers
from studies.scene_charts import Charts, Results

CHARTS = Charts(
    "robots", "make robots", "[robots in the charts](robot_charts.md)", "robot", data="robots.json",
    tables="robot_tables.md",
)  # fmt: skip
PAGE = "robot_charts.md"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the scenes and the strangers; write JSON, pictures and tables."""
    options = _parser().parse_args(arguments)
    known = {scene.name: scene for scene in scenes(quick=False)}
    if unknown := set(options.scenes) - set(known):
        print(f"robots: there is no scene {', '.join(sorted(unknown))}; choose {', '.join(known)}", file=sys.stderr)
        return 2
    out = folder_of(options)
    images, say = CHARTS.images(out), Progress()
    found = describe()
    save_results(out / CHARTS.data, {"machine": found, "quick": options.quick})
    todo = [known[name] for name in options.scenes] or scenes(quick=options.quick)
    chosen = robot_configurations(quick=options.quick)
    by_title = {scene.title: scene for scene in todo}
    results = CHARTS.run(out, by_title, chosen, lambda scene: run_scene(scene, chosen, say))
    strangers = [] if options.scenes else run_strangers(say, quick=options.quick)
    save_results(out / CHARTS.data, {"strangers": [asdict(one) for one in strangers]})
    print(file=sys.stderr)
    machine = f"{measured_on(found)}."
    blocks = {
        "machine": machine,
        **CHARTS.write(out, {scene.name: scene.title for scene in todo}, chosen, results, machine),
        "depths": depths_table(todo, results),
        "refused": refused(results),
        "strangers": strangers_table(strangers),
    }
    try:
        if (out / PAGE).exists():
            fill(out / PAGE, blocks)
        else:
            (out / PAGE).write_text("\n\n".join(blocks.values()) + "\n")
    except InputError as error:
        print(f"robots: {error}", file=sys.stderr)
        return 2
    print(
        f"{blocks['depths']}\n\nwrote {out}/{PAGE}, {CHARTS.tables}, {CHARTS.data} and {images} in {say.elapsed:.0f} s"
    )
    return 0


def folder_of(options: argparse.Namespace) -> Path:
    """Return the output folder of a run. Only whole runs write into docs/."""
    folder: Path = options.out or Path("out/robots" if options.quick or options.scenes else "docs")
    return folder


def depths_table(chosen: Sequence[RobotScene], results: Results) -> str:
    """Return the penetration of the defaults' deepest links."""
    names = ("defaults", "defaults, never asleep")
    rows = [[scene.title, *(f"{1e3 * results[scene.name][name].p99:.2f}" for name in names)] for scene in chosen]
    return table(["deepest link, 99 % [mm]", "defaults", "never asleep"], rows)


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


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="robots", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="a few scenes and engines, under two minutes")
    parser.add_argument("--out", type=Path, help="folder to write to (docs; out/robots for a part of a run)")
    parser.add_argument("--scenes", nargs="+", default=[], metavar="SCENE", help="these scenes only")
    return parser


if __name__ == "__main__":
    sys.exit(main())
