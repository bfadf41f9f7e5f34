"""``ros2 run smartmesh_ros replay``: what the collider makes of a bag, without DDS, the same each time.

BAG is the folder with metadata.yaml, or a single .mcap or .db3 file. The topics, services and parameters are those of
terrain_collider; -p, -r and --params-file are as for the node. The last line is a digest of states and contacts:
the same bag and parameters give the same digest and the same bytes on one machine.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Any

from smartmesh_ros.errors import InputError, naming
from smartmesh_ros.node.running import Stop
from smartmesh_ros.startup.arguments import Parser, refuse_expanded
from smartmesh_ros.startup.executables import INTERRUPTED
from smartmesh_ros.tools.replay.bag import Bag
from smartmesh_ros.tools.replay.parameters import read_parameters
from smartmesh_ros.tools.replay.replay import Replay
from smartmesh_ros.tools.replay.transport import Names

if TYPE_CHECKING:
    from smartmesh_ros.tools.replay.mcap_file import McapFile

# Time between two updates of the progress bar [s], and its length [characters].
PERIOD, BAR = 0.2, 30


def main(arguments: Sequence[str] | None = None) -> int:
    """Replay a bag; return the exit code: 0 = done, 1 = not the digest of ``--check``, 2 = cannot start, 130 =
    interrupted."""
    return ended(parser(), arguments, _run, needs="rosbags")


def ended(
    parser: argparse.ArgumentParser,
    arguments: Sequence[str] | None,
    run: Callable[[argparse.Namespace, Stop | None], int],
    *,
    needs: str,
) -> int:
    """Run a command by its ``arguments``, None = those of the process, whose signals `Stop` then notes; return its exit
    code, 2 if it refuses them or one of the packages that it ``needs`` is missing, 130 if a signal interrupts it."""
    stop = Stop() if arguments is None else None
    given = [word for word in (sys.argv[1:] if arguments is None else arguments) if word != "--ros-args"]
    options = parser.parse_args(given)
    try:
        return run(options, stop)
    except ModuleNotFoundError as error:
        if error.name not in needs.split():
            raise
        print(f"{parser.prog} needs {error.name}: pip install {needs}", file=sys.stderr)
    except InputError as error:
        print(f"{parser.prog}: {error}", file=sys.stderr)
    except KeyboardInterrupt:
        print("\ninterrupted", file=sys.stderr)
        return INTERRUPTED
    return 2


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    found = Parser("replay", description=__doc__)
    found.add_argument("bag", metavar="BAG", type=Path, help="a recorded bag")
    add_node_arguments(found)
    found.add_argument("-o", "--output", type=Path, metavar="OUT.mcap", help="file for the outputs (none)")
    found.add_argument("--topics", nargs="+", default=[], metavar="TOPIC", help="outputs, such as body_states (all)")
    found.add_argument("--until", type=float, metavar="T", help="end after T seconds (with the bag)")
    found.add_argument("--check", metavar="SHA256", help="exit with 1 unless this is the digest")
    return found


def add_node_arguments(parser: Any) -> None:
    """Add the arguments that are as for the node."""
    parser.add_argument("--params-file", type=Path, action="append", default=[], metavar="FILE", help="parameter file")
    parser.add_argument("-p", "--param", action="append", default=[], metavar="NAME:=VALUE", help="a parameter")
    parser.add_argument(
        "-r", "--remap", action="append", default=[], metavar="FROM:=TO",
        help="a topic or service under another name, as in -r '~/heightmap:=/maps'; also __node and __ns",
    )  # fmt: skip


def _run(options: argparse.Namespace, stop: Stop | None) -> int:
    until = math.inf if options.until is None else options.until
    if not until > 0.0:
        raise InputError("parameter", f"--until is {until:g}; it must be a number of seconds above zero")
    bag, rules, line = Bag(options.bag), rules_of(options.remap), ProgressLine()
    parameters = read_parameters(options.params_file, options.param, Names(rules).node)
    file = None
    if options.output is not None:
        from smartmesh_ros.tools.replay.mcap_file import McapFile

        file, place = McapFile(options.output), options.output.resolve()
        if place.exists() and bag.path.resolve() in (place, place.parent):
            raise InputError("file", f"-o {file.path} is the bag itself, or one of its files; name another file")
    with Replay(bag, parameters, remap=rules, file=file, topics=options.topics, say=line.say) as replay:
        if unknown := sorted({*replay.names.all_of(options.topics)} - replay.outputs):
            there = ", ".join(sorted(replay.outputs))
            raise InputError("topic", f"--topics: there is no output {', '.join(unknown)}; the outputs are {there}")
        begun = monotonic()
        if stop is not None:
            stop.starting = False  # a signal ends the run between two steps
        with file or nullcontext():
            for _ in replay.steps(until):
                line.show(replay.time / max(min(bag.end - replay.clock.start, until), 1e-9))
                if stop is not None and stop.asked:
                    break
            line.clear()
            if file is not None:
                file.note("smartmesh_ros_digest", replay.digest)
        speed = replay.time / max(monotonic() - begun, 1e-9)
        return report(replay, speed, file, options.check, interrupted=stop is not None and stop.asked)


def report(replay: Replay, speed: float, file: McapFile | None, check: str | None, *, interrupted: bool) -> int:
    """Print what was done, and return the exit code."""
    print(f"replayed {replay.time:.3f} s, {speed:.1f} times as fast as real time{', until interrupted' * interrupted}")
    for what, count in replay.refused.items():
        print(f"refused {count} times: {what}")
    for topic, kind in replay.left_out.items():
        cure = f"-r '~/INPUT:={topic}' would make it an input"
        if topic.startswith(f"{replay.names.node}/"):
            cure = "the node had other parameters or remappings when it was recorded"
        print(f"left out: {topic} ({kind}); {cure}")
    if file is not None:
        print(f"wrote {file.path}: {', '.join(f'{topic} ({count})' for topic, count in file.counts.items())}")
    same = check is None or check.strip().lower() == replay.digest
    if not same:
        print(f"the digest is not {check}, that of --check")
    print(f"digest: {replay.digest}", flush=True)
    return INTERRUPTED if interrupted else int(not same)


def rules_of(remaps: Sequence[str]) -> list[tuple[str, str]]:
    """Return remapping rules from texts ``from:=to``. Raises `InputError`."""
    refuse_expanded(remaps)
    rules = [(old, new) for old, _, new in (text.partition(":=") for text in remaps)]
    if wrong := [text for text, (old, new) in zip(remaps, rules, strict=True) if not (old and new)]:
        raise InputError("arguments", f"-r {wrong[0]!r} must be from:=to, as in -r '~/heightmap:=/maps'")
    with naming("-r"):
        Names(rules)
    return rules


class ProgressLine:
    """The last line of a terminal on standard error, below what is logged there."""

    def __init__(self) -> None:
        self._shows, self._due = sys.stderr.isatty(), 0.0

    def show(self, share: float) -> None:
        """Show which share of the work is done, at most every `PERIOD`."""
        if not self._shows or monotonic() < self._due:
            return
        self._due = monotonic() + PERIOD
        done = round(BAR * min(max(share, 0.0), 1.0))
        print(f"\r\033[K[{'#' * done}{' ' * (BAR - done)}] {share:4.0%}", end="", file=sys.stderr, flush=True)

    def clear(self) -> None:
        """Remove the line."""
        if self._shows:
            print("\r\033[K", end="", file=sys.stderr, flush=True)

    def say(self, text: str) -> None:
        """Print a line above it."""
        self.clear()
        print(text, file=sys.stderr)
