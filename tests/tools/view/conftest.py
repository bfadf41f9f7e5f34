"""Fixtures of the tests of the page: a DDS domain, a node in it, the view of that, and a browser that shows it."""

import signal
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from smartmesh_ros.tools.testing import Probe, Process

# Flat where x < 0, small waves where x > 0.
CELL = 0.1
SIDE = 12.0


@pytest.fixture(scope="module")
def shown(domain: int) -> Iterator[tuple[Probe, Process]]:
    """A probe, and a node that has a map and is shown by a view."""
    with Probe() as probe, probe.running("terrain_collider", {"physics.sleep": False}):
        x = np.linspace(-SIDE / 2, SIDE / 2, round(SIDE / CELL) + 1)
        waves = np.where(x > 0.5, 0.05 * np.sin(8.0 * x), 0.0)
        heights = np.tile(waves, (len(x), 1))
        with Process("view", arguments=["--port", "0"]) as view:
            maps = probe.publishers["heightmap"]
            probe.wait_for(lambda: "shown at" in view.output and maps.get_subscription_count() == 2, watch=view)
            probe.publish_map(heights, resolution=CELL, origin=(-SIDE / 2, -SIDE / 2, 0.0))
            yield probe, view
            assert view.stop(signal.SIGINT) == 0, view.output


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """A Chromium without a window."""
    pytest.importorskip("viser", reason="viser is not installed; scripts/workspace run dev view")
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    from scripts.browser import FLAGS, VARIABLE, find_browser

    path = find_browser()
    if path is None:
        pytest.skip(f"no Chromium is installed (Debian: apt install chromium), and {VARIABLE} names none")
    with playwright.sync_playwright() as driver:
        running = driver.chromium.launch(executable_path=path, args=list(FLAGS))
        yield running
        running.close()
