"""Topic-driven integration tests: a node in a process and DDS domain of its own, and a probe beside it.

docs/testing.md is the guide. With pytest, import the fixtures and request them::

    from smartmesh_ros.tools.testing import Probe, domain, probe  # noqa: F401

    def test_patches_lie_on_my_map(probe: Probe) -> None:
        with probe.running("terrain_collider", {"publish.patches": 60.0}):
            probe.publish_map(np.zeros((50, 50)), resolution=0.1)
            probe.publish_poses([(2.5, 2.5, 0.3)])
            probe.wait_for(lambda: probe.patches().keys() == {0})

All functions wait for conditions, with generous timeouts; none sleeps for a fixed time.
"""

from __future__ import annotations

from collections.abc import Iterator

from smartmesh_ros.node.outputs.cdr import floats
from smartmesh_ros.startup.dds import isolated
from smartmesh_ros.tools.testing.messages import (
    assert_on_map,
    heightmap_message,
    mesh_message,
    point_message,
    points_of,
    pose_message,
)
from smartmesh_ros.tools.testing.probe import COLLIDER, Probe
from smartmesh_ros.tools.testing.process import TIMEOUT, Process, assert_cannot_start, executable

__all__ = [
    "COLLIDER",
    "TIMEOUT",
    "Probe",
    "Process",
    "assert_cannot_start",
    "assert_on_map",
    "domain",
    "executable",
    "floats",
    "heightmap_message",
    "isolated",
    "mesh_message",
    "point_message",
    "points_of",
    "pose_message",
    "probe",
]

try:
    import pytest
except ModuleNotFoundError:
    pass  # only the fixtures need it; the tuner reads bags without it
else:
    # The domain of the session. If several modules import a fixture, pytest makes one for each of them.
    DOMAIN = pytest.StashKey[int]()

    @pytest.fixture(scope="session")
    def domain(pytestconfig: pytest.Config) -> Iterator[int]:
        """A DDS domain that nothing else on this machine uses, limited to this machine; one for the whole session, also
        if several modules import this fixture."""
        if DOMAIN in pytestconfig.stash:
            yield pytestconfig.stash[DOMAIN]
            return
        with isolated() as number:
            pytestconfig.stash[DOMAIN] = number
            yield number

    @pytest.fixture
    def probe(domain: int) -> Iterator[Probe]:
        """A probe in the test's domain."""
        with Probe() as made:
            yield made
