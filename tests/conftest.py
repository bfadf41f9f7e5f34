"""What holds for all tests."""

import os
from pathlib import Path

import pytest
from hypothesis import settings
from hypothesis.internal.conjecture import providers

from tests.examples import FACTORS

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

# Files that take longest, which start first: the last to run should be short, or a core waits for the other.
LONGEST = (
    "newcomer/test_wheel.py",
    "studies/test_consumer.py",
    "node/test_processes.py",
    "newcomer/test_workspace.py",
    "view/test_page.py",
    "fuzz/test_quick.py",
    "tune/test_search.py",
    "node/test_batches.py",
    "studies/test_before_after.py",
    "node/test_robots.py",
    "studies/test_robots.py",
    "node/test_faults.py",
    "test_machine_code.py",
    "soil/test_soil_world.py",
    "studies/test_mapper.py",
    "studies/test_bench.py",
    "studies/test_accuracy.py",
    "node/test_presets.py",
    "node/test_tutorial.py",
    "node/test_partition.py",
    "patches/test_selection.py",
    "physics/test_colliders.py",
)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Sort the longest files to the front, then the tests of nodes, which wait more than they compute."""

    def place(item: pytest.Item) -> int:
        path = item.path.relative_to(ROOT / "tests").as_posix()
        if path in LONGEST:
            return LONGEST.index(path)
        return len(LONGEST) + (not path.startswith("node/"))

    items.sort(key=place)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers() -> int:
    """Return two processes more than there are cores: tests of nodes wait for much of their time."""
    return (len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1) + 2
