"""The study of speed against accuracy, and of stability: ``make studies`` runs it whole."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from smartmesh_ros.tools.evaluation.scene import read_scenes
from studies.body_contest import run_scene
from studies.chart import README_SCENE, draw_readme
from studies.configurations import checkouts, configurations
from studies.matrix.picture import draw_box, draw_matrix, matrix_table
from studies.matrix.row import METHODS
from studies.matrix.run import run_matrix
from studies.progress import Progress
from studies.results_file import save_results
from studies.tables import Charts, write_blocks

CHARTS = Charts(
    "accuracy", "make studies", "accuracy.md", "accuracy", "body", tables="accuracy_tables.md", part="out/studies"
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the scenes and the stability matrix; writes JSON, pictures and tables."""
    options = _parser().parse_args(arguments)
    if options.before and not options.out:
        options.out = Path("out/before_after")
    out, machine = CHARTS.begin(options)
    say = Progress()
    blocks = {"machine": machine}
    if not options.charts_only:  # before the charts, whose replaced meshes PyBullet keeps in memory
        _matrix(options, out, say)
    if not options.matrix_only:
        blocks |= _charts(options, out, machine, say)
    CHARTS.write(out, blocks)
    return 0


def _matrix(options: argparse.Namespace, out: Path, say: Any) -> None:
    """Run the matrix, and write its page."""
    outcomes = run_matrix(say, quick=options.quick, methods=options.methods)
    draw_matrix(CHARTS.images(out) / "stability.png", outcomes)
    real_maps = out / "images" / "real_maps"
    real_maps.mkdir(exist_ok=True)
    draw_box(real_maps / "box.png")
    save_results(CHARTS.data(out), {"stability": [asdict(outcome) for outcome in outcomes]})
    write_blocks(out / "stability.md", {"stability": matrix_table(outcomes)})


def _charts(options: argparse.Namespace, out: Path, machine: str, say: Any) -> dict[str, str]:
    """Run the scenes; return their blocks."""
    scenes = CHARTS.chosen(options, read_scenes())
    chosen = checkouts(options.before) if options.before else configurations(quick=options.quick)
    captions = {f"{scene.title} ({scene.bodies.count} bodies)": scene for scene in scenes}
    results, blocks = CHARTS.run(out, captions, chosen, lambda scene: run_scene(scene, chosen, say), machine)
    if README_SCENE in results and not options.before:
        draw_readme(CHARTS.images(out) / "readme.png", results[README_SCENE])
    print("\n" + blocks["summary"])
    return blocks


def _parser() -> argparse.ArgumentParser:
    parser = CHARTS.parser(__doc__, [scene.name for scene in read_scenes()])
    parser.add_argument("--methods", nargs="+", default=[], choices=list(METHODS), help="these columns of the matrix")
    parser.add_argument("--before", type=Path, help="another checkout, whose defaults run beside this one's alone")
    parser.add_argument("--charts-only", action="store_true", help="no stability matrix")
    parser.add_argument("--matrix-only", action="store_true", help="the stability matrix alone")
    return parser
