"""``python -m studies NAME [options]``: the studies of this project, by name."""

import argparse
import sys
from importlib import import_module

# Module of each study by its name, and the function that runs it; `main` unless another is named.
STUDIES = {
    "accuracy": "accuracy", "bench": "bench.study", "contacts": "contact_picture", "docs-check": "pages",
    "fleet": "fleet", "friction": "friction_picture", "laws": "laws", "lidar": "lidar_picture",
    "load": "load.study", "records": "records.study", "replay": "replay_speed", "rising": "rising_picture",
    "robots": "robots.study", "rover": "soil.rut_pictures:drive_rover", "soil": "soil.study",
    "tracks": "soil.rut_pictures:drive_tracks", "soak": "load.soak", "tuning": "tuning",
}  # fmt: skip
# Those with options.
OWN = ("accuracy", "load", "robots", "soak", "soil")


def main() -> None:
    """Runs the study that the command line names."""
    parser = argparse.ArgumentParser(prog="python -m studies", usage="python -m studies NAME [options]")
    parser.add_argument("name", choices=STUDIES, help="a study; NAME --help says what it does, and its options")
    name = parser.parse_args(sys.argv[1:2]).name
    sys.argv = [f"python -m studies {name}", *sys.argv[2:]]
    place, _, function = STUDIES[name].partition(":")
    module = import_module(f"studies.{place}")
    if name not in OWN:
        argparse.ArgumentParser(description=module.__doc__).parse_args()
    sys.exit(getattr(module, function or "main")())


if __name__ == "__main__":
    main()
