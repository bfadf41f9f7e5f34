"""``ros2 run smartmesh_ros tune``: parameters for a budget, found on your own terrain and bodies.

SOURCE is a bag (the folder with metadata.yaml), a scene that ships with the package, or a scene file. It is replayed
through the core in simulated time; nothing needs to run. With --penetration the cheapest settings that keep what is
asked are chosen, with --budget or --deadline alone the truest ones within it, and with none of them the cheapest that
have no more penetration than the defaults. Ctrl-C keeps what was found, and the same command goes on.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from smartmesh_ros.errors import InputError
from smartmesh_ros.startup.quiet import silence_pybullet

INTERRUPTED = 130


def start() -> int:
    """The executable: quiet first, because measuring imports PyBullet."""
    silence_pybullet()
    return main()


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs a search; 0 = what is asked is kept, 1 = it is not possible, 2 = it could not begin, 130 = interrupted."""
    options = parser().parse_args(arguments)
    try:
        from smartmesh_ros.tune.session import run_session

        return run_session(options)
    except ModuleNotFoundError as error:
        if error.name not in ("optuna", "rosbags", "matplotlib"):
            raise
        print(f"tune needs {error.name}: pip install optuna rosbags matplotlib", file=sys.stderr)
    except InputError as error:
        print(f"tune: {error}", file=sys.stderr)
    except KeyboardInterrupt:
        print("\ninterrupted; what was found is kept, and the same command goes on", file=sys.stderr)
        return INTERRUPTED
    return 2


def parser() -> argparse.ArgumentParser:
    """The command line."""
    found = argparse.ArgumentParser(
        prog="tune", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    found.add_argument("source", metavar="SOURCE", help="a bag, a scene's name, or a scene file")
    given = found.add_argument_group("what is given")
    given.add_argument("--params-file", type=Path, help="parameter file to start from: its bodies.spawn, its robot")
    given.add_argument("--preset", default="", help="preset to start from, a name in config/")
    given.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", dest="single", help="one parameter")
    given.add_argument("--terrain", default="", metavar="TOPIC", help="topic of the maps, where the bag has several")
    given.add_argument("--seconds", type=float, help="how much of a bag is searched on (3 s, half of it at the most)")
    asked = found.add_argument_group("what is asked")
    asked.add_argument("--budget", type=float, help="share of a core, at the most")
    asked.add_argument("--penetration", type=float, help="99th percentile of penetration, at the most [m]")
    asked.add_argument("--deadline", type=float, help="processor time of the longest step, at the most [s]")
    asked.add_argument("--hover", type=float, help="99th percentile of hover, at the most [m] (twice the defaults')")
    asked.add_argument("--deviation", type=float, help="from the reference, at the most [m] (twice the defaults')")
    how = found.add_argument_group("how it is searched")
    how.add_argument("--trials", type=int, default=96, help="settings that are tried in all (96)")
    how.add_argument("--jobs", type=int, default=1, help="processes on this machine (1)")
    how.add_argument("--storage", default="", help="journal file or sqlite:///FILE that processes share")
    how.add_argument("--seed", type=int, help="of the sampler, for runs that can be repeated")
    how.add_argument("--out", type=Path, default=Path("out/tune"), help="folder of what is written (out/tune)")
    return found


if __name__ == "__main__":
    sys.exit(start())
