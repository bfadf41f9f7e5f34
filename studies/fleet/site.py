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
from time import monotonic
from typing import Any

import psutil
import rclpy
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
        self.nodes = node_names(count)
        self.timings: dict[str, list[Timing]] = {node: [] for node in self.nodes}
        for node in self.nodes:
            self.create_subscription(Timing, f"{node}/timing", self.timings[node].append, 10)

    def spin(self, seconds: float) -> None:
        """Handles messages for so long."""
        end = monotonic() + seconds
        while monotonic() < end:
            rclpy.spin_once(self, timeout_sec=max(end - monotonic(), 0.0))

    def complete(self) -> bool:
        """Whether the front hears all nodes."""
        return self.front.get("") == f"{len(self.nodes)} nodes"

    def spawn(self, places: list[tuple[float, float]], first: int, height: float = 0.6) -> None:
        """Has the front spawn a ball at each place, numbered from ``first`` on."""
        self.spawn_balls(((f"ball_{number:05d}", x, y, height) for number, (x, y) in enumerate(places, first)), 0.2)


class Site:
    """A fleet on machines of its own: node i on ``machines[i]``, the source of terrain and the front on another."""

    def __init__(self, plan: FleetPlan, folder: Path) -> None:
        self._plan, self._folder = plan, folder
        self.machines = [Machine(index) for index in range(plan.count)]
        self._hub = [Machine(plan.count), Machine(plan.count + 1)]
        self.watcher = Watcher(plan.count)

    def start(self) -> None:
        """Starts everything and waits until the front hears all nodes."""
        commands = self._plan.commands(self._folder)
        for machine, (name, command) in zip([*self._hub, *self.machines], commands.items(), strict=True):
            machine.start(command, self._folder / f"{name}.txt")
        self.watcher.wait_for(self.watcher.complete, "fleet")

    def close(self) -> None:
        """Ends everything."""
        self.watcher.destroy_node()
        for machine in (*self.machines, *self._hub):
            machine.close()


@contextmanager
def site(plan: FleetPlan) -> Iterator[Site]:
    """A running fleet."""
    rclpy.init()
    with tempfile.TemporaryDirectory() as folder:
        made = Site(plan, Path(folder))
        try:
            made.start()
            yield made
        except BaseException:
            for log in sorted(Path(folder).glob("*.txt")):
                print(f"--- {log.name}\n{log.read_text(errors='replace')[-1500:]}", flush=True)
            raise
        finally:
            made.close()
            rclpy.try_shutdown()


def load() -> float:
    """Mean number of processes that wanted to run in the last minute, ours among them."""
    return os.getloadavg()[0]
