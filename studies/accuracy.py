"""The study of speed against accuracy, and of stability: ``make studies`` runs it whole."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from smartmesh_ros.tools.evaluation.scene import read_scenes
from studies.body_contest import run_scene
from studies.chart import README_SCENE, draw_readme
from studies.configurations import checkouts, configurations
from studies.machine import describe, measured_on
from studies.matrix.picture import draw_box, draw_matrix, matrix_table
from studies.matrix.row import METHODS
from studies.matrix.run import run_matrix
from studies.pages import fill
from studies.progress import Progress
from studies.results_file import save_results
from studies.tables import Charts, choosing_table, rates_table

CHARTS = Charts(
    "accuracy", "make studies", "[accuracy](accuracy.md)", "body", data="accuracy.json", tables="accuracy_tables.md"
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the scenes and the stability matrix; writes JSON, pictures and tables."""
    options = _parser().parse_args(arguments)
    out = folder_of(options)
    CHARTS.images(out)
    say = Progress()
    found = describe()
    machine = f"{measured_on(found)}."
    save_results(out / CHARTS.data, {"machine": found, "quick": options.quick})
    blocks = {"machine": machine}
    if not options.charts_only:  # before the charts, whose replaced meshes PyBullet keeps in memory
        blocks |= _matrix(options, out, say)
        _fill(out, blocks)
    if not options.matrix_only:
        blocks |= _charts(options, out, machine, say)
        _fill(out, blocks)
    print(f"\nwrote {out / CHARTS.data} and {CHARTS.images(out)} in {say.elapsed:.0f} s")
    return 0


def _fill(out: Path, blocks: dict[str, str]) -> None:
    if (page := out / "accuracy.md").exists():
        fill(page, blocks)


def folder_of(options: argparse.Namespace) -> Path:
    """Return the output folder of a run. Only whole runs write into docs/, so that no page mixes figures of
    machines."""
    part = options.quick or options.scenes or options.methods or options.charts_only or options.matrix_only
    usual = "out/before_after" if options.before else "out/studies" if part else "docs"
    folder: Path = options.out or Path(usual)
    return folder


def _matrix(options: argparse.Namespace, out: Path, say: Any) -> dict[str, str]:
    """Run the matrix; return its block."""
    outcomes = run_matrix(say, quick=options.quick, methods=options.methods)
    draw_matrix(CHARTS.images(out) / "stability.png", outcomes)
    real_maps = out / "images" / "real_maps"
    real_maps.mkdir(exist_ok=True)
    draw_box(real_maps / "box.png")
    save_results(out / CHARTS.data, {"stability": [asdict(outcome) for outcome in outcomes]})
    return {"stability": matrix_table(outcomes)}


def _charts(options: argparse.Namespace, out: Path, machine: str, say: Any) -> dict[str, str]:
    """Run the scenes; return their blocks."""
    scenes = [scene for scene in read_scenes() if scene.quick or not options.quick]
    if options.scenes:
        scenes = [scene for scene in read_scenes() if scene.name in options.scenes]
    chosen = checkouts(options.before) if options.before else configurations(quick=options.quick)
    captions = {f"{scene.title} ({scene.bodies.count} bodies)": scene for scene in scenes}
    results = CHARTS.run(out, captions, chosen, lambda scene: run_scene(scene, chosen, say))
    titles = {scene.name: scene.title for scene in scenes}
    blocks = CHARTS.write(out, titles, chosen, results, machine)
    if README_SCENE in results and not options.before:
        draw_readme(CHARTS.images(out) / "readme.png", results[README_SCENE])
    if not options.quick and not options.before:  # these lack configurations of the tables
        blocks |= {"patch rates": rates_table(titles, results), "choosing": choosing_table(titles, results)}
    print("\n" + blocks["summary"])
    return blocks


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="a few scenes and rows, under two minutes")
    parser.add_argument("--out", type=Path, help="folder to write to (docs; out/studies for a part of a run)")
    parser.add_argument("--scenes", nargs="+", default=[], help="these scenes only")
    parser.add_argument("--methods", nargs="+", default=[], choices=list(METHODS), help="these columns of the matrix")
    parser.add_argument("--before", type=Path, help="another checkout, whose defaults run beside this one's alone")
    parser.add_argument("--charts-only", action="store_true", help="no stability matrix")
    parser.add_argument("--matrix-only", action="store_true", help="the stability matrix alone")
    return parser


if __name__ == "__main__":
    sys.exit(main())
