"""``make fleet-study``: how many bodies several nodes on one terrain carry in real time.

Nodes run in network namespaces joined by a bridge: UDP between them, no shared memory.
"""

import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np
import rclpy
from matplotlib.figure import Figure
from smartmesh_msgs.msg import Timing

from smartmesh_ros.node.fleet.layout import commands, front_of, node_names
from smartmesh_ros.tools.client.remote import Remote
from smartmesh_ros.tools.fleet import TIMEOUT, balls, wait_for_nodes
from studies.load.processes import Usage
from studies.pages import fill, short, table

# Real time, as far as it counts; bodies start so far apart [m], in squares of so many on a side, one to a quarter of
# the terrain, whose bodies share a node.
REAL_TIME, APART, SIDE = 0.98, 1.0, 24
# The page with the table, its picture, and the numbers of bodies that the table has columns for.
PAGE, PICTURE, COLUMNS = Path("docs/fleet.md"), Path("docs/images/fleet/capacity.png"), (200, 400, 800, 1200)
START, MORE, MOST, SECONDS = 200, 100, 2200, 6.0  # bodies at first, how many more at a time, and at most; a run [s]
NOBODY = "/nobody"  # a peer that is never heard
Timings = dict[str, list[Timing]]  # by node


def places(count: int, first: int) -> Iterator[tuple[str, float, float, float]]:
    """Yield ``count`` places (name, x, y, z) [m], numbered from ``first`` on: one after the other in each quarter."""
    for number in range(first, first + count):
        quarter, place = number % 4, number // 4
        x, y = (APART * (index + 0.5) for index in (place % SIDE, place // SIDE))
        yield f"ball_{number:05d}", x if quarter % 2 else -x, y if quarter // 2 else -y, 0.6


def capacity(nodes: int, *, meet: bool) -> dict[str, Any]:
    """Add bodies until the slowest node of a fleet falls behind real time; return what was measured at each number.
    ``meet``: True = bodies of different nodes collide."""
    # What is measured is how late nodes are: none is taken for dead for it.
    front = {"spread": "tiles", "tile_size": APART * SIDE, "timeout": 20.0}
    alone = {} if meet else {"bodies.peers": [NOBODY]}
    parameters = {"bodies.timeout": 20.0, **alone}
    runs: list[dict[str, float]] = []
    with site(nodes, front, parameters) as (remote, timings, machines):
        count, added = 0, START
        while count < MOST and (not runs or runs[-1]["real_time"] >= REAL_TIME - 0.05):
            remote.call("spawn_bodies", bodies=balls(places(added, count), 0.2))
            count, added = count + added, MORE
            remote.spin(2.0)
            runs.append({"bodies": count, **measure(remote, timings, machines)})
            figures = ", ".join(f"{name} {figure:.3g}" for name, figure in runs[-1].items())
            print(f"{nodes} nodes{'' if meet else ' by themselves'}: {figures}", flush=True)
    return {"nodes": nodes, "meet": meet, "runs": runs, "carried": carried(runs)}


def measure(remote: Remote, timings: Timings, machines: list["Machine"]) -> dict[str, float]:
    """Run a fleet; return the slowest node's real-time factor, and the maximum processor time of a node for a simulated
    second [s], which hardly depends on other load."""
    for heard in timings.values():
        heard.clear()
    before, start = np.array([machine.usage.cpu() for machine in machines]), monotonic()
    remote.spin(SECONDS)
    span, factors = monotonic() - start, []
    spent = np.array([machine.usage.cpu() for machine in machines]) - before
    for heard in timings.values():
        window = sum(timing.window_s for timing in heard)
        simulated = sum(timing.real_time_factor * timing.window_s for timing in heard)
        factors.append(simulated / window if window else 0.0)
    busy = spent / np.maximum(factors, 1e-9) / span
    return {"real_time": min(factors), "busy": float(busy.max())}


def carried(runs: list[dict[str, float]]) -> float:
    """Return the number of bodies at which the real-time factor crosses the bound, interpolated between the last number
    within the bound and the first one beyond; the last number if all are within."""
    late = next((index for index, run in enumerate(runs) if run["real_time"] < REAL_TIME), len(runs))
    if late in (0, len(runs)):
        return float(runs[-1]["bodies"]) if late else 0.0
    last, first = runs[late - 1 : late + 1]
    share = (last["real_time"] - REAL_TIME) / (last["real_time"] - first["real_time"])
    return float(last["bodies"] + share * (first["bodies"] - last["bodies"]))


def draw_capacity(path: Path, capacities: list[dict[str, Any]], machine: str) -> None:
    """Real-time factors against the number of bodies."""
    figure = Figure(figsize=(7.0, 4.2), dpi=90, layout="constrained")
    axes = figure.subplots()
    for one in capacities:
        which = f"{one['nodes']} node{'s' if one['nodes'] > 1 else ''}{'' if one['meet'] else ' by themselves'}"
        points = np.array([(run["bodies"], run["real_time"]) for run in one["runs"]])
        axes.plot(*points.T, "o-" if one["meet"] else "o:", label=f"{which}: {one['carried']:.0f} bodies")
    axes.axhline(REAL_TIME, color="black", linestyle="--", linewidth=1)
    axes.set(xlabel="bodies of the fleet", ylabel="real-time factor of the slowest node")
    axes.grid(alpha=0.3)
    axes.legend()
    axes.set_title(machine, fontsize=9)
    figure.savefig(path)


def main() -> None:
    """Runs the study."""
    enter()
    fleets = ((1, True), (2, True), (4, True), (4, False))
    found = [capacity(nodes, meet=meet) for nodes, meet in fleets]
    draw_capacity(PICTURE, found, short())
    rows = []
    for one in found:
        busy = {run["bodies"]: f"{run['busy']:.2f} s" for run in one["runs"]}
        name = f"{one['nodes']}" + ("" if one["meet"] else " whose bodies do not meet")
        share = [f"{one['carried']:.0f}", f"{one['carried'] / found[0]['carried']:.2f}"]
        rows.append([name, *share, *(busy.get(count, "-") for count in COLUMNS)])
    text = table(["nodes", "bodies in real time", "of one node", *map(str, COLUMNS)], rows)
    fill(PAGE, {"capacity": f"Measured on {short()}.\n\n{text}"})
    print(f"wrote {PAGE} and {PICTURE}")


INSIDE = "SMARTMESH_FLEET_NETWORK"
BRIDGE, ADDRESS = "switch", "10.77.0.{}/24"
# UDP only, in a domain of its own network, found beyond one machine.
VARIABLES = {"FASTDDS_BUILTIN_TRANSPORTS": "UDPv4", "ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET", "ROS_DOMAIN_ID": "1"}
# Runs a command without the shared memory of others.
ALONE = ("sh", "-c", 'mount -t tmpfs none /dev/shm && exec "$@"', "sh")
DROPPED = ("FASTRTPS_DEFAULT_PROFILES_FILE", "RMW_FASTRTPS_USE_QOS_FROM_XML")


def enter() -> None:
    """Restart this command in a namespace with a bridge, and exit with its code. Return if it runs there already.

    Exit with 1 if namespaces are not available.
    """
    if os.environ.get(INSIDE):
        _ip("link set lo up")
        _ip(f"link add {BRIDGE} type bridge mcast_snooping 0")
        _ip(f"link set {BRIDGE} up")
        _ip(f"address add {ADDRESS.format(1)} dev {BRIDGE}")
        # Where `ip` keeps its namespaces.
        subprocess.run(["mount", "-t", "tmpfs", "none", "/run"], check=True)
        return
    kept = {name: value for name, value in os.environ.items() if name not in DROPPED}
    own = [sys.executable, "-m", "studies", "fleet", *sys.argv[1:]]
    command = ["unshare", "--user", "--map-root-user", "--net", "--mount", *own]
    sys.exit(subprocess.run(command, env={**kept, **VARIABLES, INSIDE: "1"}, check=False).returncode)


class Machine:
    """A network namespace with a cable to the bridge, in which one command runs. ``usage``: of the command."""

    def __init__(self, number: int, command: list[str], log: Path) -> None:
        self._name, self._cable = f"machine{number}", f"cable{number}"
        _ip(f"netns add {self._name}")
        _ip(f"link add name {self._cable} type veth peer name net0 netns {self._name}")
        _ip(f"link set {self._cable} master {BRIDGE} up")
        for setting in ("link set lo up", "link set net0 up", f"address add {ADDRESS.format(10 + number)} dev net0"):
            _ip(f"-n {self._name} {setting}")
        with log.open("ab") as file:
            inside = ["ip", "netns", "exec", self._name, *ALONE, *command]
            self._process = subprocess.Popen(inside, stdout=file, stderr=subprocess.STDOUT)
        self.usage = Usage(self._process.pid)

    def close(self) -> None:
        """Ends it."""
        self._process.kill()
        self._process.wait()
        _ip(f"link delete {self._cable}")  # the kernel takes its time with the namespace, and the next one has its name
        _ip(f"netns delete {self._name}")


def _ip(command: str) -> None:
    subprocess.run(["ip", *command.split()], check=True)


@contextmanager
def site(
    count: int, front: dict[str, Any], parameters: dict[str, Any]
) -> Iterator[tuple[Remote, Timings, list[Machine]]]:
    """Run a fleet of ``count`` nodes, with parameters of the front and the nodes, whose processes are on a machine of
    their own each: the source of terrain, the front, and the nodes. It begins when the front hears all nodes; yields
    what hears it, the timings of each node, and the machines of the nodes."""
    with tempfile.TemporaryDirectory() as name, ExitStack() as stack:
        rclpy.init()
        stack.callback(rclpy.try_shutdown)
        remote, machines, folder = Remote(front_of(), TIMEOUT), list[Machine](), Path(name)
        stack.callback(remote.close)
        timings: Timings = {node: [] for node in node_names(count)}
        for node, heard in timings.items():
            remote.node.create_subscription(Timing, f"{node}/timing", heard.append, 10)
        try:
            for number, (process, command) in enumerate(commands(folder, count, front, parameters).items()):
                machines.append(Machine(number, command, folder / f"{process}.txt"))
                stack.callback(machines[-1].close)
            wait_for_nodes(remote, count)
            yield remote, timings, machines[-count:]
        except BaseException:
            for log in sorted(folder.glob("*.txt")):
                print(f"--- {log.name}\n{log.read_text(errors='replace')[-1500:]}", flush=True)
            raise
