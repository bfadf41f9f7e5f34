"""``ros2 run smartmesh_ros tune``: parameters for a budget, found on your own terrain and bodies.

SOURCE is a bag, a scene of the package, or a scene file. Rates of physics and residuals of the solver on a grid are
replayed, each in a process of its own, and measured. With --penetration the cheapest settings within all limits are
chosen, with --budget or --deadline alone the most accurate within these, and without any of them the cheapest with no
more penetration than the defaults.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from pathlib import Path

from smartmesh_ros.startup.arguments import Parser, make_folder, number
from smartmesh_ros.tools.replay.cli import ProgressLine, add_node_arguments, ended, rules_of
from smartmesh_ros.tools.replay.parameters import preset_values, read_parameters
from smartmesh_ros.tools.replay.transport import Names
from smartmesh_ros.tools.tune.case import open_case
from smartmesh_ros.tools.tune.grid import measure_all
from smartmesh_ros.tools.tune.report import Result, lines_of, parameter_file

# Figures that options limit.
LIMITS = {"budget": "cost", "penetration": "penetration", "deadline": "longest"}


def main(arguments: Sequence[str] | None = None) -> int:
    """Search, and return the exit code: 0 = limits met, 1 = limits not met, 2 = cannot start, 130 = interrupted."""
    return ended(parser(), arguments, _run, needs="rosbags matplotlib")


def _run(options: argparse.Namespace, _: object) -> int:
    from smartmesh_ros.tools.tune.chart import draw  # needs Matplotlib

    make_folder(options.out)
    result = find(options)
    name = result.case.source.stem
    file, chart = options.out / f"{name}_{'tuned' if result.keeps else 'nearest'}.yaml", options.out / f"{name}.png"
    file.write_text(parameter_file(result))
    draw(chart, result)
    print("\n".join([*lines_of(result), f"Written: {file}", f"The chart: {chart}"]))
    return 0 if result.keeps else 1


def find(options: argparse.Namespace) -> Result:
    """Measure the grid for the options of a command line. Raises `InputError`."""
    given = {figure: getattr(options, option) for option, figure in LIMITS.items()}
    asked = {figure: limit for figure, limit in given.items() if limit is not None}
    rules = rules_of(options.remap)
    preset = preset_values(options.preset) if options.preset else {}
    parameters = {**preset, **read_parameters(options.params_file, options.param, Names(rules).node)}
    case, line = open_case(options.source, parameters, rules, options.seconds), ProgressLine()
    points = measure_all(case, options.jobs, line.show)
    line.clear()
    return Result(case, asked, points)


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    found, amount = Parser("tune", description=__doc__), number(float, 1e-9, math.inf)
    found.add_argument("source", metavar="SOURCE", help="a bag, a scene's name, or a scene file")
    given = found.add_argument_group("input")
    add_node_arguments(given)
    given.add_argument("--preset", default="", help="preset to start from, a name in config/")
    given.add_argument("--seconds", type=amount, help="length of a run (a scene's own; 5 s of a bag)")
    asked = found.add_argument_group("limits")
    asked.add_argument("--budget", type=amount, help="maximum cost, as a share of a core")
    asked.add_argument("--penetration", type=amount, help="maximum 99th percentile of penetration [m]")
    asked.add_argument("--deadline", type=amount, help="maximum processor time of a step [s]")
    jobs = number(int, 1, 1000)
    found.add_argument("--jobs", type=jobs, default=1, help="processes at a time (1; more disturb each other's cost)")
    found.add_argument("--out", type=Path, default=Path("out/tune"), help="folder for results (out/tune)")
    return found
