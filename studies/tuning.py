"""``make tuning``: tunes eight scenes and a bag of the demo, and writes the table of docs/tuning.md."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from smartmesh_ros.startup.executables import silence_pybullet
from studies.pages import digest_of

SCENES = ("crater", "heave", "noise", "rut", "sinusoid", "sliding_boxes", "stairs", "waves_w04")
# Settings that are tried in each case; folder of results, studies and files of this code; and the page.
TRIALS, OUT, DOCUMENT = 96, Path("out/tuning") / digest_of("tuner"), Path("docs/tuning.md")
# Cheaper, or truer, by less than this share is not told from noise.
CLEARLY = 0.03


def main(arguments: Sequence[str] | None = None) -> int:
    """Tunes what is not in the results yet; with all of them there it only writes the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bag", type=Path, help="bag of the demo, see scripts/make_demo_bag.py")
    parser.add_argument("--params-file", type=Path, help="parameter file of that bag")
    options = parser.parse_args(arguments)
    silence_pybullet()
    from studies.machine import short
    from studies.markdown import table
    from studies.pages import fill

    results = OUT / "results.json"
    OUT.mkdir(parents=True, exist_ok=True)
    found: dict[str, Any] = json.loads(results.read_text()) if results.exists() else {}
    for source in [*SCENES, *([str(options.bag)] if options.bag else [])]:
        if source not in found:
            found[source] = _tuned(source, options)
            results.write_text(json.dumps(found, indent=1) + "\n")
            print(" | ".join(_row(found[source])), flush=True)
    about = f"Measured on {short()}, {TRIALS} settings tried in each."
    won = sum(_verdict(result) != ON_FRONT for result in found.values())
    summary = f"Better than the defaults in {won} of {len(found)}."
    fill(DOCUMENT, {"table": f"{about} {summary}\n\n{table(HEAD, map(_row, found.values()))}"})
    print(f"{summary} Wrote {DOCUMENT}")
    return 0


HEAD = (
    "case", "defaults: share of a core", "penetration [mm]", "tuned: share of a core", "penetration [mm]", "cost",
    "hover, defaults / tuned [mm]", "verdict", "changed",
)  # fmt: skip
ON_FRONT = "the defaults are on the front"


def _tuned(source: str, options: argparse.Namespace) -> dict[str, Any]:
    """The confirmed figures of one case."""
    from smartmesh_ros.tools.tune import space
    from smartmesh_ros.tools.tune.cli import parser
    from smartmesh_ros.tools.tune.report import parameter_file
    from smartmesh_ros.tools.tune.session import find

    words = [source, "--trials", str(TRIALS), "--out", str(OUT)]
    given = parser().parse_args(words)
    if options.bag is not None and source == str(options.bag):
        given.params_file = options.params_file
    search, verdict = find(given)
    (OUT / f"{search.case.name}_tuned.yaml").write_text(parameter_file(search, verdict))
    return {
        "title": search.case.title, "defaults": asdict(verdict.defaults), "tuned": asdict(verdict.chosen.figures),
        "changed": space.changes(verdict.chosen.values),
    }  # fmt: skip


def _verdict(result: dict[str, Any]) -> str:
    """Whether the tuned file is better in one and no worse in the other, both in the confirming run."""
    before, after = result["defaults"], result["tuned"]
    cheaper = after["cost"] < (1.0 - CLEARLY) * before["cost"] and after["penetration"] <= before["penetration"]
    truer = after["penetration"] < (1.0 - CLEARLY) * before["penetration"] and after["cost"] <= before["cost"]
    words = [word for word, holds in (("cheaper", cheaper), ("truer", truer)) if holds]
    return " and ".join(words) or ON_FRONT


def _row(result: dict[str, Any]) -> list[str]:
    before, after = result["defaults"], result["tuned"]
    changed = ", ".join(f"`{name}` {value}" for name, value in result["changed"].items())
    return [
        result["title"], f"{before['cost']:.3f}", f"{1e3 * before['penetration']:.3f}", f"{after['cost']:.3f}",
        f"{1e3 * after['penetration']:.3f}", f"{after['cost'] / before['cost']:.2f} x",
        f"{1e3 * before['hover']:.2f} / {1e3 * after['hover']:.2f}", _verdict(result), changed or "-",
    ]  # fmt: skip


if __name__ == "__main__":
    sys.exit(main())
