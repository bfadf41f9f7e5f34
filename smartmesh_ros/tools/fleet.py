"""``smartmesh-fleet``: several nodes on one moving terrain, their front, and bodies, without a ROS installation.

A process that ends is restarted. Stop the fleet with Ctrl-C or SIGTERM, or set --seconds.
"""

from __future__ import annotations

import math
import subprocess
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from time import monotonic

from shape_msgs.msg import SolidPrimitive
from smartmesh_msgs.msg import BodySpecification, Timing

from smartmesh_ros.errors import counted
from smartmesh_ros.node.fleet.layout import commands, front_of
from smartmesh_ros.node.parameters.settings import MOST_BODIES
from smartmesh_ros.startup.arguments import Parser, number
from smartmesh_ros.startup.dds import isolated_unless_chosen
from smartmesh_ros.tools.client.remote import Remote, following
from smartmesh_ros.tools.messages import pose_message

# Limit of every wait [s], generous for a busy machine.
TIMEOUT = 120.0
MASS = 5.0  # of a ball [kg]
# Spacing of the balls' square grid, their start height and radius [m].
SPACING, START_HEIGHT, RADIUS = 0.9, 0.8, 0.25


def wait_for_nodes(front: Remote, count: int) -> None:
    """Wait until the front of a fleet hears all nodes. Raises `InputError`."""
    words = counted(count, "node", "nodes")
    front.wait_for(lambda: "nodes" in front.tasks and front.tasks["nodes"].message == words, f"fleet of {words}")


def balls(places: Iterable[tuple[str, float, float, float]], radius: float) -> list[BodySpecification]:
    """Return balls of a ``radius`` [m] at places (name, x, y, z) [m], to be spawned."""
    shape = SolidPrimitive(type=SolidPrimitive.SPHERE, dimensions=[radius])
    return [BodySpecification(id=name, shape=shape, mass=MASS, pose=pose_message(place)) for name, *place in places]


def grid(count: int) -> Iterator[tuple[str, float, float, float]]:
    """Yield ``count`` places (name, x, y, z) [m] in a square grid."""
    side = max(round(count**0.5), 1)
    for index in range(count):
        row, column = divmod(index, side)
        yield f"ball_{index}", SPACING * (column - 0.5 * side), SPACING * (row - 0.5 * side), START_HEIGHT


@contextmanager
def processes(commands: dict[str, list[str]]) -> Iterator[dict[str, subprocess.Popen[bytes]]]:
    """Run commands by name as processes for the length of the block; yield the processes."""
    running: dict[str, subprocess.Popen[bytes]] = {}
    try:
        for name, command in commands.items():
            running[name] = subprocess.Popen(command)
        yield running
    finally:
        for process in running.values():
            process.terminate()
        for process in running.values():
            try:
                process.wait(10)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


def run(remote: Remote, nodes: int, front: dict[str, str], bodies: int, seconds: float) -> None:
    """Run a fleet of ``nodes``, whose front has some parameters, with ``bodies`` balls for ``seconds`` [s], printing a
    line a second. ``remote``: of the front. Raises `InputError`."""
    last = {"timing": Timing()}
    remote.node.create_subscription(Timing, f"{remote.name}/timing", partial(last.__setitem__, "timing"), 10)
    with tempfile.TemporaryDirectory() as name, processes(made := commands(Path(name), nodes, front)) as running:
        print(f"starting {counted(nodes, 'node', 'nodes')} ...", flush=True)
        wait_for_nodes(remote, nodes)
        remote.call("spawn_bodies", bodies=balls(grid(bodies), RADIUS))
        end, due = monotonic() + seconds, 0.0
        while monotonic() < end:
            remote.spin(0.1)
            for ended, process in running.items():
                if process.poll() is not None:
                    print(f"{ended} ended with exit code {process.returncode}; restarting it", flush=True)
                    running[ended] = subprocess.Popen(made[ended])
            if monotonic() >= due:
                due = monotonic() + 1.0
                known = remote.tasks["nodes"].values
                words = [f"{pair.key.removesuffix('/terrain_collider')}: {pair.value}" for pair in known]
                print(f"real-time {last['timing'].real_time_factor:.2f}  {'  '.join(words)}", flush=True)


def main(args: list[str] | None = None) -> None:
    parser = Parser(description=__doc__)
    parser.add_argument("--nodes", type=number(int, 1, 100), default=4, help="nodes that share the terrain")
    parser.add_argument("--bodies", type=number(int, 0, MOST_BODIES), default=100, help="balls on it")
    seconds = number(float, 0.0, math.inf)
    parser.add_argument("--seconds", type=seconds, default=math.inf, help="duration; default: until Ctrl-C")
    parser.add_argument(
        "--spread", choices=("fewest", "tiles"), default="fewest", help="rule that assigns bodies to nodes"
    )
    parser.add_argument("--respawn", choices=("elsewhere", "same"), default="elsewhere", help="bodies of a dead node")
    options = parser.parse_args(args)
    front = {"spread": options.spread, "respawn": options.respawn}
    with isolated_unless_chosen(), following(front_of(), "fleet failed", (), TIMEOUT) as (remote, _):
        run(remote, options.nodes, front, options.bodies, options.seconds)
