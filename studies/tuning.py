"""``make tuning``: tunes three scenes and a bag of the demo, and writes the table of docs/tuning.md."""

import shutil
from pathlib import Path

from smartmesh_ros.startup.executables import silence_pybullet

SCENES = ("heave", "sinusoid", "sliding_boxes")
BAG, DOCUMENT = Path("out/demo_bag"), Path("docs/tuning.md")
HEAD = (
    "case", "defaults: share of a core", "penetration [mm]", "tuned: share of a core", "penetration [mm]", "cost",
    "hover, defaults / tuned [mm]", "changed",
)  # fmt: skip


def main() -> None:
    """Tune all cases and write the table."""
    silence_pybullet()
    from scripts.make_demo_bag import write
    from smartmesh_ros.tools.tune import cli
    from smartmesh_ros.tools.tune.grid import settings_to_try
    from studies.pages import fill, short, table

    shutil.rmtree(BAG, ignore_errors=True)
    bag = [str(BAG), "--params-file", str(write(BAG)), "--seconds", "2"]
    rows = []
    for words in (*([scene] for scene in SCENES), bag):
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
