"""The charts of a study: its scenes are run in every configuration, drawn, and written as tables."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from studies.chart import draw_all, draw_scene
from studies.configurations import Configuration
from studies.contest import Result
from studies.results_file import records, save_results
from studies.tables import front_table, scene_table, summary_table

Results = dict[str, dict[str, Result]]


class Charts(NamedTuple):
    """``name`` of a study, also of its folder of pictures; ``command`` that runs it; ``page``: a link to what its
    figures mean; ``unit``: what the cost is of; ``data`` and ``tables``: files of its results."""

    name: str
    command: str
    page: str
    unit: str
    data: str
    tables: str

    def images(self, out: Path) -> Path:
        """Return the folder of the pictures, which is made if there is none."""
        folder = out / "images" / self.name
        folder.mkdir(parents=True, exist_ok=True)
        return folder

    def run(
        self,
        out: Path,
        scenes: Mapping[str, Any],
        chosen: Sequence[Configuration],
        run: Callable[[Any], dict[str, Result]],
    ) -> Results:
        """Return the results of ``scenes`` by ``run``; after each one its picture is drawn under its key, and all are
        kept."""
        families = {one.name: one.family for one in chosen}
        results: Results = {}
        for caption, scene in scenes.items():
            results[scene.name] = run(scene)
            draw_scene(self.images(out) / f"{scene.name}.png", caption, results[scene.name], families, self.unit)
            save_results(out / self.data, {"scenes": records(results)})
        return results

    def write(
        self, out: Path, titles: Mapping[str, str], chosen: Sequence[Configuration], results: Results, machine: str
    ) -> dict[str, str]:
        """Draw the picture of all scenes, write the page of their tables, and return the blocks of the study's page."""
        families = {one.name: one.family for one in chosen}
        draw_all(self.images(out) / "all.png", titles, results, families, self.unit)
        parts = [f"# {self.name.capitalize()}: every figure of every scene\n"]
        parts.append(f"Written by `{self.command}`. {machine}\nSee {self.page} for what the figures mean.\n")
        for name, title in titles.items():
            picture = f"![](images/{self.name}/{name}.png)"
            parts.append(f"## {title}\n\n{picture}\n\n{scene_table(results[name])}\n")
        (out / self.tables).write_text("\n".join(parts))
        return {
            "summary": summary_table(titles, results, families), "front": front_table(titles, results, families)
        }  # fmt: skip
