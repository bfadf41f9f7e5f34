"""``ros2 run smartmesh_ros tune``: parameters for a budget, found on your own terrain and bodies.

SOURCE is a bag (the folder with metadata.yaml), a scene of the package, or a scene file. The search replays it through
the core in simulated time, without a running node. With --penetration the search chooses the cheapest settings within
all limits, with --budget or --deadline alone the most accurate within these, and without any of them the cheapest with
no more penetration than the defaults. After Ctrl-C the same command resumes the search.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from smartmesh_ros.errors import InputError


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a search and return the exit code: 0 = limits met, 1 = limits not met, 2 = cannot start, 130 =
    interrupted."""
    options = parser().parse_args(arguments)
    try:
        from smartmesh_ros.tools.tune.session import run_session

        return run_session(options)
    except ModuleNotFoundError as error:
        if error.name not in ("optuna", "rosbags", "matplotlib"):
            raise
        print(f"tune needs {error.name}: pip install optuna rosbags matplotlib", file=sys.stderr)
    except InputError as error:
        print(f"tune: {error}", file=sys.stderr)
    except KeyboardInterrupt:
        print("\ninterrupted; the results are stored, and the same command resumes the search", file=sys.stderr)
        return 130
    return 2


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    found = argparse.ArgumentParser(
        prog="tune", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    found.add_argument("source", metavar="SOURCE", help="a bag, a scene's name, or a scene file")
    given = found.add_argument_group("input")
    given.add_argument("--params-file", type=Path, help="parameter file to start from, with bodies.spawn or robot")
    given.add_argument("--preset", default="", help="preset to start from, a name in config/")
    given.add_argument(
        "--set", action="append", default=[], metavar="NAME=VALUE", dest="single", help="a single parameter"
    )
    given.add_argument("--terrain", default="", metavar="TOPIC", help="topic of the maps, if the bag has several")
    given.add_argument("--seconds", type=float, help="length of a searching run on a bag (3 s, at most half of it)")
    asked = found.add_argument_group("limits")
    asked.add_argument("--budget", type=float, help="maximum cost, as a share of a core")
    asked.add_argument("--penetration", type=float, help="maximum 99th percentile of penetration [m]")
    asked.add_argument("--deadline", type=float, help="maximum processor time of a step [s]")
    asked.add_argument("--hover", type=float, help="maximum 99th percentile of hover [m] (twice the defaults')")
    asked.add_argument("--deviation", type=float, help="maximum deviation from the reference [m] (twice the defaults')")
    how = found.add_argument_group("search")
    how.add_argument("--trials", type=int, default=96, help="total number of settings to try (96)")
    how.add_argument("--jobs", type=int, default=1, help="processes on this machine (1)")
    how.add_argument("--storage", default="", help="journal file or sqlite:///FILE (tune.journal in --out)")
    how.add_argument("--seed", type=int, help="seed of the sampler, for repeatable runs")
    how.add_argument("--out", type=Path, default=Path("out/tune"), help="folder for results (out/tune)")
    return found
