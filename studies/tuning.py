"""``make tuning``: tunes three scenes and a bag of the demo, and writes the table of docs/tuning.md."""

import argparse
from collections.abc import Sequence
from pathlib import Path

from smartmesh_ros.startup.executables import silence_pybullet

SCENES = ("heave", "sinusoid", "sliding_boxes")
DOCUMENT = Path("docs/tuning.md")
HEAD = (
    "case", "defaults: share of a core", "penetration [mm]", "tuned: share of a core", "penetration [mm]", "cost",
    "hover, defaults / tuned [mm]", "changed",
)  # fmt: skip


def main(arguments: Sequence[str] | None = None) -> None:
    """Tune all cases and write the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bag", help="bag of the demo, see scripts/make_demo_bag.py")
    parser.add_argument("--params-file", help="parameter file of that bag")
    options = parser.parse_args(arguments)
    silence_pybullet()
    from smartmesh_ros.tools.tune import cli
    from smartmesh_ros.tools.tune.grid import settings_to_try
    from studies.pages import fill, short, table

    bag = [[options.bag, "--params-file", options.params_file, "--seconds", "2"]] if options.bag else []
    rows = []
    for words in [*([scene] for scene in SCENES), *bag]:
        result = cli.find(cli.parser().parse_args(words))
        before, after = result.defaults, result.chosen
        rows.append([
            result.case.title, f"{before.cost:.3f}", f"{1e3 * before.penetration:.3f}", f"{after.cost:.3f}",
            f"{1e3 * after.penetration:.3f}", f"{after.cost / before.cost:.2f} x",
            f"{1e3 * before.hover:.2f} / {1e3 * after.hover:.2f}",
            ", ".join(f"`{name}` {value}" for name, value in result.changed.items()) or "-",
        ])  # fmt: skip
        print(" | ".join(rows[-1]), flush=True)
    about = f"Measured on {short()}, {len(settings_to_try({}))} settings in each."
    fill(DOCUMENT, {"table": f"{about}\n\n{table(HEAD, rows)}"})
