"""A peer that the network cuts off, and that comes back."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from smartmesh_ros.tools.testing import TIMEOUT

NAMESPACES = ["unshare", "--user", "--map-root-user", "--net"]


def cables_can_be_made() -> bool:
    """Whether network namespaces and virtual cables are to be had here."""
    if not all(shutil.which(name) for name in ("unshare", "nsenter", "ip")):
        return False
    cable = [*NAMESPACES, "ip", "link", "add", "here", "type", "veth", "peer", "name", "there"]
    return subprocess.run(cable, capture_output=True, check=False).returncode == 0


@pytest.mark.skipif(not cables_can_be_made(), reason="needs user and network namespaces, and virtual cables (iproute2)")
def test_a_peer_that_was_cut_off_is_heard_again() -> None:
    """Cut for less than the lease of peers, and for longer: the last map stays, is said to be old, and maps are taken
    and patches received again once the cable is joined."""
    command = [*NAMESPACES, sys.executable, "-m", "tests.node.partition", "--times", "2"]
    root = Path(__file__).parents[2]
    result = subprocess.run(command, cwd=root, capture_output=True, text=True, timeout=8 * TIMEOUT, check=False)
    assert result.returncode == 0, result.stdout + result.stderr
    cuts = [json.loads(line) for line in result.stdout.splitlines() if line.startswith("{")]
    assert [cut["past_lease"] for cut in cuts] == [False, True]
