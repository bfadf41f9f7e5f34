"""The network between a node and one peer is cut, and joined again.

Run in a network namespace of its own, which needs no privileges where user namespaces are allowed::

    unshare --user --map-root-user --net python -m tests.node.test_partition

The peer runs in a second namespace, at the other end of a virtual cable and without the others' shared memory, as on
another machine; it publishes maps and listens to patches.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from time import monotonic

import numpy as np
import pytest

from smartmesh_ros.tools.testing import TIMEOUT, Probe
from tests.node.shared import box, position_of, spawn

MODULE = "tests.node.test_partition"
NAMESPACES = ["unshare", "--user", "--map-root-user", "--net"]
SETTINGS = {"terrain.motion": "hold", "bodies.timeout": 60.0}
# Peers that are not heard of for so long are given up [s]; 20 by default.
LEASE = 5
PROFILE = f"""<?xml version="1.0" encoding="UTF-8"?>
<profiles xmlns="http://www.eprosima.com/XMLSchemas/fastRTPS_Profiles">
  <participant profile_name="short_lease" is_default_profile="true"><rtps><builtin><discovery_config>
    <leaseDuration><sec>{LEASE}</sec></leaseDuration><leaseAnnouncement><sec>1</sec></leaseAnnouncement>
  </discovery_config></builtin></rtps></participant>
</profiles>
"""


def level(number: int) -> float:
    """Height of the number-th map [m]: no two in a row are alike."""
    return 0.001 * (number % 10)


def peer() -> None:
    """Publishes maps, and says how many markers it has received, until it is killed."""
    probe = Probe()
    number, due = 0, 0.0
    while True:
        probe.spin()
        if monotonic() >= due:
            due = monotonic() + 0.1
            number += 1
            probe.publish_map(np.full((50, 50), level(number)))
            print(len(probe.received["/terrain_collider/patches"]), flush=True)


class Cable:
    """A virtual cable to a second namespace with the peer in it."""

    def __init__(self) -> None:
        for command in ("link set lo up", "link add here type veth peer name there", "link set here up",
                        "address add 10.77.0.1/24 dev here"):  # fmt: skip
            _ip(command)
        self._log = tempfile.TemporaryFile("w+")  # noqa: SIM115  # closed with the process
        # Waits until its end of the cable is there: Fast DDS looks for interfaces once.
        command = f"mount -t tmpfs none /dev/shm && read go && exec {sys.executable} -m {MODULE} peer"
        self.process = subprocess.Popen(
            ["unshare", "--net", "--mount", "sh", "-c", command], stdin=subprocess.PIPE, stdout=self._log, text=True
        )
        here = Path("/proc/self/ns/net").readlink()
        while Path(f"/proc/{self.process.pid}/ns/net").readlink() == here:
            pass
        _ip(f"link set there netns {self.process.pid}")
        for command in ("link set lo up", "link set there up", "address add 10.77.0.2/24 dev there"):
            self._ip_there(command)
        assert self.process.stdin is not None
        self.process.stdin.write("go\n")
        self.process.stdin.close()

    def __enter__(self) -> Cable:
        return self

    def __exit__(self, *_: object) -> None:
        self.process.kill()
        self.process.wait()

    def cut(self) -> None:
        self._ip_there("link set there down")

    def join(self) -> None:
        self._ip_there("link set there up")

    def received(self) -> int:
        """Markers that the peer has received."""
        self._log.seek(0)
        lines = self._log.read().splitlines()
        return int(lines[-1]) if lines else 0

    def _ip_there(self, command: str) -> None:
        _ip(command, "nsenter", "--net", "--target", str(self.process.pid))


def _ip(command: str, *where: str) -> None:
    subprocess.run([*where, "ip", *command.split()], check=True)


def heights(probe: Probe) -> set[float]:
    """Heights of all vertices of the newest patches [m]."""
    return {round(float(z), 4) for points in probe.patches().values() for z in points[:, 2]}


def cut_and_join(probe: Probe, link: Cable) -> None:
    """Cuts the cable until the node says that its map is old and then that nobody publishes maps; joins it again."""
    probe.wait_for(lambda: probe.diagnostics("terrain")["message"] == "maps arrive")
    link.cut()
    probe.wait_for(lambda: " s old" in probe.diagnostics("terrain")["message"])
    words = "nobody publishes maps"
    terrain = probe.wait_for(lambda: words in (found := probe.diagnostics("terrain"))["message"] and found)
    assert terrain["publishers"] == "0", terrain

    # The last good map stays, patches and bodies with it, and physics in real time.
    kept, updates, got = heights(probe), terrain["updates of ''"], link.received()
    assert len(kept) == 1, kept
    assert min(abs(z - level(n)) for z in kept for n in range(10)) < 1e-6, kept
    for _ in range(20):
        assert heights(probe) == kept
        assert abs(position_of(probe, "box")[2] - 0.2 - max(kept)) < 0.002
    assert probe.diagnostics("terrain")["updates of ''"] == updates

    # On this side a send waits for a peer that is not there as long as the kernel looks for it, unless told not to.
    probe.wait_for(lambda: min(float(probe.diagnostics("physics")["real-time factor"]) for _ in range(2)) > 0.5)

    link.join()
    probe.wait_for(lambda: probe.diagnostics("terrain")["message"] == "maps arrive")
    probe.wait_for(lambda: heights(probe) != kept)
    probe.wait_for(lambda: link.received() > got)
    assert probe.diagnostics("inputs")["message"] == "0 refused so far"


def cables_can_be_made() -> bool:
    """Whether network namespaces and virtual cables are to be had here."""
    if not all(shutil.which(name) for name in ("unshare", "nsenter", "ip")):
        return False
    link = [*NAMESPACES, "ip", "link", "add", "here", "type", "veth", "peer", "name", "there"]
    return subprocess.run(link, capture_output=True, check=False).returncode == 0


@pytest.mark.skipif(not cables_can_be_made(), reason="needs user and network namespaces, and virtual cables (iproute2)")
def test_a_peer_that_was_cut_off_is_heard_again() -> None:
    """Cut for longer than the lease of peers: the last map stays, is said to be old, and maps are taken and patches
    received again once the cable is joined."""
    command, root = [*NAMESPACES, sys.executable, "-m", MODULE], Path(__file__).parents[2]
    result = subprocess.run(command, cwd=root, capture_output=True, text=True, timeout=8 * TIMEOUT, check=False)
    assert result.returncode == 0, result.stdout + result.stderr
    assert result.stdout.split() == ["joined"]


def main() -> None:
    """A node with a simulated box on the peer's map, which is cut off."""
    with tempfile.NamedTemporaryFile("w", suffix=".xml") as profile:
        profile.write(PROFILE)
        profile.flush()
        os.environ.pop("FASTDDS_BUILTIN_TRANSPORTS", None)
        os.environ.update(
            FASTRTPS_DEFAULT_PROFILES_FILE=profile.name, ROS_DOMAIN_ID="1", ROS_AUTOMATIC_DISCOVERY_RANGE="SUBNET"
        )
        with Cable() as link, Probe() as probe, probe.running(parameters=SETTINGS):
            probe.wait_for(lambda: probe.diagnostics("terrain")["samples"] == "2500")
            spawn(probe, "box", (2.5, 2.5, 0.3), shape=box(0.4, 0.4, 0.4))
            for topic in [topic for topic in probe.publishers if "heightmap" in topic or "terrain" in topic]:
                probe.node.destroy_publisher(probe.publishers.pop(topic))  # so that the peer is the only one
            probe.wait_for(link.received)
            cut_and_join(probe, link)
            print("joined", flush=True)


if __name__ == "__main__":
    peer() if sys.argv[1:] == ["peer"] else main()
