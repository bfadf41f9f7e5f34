"""Tests of packages that use the collider: replays in the test's process, and nodes in processes and a DDS domain of
their own with a probe beside them.

docs/testing.md is the guide. With pytest, import the fixtures and request them::

    from smartmesh_ros.tools.testing import Probe, domain, probe, replay  # noqa: F401

    def test_a_ball_comes_to_rest(replay) -> None:
        run = replay([("heightmap", 0.0, heightmap_message(np.zeros((50, 50))))], {"bodies.spawn": [BALL]})
        run.run(2.0)
        assert run.world.state("ball").position[2] == pytest.approx(0.2, abs=1e-3)

    def test_patches_lie_on_my_map(probe: Probe) -> None:
        with probe.running("terrain_collider", {"publish.patches": 60.0}):
            probe.publish_map(np.zeros((50, 50)), resolution=0.1)
            probe.publish_poses([(2.5, 2.5, 0.3)])
            probe.wait_for(lambda: probe.patches().keys() == {0})

The probe's functions wait for conditions, with generous timeouts; none sleeps for a fixed time.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from typing import TYPE_CHECKING, Any

from smartmesh_ros.node.outputs.cdr import floats
from smartmesh_ros.startup.dds import isolated
from smartmesh_ros.startup.executables import executable
from smartmesh_ros.tools.messages import (
    assert_on_map,
    heightmap_message,
    layer_message,
    mesh_message,
    point_message,
    points_of,
    pose_message,
)
from smartmesh_ros.tools.testing.probe import COLLIDER, Probe
from smartmesh_ros.tools.testing.process import TIMEOUT, Process, assert_cannot_start

if TYPE_CHECKING:
    from smartmesh_ros.tools.replay.replay import Replay

__all__ = [
    "COLLIDER", "TIMEOUT", "Probe", "Process", "assert_cannot_start", "assert_on_map", "domain", "executable", "floats",
    "heightmap_message", "isolated", "layer_message", "mesh_message", "point_message", "points_of", "pose_message",
    "probe", "replay",
]  # fmt: skip

try:
    import pytest
except ModuleNotFoundError:
    pass  # only the fixtures need it
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

    @pytest.fixture
    def replay() -> Iterator[Callable[..., Replay]]:
        """`Replay`, each of which ends with the test."""
        from smartmesh_ros.tools.replay.replay import Replay  # imports PyBullet, which probes do not need

        with ExitStack() as ending:

            def make(*arguments: Any, **options: Any) -> Replay:
                return ending.enter_context(Replay(*arguments, **options))

            yield make
