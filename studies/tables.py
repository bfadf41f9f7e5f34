"""Tables of what contests found, and the charts of a study: its scenes are run, drawn, and written as tables."""

import argparse
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, NamedTuple

from studies.chart import draw_all, draw_scene
from studies.contest import Result, beyond_all, cheapest_as_accurate, deviation_of, distance_of, measures_of, only_by
from studies.pages import blocks_of, fill, measured_on, save, table

OURS = ("ours", "ours, less")


def scene_table(results: Mapping[str, Result]) -> str:
    """Everything measured in one scene, a configuration a row; those on the Pareto front are bold, with the measure if
    they are there by one only."""
    front = only_by(results)
    rows = []
    for name, r in results.items():
        shown = f"**{name}**{f' (by {front[name]})' if front[name] else ''}" if name in front else name
        if math.isnan(r.cost):
            rows.append([f"{name}: {r.note}", *["-"] * 9])
            continue
        shown += f" ({r.note})" if r.note else ""
        rows.append([
            shown, f"{r.cost / 1e3:.2f}", f"{r.spread[0] / 1e3:.2f}-{r.spread[1] / 1e3:.2f}", f"{r.update / 1e3:.2f}",
            *(_mm(value) for value in (r.p50, r.p99, r.most, r.hover)), f"{r.lost} of {r.bodies}",
            f"{_mm(r.deviation)} / {_mm(r.most_deviation)}",
        ])  # fmt: skip
    header = [
        "configuration", "cost [ms]", "quartiles", "update [ms]", "p50 [mm]", "p99 [mm]", "max [mm]", "hover [mm]",
        "lost", "deviation, median / max [mm]",
    ]  # fmt: skip
    return table(header, rows)


def summary_table(titles: Mapping[str, str], results: Mapping[str, Mapping[str, Result]]) -> str:
    """One row a scene, by its name in ``titles``: the defaults, and how they stand against the rivals."""
    header = [
        "scene", "defaults: cost [ms]", "distance [mm]", "deviation [mm]", "lost",
        "cheapest rival no further from the ground", "nor from the reference", "cheapest rival, and its distance",
        "faster and more accurate than all of ours",
    ]  # fmt: skip
    rows = []
    for scene, title in titles.items():
        found = results[scene]
        ours = {name: result for name, result in found.items() if result.family in OURS}
        rivals = {name: result for name, result in found.items() if result.family not in OURS}
        own, distance = found["defaults"], distance_of(found["defaults"])
        both = deviation_of(own) if len(measures_of(found)) > 1 else math.inf
        row = [title, f"{own.cost / 1e3:.2f}", _mm(distance), _mm(own.deviation), f"{own.lost} of {own.bodies}"]
        for within in ((distance, math.inf), (distance, both), (math.inf, math.inf)):
            name = cheapest_as_accurate(rivals, *within)
            row.append("none" if name is None else f"{name}: {rivals[name].cost / own.cost:.2g} x")
        row[-1] = "-" if name is None else f"{row[-1]}, {_mm(distance_of(found[name]))} mm"
        rows.append([*row, ", ".join(beyond_all(ours, rivals)) or "none"])
    return table(header, rows)


def _mm(metres: float) -> str:
    return f"{1e3 * metres:.2f}" if math.isfinite(metres) else "-"


class Charts(NamedTuple):
    """``name`` of a study, also of its folder of pictures and its file of data; ``command`` that runs it; ``page`` of
    its blocks, and the ``title`` of links to it; ``unit``: what the cost is of; ``tables``: file of all figures;
    ``part``: folder of runs that are not whole."""

    name: str
    command: str
    page: str
    title: str
    unit: str
    tables: str
    part: str

    def parser(self, about: str, scenes: Sequence[str]) -> argparse.ArgumentParser:
        """Return the options of a study about ``scenes`` by their names."""
        parser = argparse.ArgumentParser(description=about)
        parser.add_argument("--quick", action="store_true", help="a few scenes and engines, under two minutes")
        parser.add_argument("--out", type=Path, help=f"folder to write to (docs; {self.part} for a part of a run)")
        parser.add_argument(
            "--scenes", nargs="+", default=[], choices=scenes, metavar="SCENE", help="these scenes only"
        )
        return parser

    def folder(self, options: argparse.Namespace) -> Path:
        """Return the output folder of a run. Only whole runs write into docs/, so that no page mixes figures of
        machines."""
        part = any(value for name, value in vars(options).items() if name != "out")
        return options.out or Path(self.part if part else "docs")

    def chosen(self, options: argparse.Namespace, scenes: Sequence[Any]) -> list[Any]:
        """Return the scenes that the options name, or those of a whole or of a quick run."""
        named = [scene for scene in scenes if scene.name in options.scenes]
        return named or [scene for scene in scenes if scene.quick or not options.quick]

    def data(self, out: Path) -> Path:
        """Return the file of the results."""
        return out / f"{self.name}.json"

    def images(self, out: Path) -> Path:
        """Return the folder of the pictures, which is made if there is none."""
        folder = out / "images" / self.name
        folder.mkdir(parents=True, exist_ok=True)
        return folder

    def run(
        self, out: Path, scenes: Mapping[str, Any], run: Callable[[Any], dict[str, Result]]
    ) -> tuple[dict[str, dict[str, Result]], dict[str, str]]:
        """Return the results of ``scenes``, which have their captions as keys, by ``run``, and blocks of the page.
        Each scene is drawn and kept at once; then come the picture and the tables of all."""
        machine = f"{measured_on()}."
        titles = {scene.name: scene.title for scene in scenes.values()}
        results: dict[str, dict[str, Result]] = {}
        parts = [f"# {self.name.capitalize()}: every figure of every scene\n"]
        parts.append(
            f"Written by `{self.command}`. {machine}\nSee [{self.title}]({self.page}) for what the figures mean.\n"
        )
        for caption, scene in scenes.items():
            found = results[scene.name] = run(scene)
            draw_scene(self.images(out) / f"{scene.name}.png", caption, found, self.unit)
            kept = {name: {one: asdict(result) for one, result in of.items()} for name, of in results.items()}
            save(self.data(out), {"machine": machine, "scenes": kept})
            picture = f"![](images/{self.name}/{scene.name}.png)"
            parts.append(f"## {scene.title}\n\n{picture}\n\n{scene_table(found)}\n")
        draw_all(self.images(out) / "all.png", titles, results, self.unit)
        (out / self.tables).write_text("\n".join(parts))
        return results, {"machine": machine, "summary": summary_table(titles, results)}

    def write(self, out: Path, blocks: Mapping[str, str]) -> None:
        """Replace the blocks of the page."""
        write_blocks(out / self.page, blocks)
        print(f"\nwrote {out / self.page}, {self.tables}, {self.data(out).name} and {self.images(out)}")


def write_blocks(page: Path, blocks: Mapping[str, str]) -> None:
    """Replace blocks of a page; if there is none yet, write one of nothing else."""
    if page.exists() and blocks_of(page):
        fill(page, blocks)
    else:
        page.write_text("\n\n".join(blocks.values()) + "\n")
