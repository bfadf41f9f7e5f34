"""What holds for all tests."""

import gc
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

# Messages refuse values of other types than their fields have, as documented for users. It is read at their import.
os.environ["ROS_PYTHON_CHECK_FIELDS"] = "1"

import pybullet as pb
import pytest
from hypothesis import settings
from hypothesis.internal.conjecture import providers
from pybullet_utils.bullet_client import BulletClient

from smartmesh_ros import World
from smartmesh_ros.tools.testing import Process, domain, probe, replay
from tests import preloaded
from tests.examples import FACTORS
from tests.grounds import level

__all__ = ["domain", "probe", "replay"]

ROOT = Path(__file__).resolve().parents[1]
# Tests say nothing of time: a machine may be as slow as it is.
settings.register_profile("steady", deadline=None, derandomize=True)  # the same examples in every run
# HYPOTHESIS_PROFILE=random looks for new ones, many times as many; what fails is kept as an @example.
settings.register_profile(
    "random", deadline=None, derandomize=False, print_blob=True, max_examples=100 * FACTORS["random"]
)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "steady"))
if settings.get_current_profile_name() == "steady":
    # Hypothesis also draws numbers that stand in the sources of imported modules, which differ between processes.
    assert callable(providers._get_local_constants)
    providers._get_local_constants = lambda: providers._local_constants

Process.starter = staticmethod(preloaded.start)

# Processor time of a file's tests, and of the processes that they start [s], of files that take 7 s and more. Measured
# once, on two cores; only their order counts.
COSTS = {
    "tools/view/test_page.py": 49,
    "newcomer/test_workspace.py": 42,
    "newcomer/test_wheel.py": 28,
    "soil/test_plates_and_carts.py": 15,
    "ground/test_windows.py": 14,
    "ground/test_seams.py": 14,
    "core/test_contacts_coal.py": 13,
    "world/test_bullet_faults.py": 12,
    "core/test_mesh_ground.py": 11,
    "world/test_guests.py": 11,
    "studies/test_matrix_rows.py": 11,
    "node/test_processes.py": 10,
    "newcomer/test_core.py": 9,
    "tools/replay/test_replay.py": 8,
    "fuzz/test_quick.py": 8,
    "node/test_tutorial.py": 8,
    "node/test_scene.py": 8,
    "node/test_materials.py": 7,
}


@pytest.fixture
def client() -> Iterator[Any]:
    """A PyBullet world with gravity, and nothing in it."""
    bullet = BulletClient(pb.DIRECT)
    bullet.setGravity(0.0, 0.0, -9.81)
    yield bullet
    bullet.disconnect()


@pytest.fixture
def world() -> Iterator[World]:
    """A world on level ground of 10 m, around the origin."""
    with World(level(101)) as made:
        yield made


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Sort files by cost: those that take longest start first, so that no core waits for another at the end. Of the
    others, files with tests of nodes, which wait, are spread among those that compute: one after the other, they would
    have all processes wait at a time, and no core compute."""
    kinds: dict[bool, list[Path]] = {True: [], False: []}
    for path in dict.fromkeys(item.path for item in items):
        kinds["node" in path.relative_to(ROOT).parts].append(path)
    places = {path: place / len(paths) for paths in kinds.values() for place, path in enumerate(paths)}

    def order(item: pytest.Item) -> tuple[int, float]:
        return -COSTS.get(item.path.relative_to(ROOT / "tests").as_posix(), 0), places[item.path]

    items.sort(key=order)


def pytest_collection_finish() -> None:
    """Leave all that was imported out of later garbage collections: each would take a fifth of a second, and each node
    that is made in this process is followed by one."""
    gc.collect()
    gc.freeze()


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers() -> int:
    """Return two processes more than there are cores: tests of nodes wait for much of their time."""
    return (len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1) + 2
