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
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import psutil
import rclpy
from rclpy.task import Future
from smartmesh_msgs.msg import Timing

from smartmesh_ros.node.fleet.command import FleetWatcher
from smartmesh_ros.node.fleet.layout import FleetPlan, node_names

INSIDE = "SMARTMESH_FLEET_NETWORK"
BRIDGE, ADDRESS = "switch", "10.77.0.{}/24"
# UDP only, in a domain of its own network, found beyond one machine.
VARIABLES = {"FASTDDS_BUILTIN_TRANSPORTS": "UDPv4", "ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET", "ROS_DOMAIN_ID": "1"}
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
        subprocess.run(["mount", "-t", "tmpfs", "none", "/dev/shm"], check=True)
        return
    kept = {name: value for name, value in os.environ.items() if name not in DROPPED}
    own = [sys.executable, "-m", "studies.fleet.study", *sys.argv[1:]]
    command = ["unshare", "--user", "--map-root-user", "--net", "--mount", *own]
    sys.exit(subprocess.run(command, env={**kept, **VARIABLES, INSIDE: "1"}, check=False).returncode)


class Machine:
    """A network namespace with a cable to the bridge, in which one command runs at a time."""

    def __init__(self, number: int) -> None:
        self._cable = f"cable{number}"
        # A shell that holds the namespaces open until it is killed.
        self._holder = subprocess.Popen(
            ["unshare", "--net", "--mount", "sh", "-c", "mount -t tmpfs none /dev/shm && echo up && read end"],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        )  # fmt: skip
        assert self._holder.stdout is not None
        self._holder.stdout.readline()
        _ip(f"link add name {self._cable} type veth peer name net0 netns {self._holder.pid}")
        _ip(f"link set {self._cable} master {BRIDGE} up")
        for command in ("link set lo up", "link set net0 up", f"address add {ADDRESS.format(10 + number)} dev net0"):
            subprocess.run([*self._enter(), "ip", *command.split()], check=True)
        self.process: subprocess.Popen[bytes] | None = None

    def start(self, command: list[str], log: Path) -> subprocess.Popen[bytes]:
        """Starts a command on this machine."""
        with log.open("ab") as file:
            self.process = subprocess.Popen([*self._enter(), *command], stdout=file, stderr=subprocess.STDOUT)
        return self.process

    def traffic(self) -> tuple[int, int]:
        """Bytes that the command has sent and received so far."""
        command = ["ip", "-json", "-statistics", "link", "show", "dev", self._cable]
        [link] = json.loads(subprocess.run(command, check=True, capture_output=True).stdout)
        ours = link["stats64"]  # of the end at the bridge, which receives what is sent
        return int(ours["rx"]["bytes"]), int(ours["tx"]["bytes"])

    def processor_time(self) -> float:
        """Processor time of the command so far [s]."""
        assert self.process is not None
        return float(sum(psutil.Process(self.process.pid).cpu_times()[:2]))

    def close(self) -> None:
        """Ends it."""
        if self.process is not None:
            self.process.kill()
            self.process.wait()
        _ip(f"link delete {self._cable}")  # the kernel takes its time with the namespace, and the next one has its name
        self._holder.kill()
        self._holder.wait()

    def _enter(self) -> list[str]:
        return ["nsenter", "--net", "--mount", "--target", str(self._holder.pid)]


def _ip(command: str) -> Any:
    return subprocess.run(["ip", *command.split()], check=True)


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

    def spawn(self, places: list[tuple[float, float]], first: int, height: float = 0.6) -> None:
        """Has the front spawn a ball at each place, numbered from ``first`` on."""
        self.spawn_balls(((f"ball_{number:05d}", x, y, height) for number, (x, y) in enumerate(places, first)), 0.2)


class Site(NamedTuple):
    """A running fleet: what is heard of it, and the machines of its nodes."""

    watcher: Watcher
    machines: list[Machine]


@contextmanager
def site(plan: FleetPlan) -> Iterator[Site]:
    """Run a fleet whose processes are on a machine of their own each: the source of terrain, the front, and the
    nodes. It begins when the front hears all nodes."""
    rclpy.init()
    watcher = Watcher(plan.count)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        commands = plan.commands(folder)
        machines = [Machine(number) for number in range(len(commands))]
        try:
            for machine, (process, command) in zip(machines, commands.items(), strict=True):
                machine.start(command, folder / f"{process}.txt")
            watcher.wait_for(lambda: watcher.front.get("") == f"{plan.count} nodes", "fleet")
            yield Site(watcher, machines[-plan.count :])
        except BaseException:
            for log in sorted(folder.glob("*.txt")):
                print(f"--- {log.name}\n{log.read_text(errors='replace')[-1500:]}", flush=True)
            raise
        finally:
            watcher.destroy_node()
            for machine in machines:
                machine.close()
            rclpy.try_shutdown()
