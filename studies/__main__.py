"""``python -m studies NAME [options]``: the studies of this project, by name."""

from __future__ import annotations

import argparse
import importlib
import sys

# By name: the module and the function that run the study, ``main`` unless another is named, and a description.
STUDIES = {
    "accuracy": ("studies.accuracy", "speed against accuracy, and the stability matrix"),
    "bench": ("studies.bench.cli", "running times against the report's tables"),
    "contacts": ("studies.contact_picture", "a figure of how contacts with a map work"),
    "docs-check": ("studies.pages", "the tables of docs/ whose figures are older than the code"),
    "fleet": ("studies.fleet.study", "several nodes on one terrain, in networks of their own"),
    "friction": ("studies.friction_picture", "a picture of boxes on ice beside gravel"),
    "laws": ("studies.laws.study", "laws of contact, and how far runs drift apart, in each engine"),
    "lidar": ("studies.lidar_picture", "a picture of what a lidar measures"),
    "load": ("studies.load.study", "the node under load over DDS"),
    "records": ("studies.records.study", "terrain tax, touchdown and size of cells, beside other engines"),
    "replay": ("studies.replay_speed", "how much faster than real time a replay runs"),
    "rising": ("studies.rising_picture", "the README's moving picture: bodies sink into rising ground"),
    "robots": ("studies.robots.study", "robots on rough and moving ground, beside other engines"),
    "rover": ("studies.soil.rut_pictures:drive_rover", "a wheeled robot on soil: pictures of its ruts"),
    "soil": ("studies.soil.study", "soil against closed forms, a measured wheel, and its cost"),
    "tracks": ("studies.soil.rut_pictures:drive_tracks", "a tracked machine on soil: pictures of its ruts"),
    "soak": ("studies.load.soak", "the node for minutes or hours of everything changing"),
    "tuning": ("studies.tuning", "tuned scenes and a bag, the table of docs/tuning.md"),
}
PLAIN = ("contacts", "friction", "laws", "lidar", "replay", "rising", "rover", "tracks")  # have no options


def main() -> None:
    """Runs the study that the command line names."""
    parser = argparse.ArgumentParser(
        prog="python -m studies", usage="python -m studies NAME [options]",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog="\n".join(f"  {name:14}{about}" for name, (_, about) in STUDIES.items()),
    )  # fmt: skip
    parser.add_argument("name", choices=STUDIES, metavar="NAME", help="a study; NAME --help tells its options")
    name = parser.parse_args(sys.argv[1:2]).name
    sys.argv = [f"python -m studies {name}", *sys.argv[2:]]
    place, about = STUDIES[name]
    if name in PLAIN:
        argparse.ArgumentParser(description=about).parse_args()
    module, _, function = place.partition(":")
    sys.exit(getattr(importlib.import_module(module), function or "main")())


if __name__ == "__main__":
    main()
