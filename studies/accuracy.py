"""The study of speed against accuracy, and of stability: ``make studies`` runs it whole."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from smartmesh_ros.tools.evaluation.scene import read_scenes
from studies.body_contest import run_scene
from studies.chart import draw_all, draw_scene
from studies.configurations import configurations
from studies.contest import Result
from studies.machine import describe, measured_on
from studies.matrix.picture import draw_matrix, matrix_table
from studies.matrix.real_maps_picture import draw_box
from studies.matrix.row import METHODS, Outcome
from studies.matrix.run import run_matrix
from studies.pages import fill
from studies.patch_tables import choosing_table, rates_table
from studies.progress import Progress
from studies.readme_chart import SCENE, draw_panel
from studies.results_file import read_results, records, save_results
from studies.tables import all_tables, front_table, summary_table


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the scenes and the stability matrix; writes JSON, pictures and tables."""
    options = _parser().parse_args(arguments)
    out = folder_of(options)
    images = out / "images" / "accuracy"
    images.mkdir(parents=True, exist_ok=True)
    say = Progress()

    found = describe()
    blocks: dict[str, str] = {"machine": f"{measured_on(found)}."}
    data: dict[str, Any] = {"machine": found, "quick": options.quick}
    if not options.charts_only:  # before the charts, whose replaced meshes PyBullet keeps in memory
        _matrix(options, images, blocks, data, say)
        _write(out, blocks, data)
    if not options.matrix_only:
        _charts(options, images, blocks, data, say)
        _write(out, blocks, data)
    print(f"\nwrote {out / 'accuracy.json'} and {images} in {say.elapsed:.0f} s")
    return 0


def _write(out: Path, blocks: dict[str, str], data: dict[str, Any]) -> None:
    """Write what is known by now."""
    save_results(out / "accuracy.json", data)
    if (page := out / "accuracy.md").exists():
        fill(page, blocks)


def folder_of(options: argparse.Namespace) -> Path:
    """Return the output folder of a run. Only whole runs write into docs/, so that no page mixes figures of
    machines."""
    part = options.quick or options.scenes or options.methods or options.charts_only or options.matrix_only
    folder: Path = options.out or Path("out/studies" if part else "docs")
    return folder


def _measured_before(path: Path) -> dict[str, dict[str, Result]]:
    """Return the results of an earlier run by scene."""
    scenes = read_results(path).get("scenes", {})
    return {
        scene: {name: Result(**{**values, "spread": tuple(values["spread"])}) for name, values in found.items()}
        for scene, found in scenes.items()
    }


def _beside_those_before(outcomes: list[Outcome], path: Path) -> list[Outcome]:
    """Merge new cells of the matrix with an earlier run's cells of other methods, row by row."""
    written = read_results(path).get("stability", [])
    new = {(outcome.row, outcome.method): outcome for outcome in outcomes}
    before = {(cell["row"], cell["method"]): Outcome(**cell) for cell in written}
    cells = before | new
    methods = [method for method in METHODS if any(method == known for _, known in cells)]
    return [
        cells.get((outcome.row, method)) or replace(outcome, method=method, figure=None)
        for outcome in {outcome.row: outcome for outcome in outcomes}.values()
        for method in methods
    ]


def _matrix(options: argparse.Namespace, images: Path, blocks: dict[str, str], data: dict[str, Any], say: Any) -> None:
    outcomes = run_matrix(say, quick=options.quick, methods=options.methods)
    if options.methods:
        outcomes = _beside_those_before(outcomes, images.parent.parent / "accuracy.json")
    draw_matrix(images / "stability.png", outcomes)
    real_maps = images.parent / "real_maps"
    real_maps.mkdir(exist_ok=True)
    draw_box(real_maps / "box.png")
    blocks["stability"] = matrix_table(outcomes)
    data["stability"] = [asdict(outcome) for outcome in outcomes]


def _charts(options: argparse.Namespace, images: Path, blocks: dict[str, str], data: dict[str, Any], say: Any) -> None:
    path = images.parent.parent / "accuracy.json"
    scenes = [scene for scene in read_scenes() if scene.quick or not options.quick]
    results: dict[str, dict[str, Result]] = {}
    if options.scenes:
        results = _measured_before(path)
        scenes = [scene for scene in read_scenes() if scene.name in options.scenes]
    chosen = configurations(options.quick)
    families = {configuration.name: configuration.family for configuration in chosen}
    for scene in scenes:
        results[scene.name] = run_scene(scene, chosen, say)
        title = f"{scene.title} ({scene.bodies.count} bodies)"
        draw_scene(images / f"{scene.name}.png", title, results[scene.name], families)
        data["scenes"] = records(results)
        save_results(path, data)
    titles = {scene.name: scene.title for scene in read_scenes() if scene.name in results}
    draw_all(images / "all.png", titles, results, families)
    if SCENE in results:
        draw_panel(images / "readme.png", results[SCENE])
    blocks["summary"] = summary_table(titles, results, families)
    blocks["front"] = front_table(titles, results, families)
    if not options.quick:  # a quick run lacks configurations of these tables
        blocks["patch rates"] = rates_table(titles, results)
        blocks["choosing"] = choosing_table(titles, results)
    head = f"# Accuracy: every figure of every scene\n\nWritten by `make studies`. {blocks['machine']}\n"
    head += "See [accuracy](accuracy.md) for what the figures mean.\n\n"
    (images.parent.parent / "accuracy_tables.md").write_text(head + all_tables("accuracy", titles, results))
    print("\n" + blocks["summary"])


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="a few scenes and rows, under two minutes")
    parser.add_argument("--out", type=Path, help="folder to write to (docs; out/studies for a part of a run)")
    parser.add_argument("--scenes", nargs="+", default=[], help="these scenes only; what was measured of others stays")
    parser.add_argument(
        "--methods", nargs="+", default=[], choices=list(METHODS), help="these columns of the matrix; others stay"
    )
    parser.add_argument("--charts-only", action="store_true", help="no stability matrix")
    parser.add_argument("--matrix-only", action="store_true", help="the stability matrix alone")
    return parser


if __name__ == "__main__":
    sys.exit(main())
