"""A fleet on simulated machines on one switch, and what is heard of it.

Machines are network namespaces joined by a bridge, without shared memory. If user namespaces are allowed, this needs no
privileges: the study restarts itself in a namespace with the bridge.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import rclpy
from rclpy.task import Future
from smartmesh_msgs.msg import Timing

from smartmesh_ros.node.fleet.command import FleetWatcher
from smartmesh_ros.node.fleet.layout import FleetPlan, node_names
from studies.load.processes import Usage

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

    def traffic(self) -> tuple[int, int]:
        """Bytes that the command has sent and received so far."""
        command = ["ip", "-json", "-statistics", "link", "show", "dev", self._cable]
        [link] = json.loads(subprocess.run(command, check=True, capture_output=True).stdout)
        ours = link["stats64"]  # of the end at the bridge, which receives what is sent
        return int(ours["rx"]["bytes"]), int(ours["tx"]["bytes"])

    def close(self) -> None:
        """Ends it."""
        self._process.kill()
        self._process.wait()
        _ip(f"link delete {self._cable}")  # the kernel takes its time with the namespace, and the next one has its name
        _ip(f"netns delete {self._name}")


def _ip(command: str) -> None:
    subprocess.run(["ip", *command.split()], check=True)


class Watcher(FleetWatcher):
    """Subscriptions to the nodes of a fleet. ``timings``: of each node since its list was cleared."""

    def __init__(self, count: int) -> None:
        super().__init__()
        self.timings: dict[str, list[Timing]] = {node: [] for node in node_names(count)}
        for node, timings in self.timings.items():
            self.create_subscription(Timing, f"{node}/timing", timings.append, 10)

    def spin(self, seconds: float) -> None:
        """Handles messages for so long."""
        rclpy.spin_until_future_complete(self, Future(), timeout_sec=seconds)


@contextmanager
def site(plan: FleetPlan) -> Iterator[tuple[Watcher, list[Machine]]]:
    """Run a fleet whose processes are on a machine of their own each: the source of terrain, the front, and the
    nodes. It begins when the front hears all nodes; yields what is heard of it, and the machines of its nodes."""
    with tempfile.TemporaryDirectory() as name, ExitStack() as stack:
        rclpy.init()
        stack.callback(rclpy.try_shutdown)
        watcher, machines, folder = Watcher(plan.count), list[Machine](), Path(name)
        stack.callback(watcher.destroy_node)
        try:
            for number, (process, command) in enumerate(plan.commands(folder).items()):
                machines.append(Machine(number, command, folder / f"{process}.txt"))
                stack.callback(machines[-1].close)
            watcher.wait_for(lambda: watcher.front.get("") == f"{plan.count} nodes", "fleet")
            yield watcher, machines[-plan.count :]
        except BaseException:
            for log in sorted(folder.glob("*.txt")):
                print(f"--- {log.name}\n{log.read_text(errors='replace')[-1500:]}", flush=True)
            raise
