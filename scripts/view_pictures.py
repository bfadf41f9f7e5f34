#!/usr/bin/env python3
"""Writes docs/images/view.png, the page of the running demo, and docs/images/demo.png, the demo from behind its robot
without the page's panel; `make pictures`."""

import math
import sys
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np
from playwright.sync_api import sync_playwright

from scripts.browser import FLAGS, find_browser
from smartmesh_ros.startup.dds import isolated_unless_chosen
from smartmesh_ros.tools.client.remote import OUTPUTS, following
from smartmesh_ros.tools.demo.demo import ROBOT, Demo, demo_running
from smartmesh_ros.tools.view.camera import Camera
from smartmesh_ros.tools.view.page import Page
from smartmesh_ros.tools.view.panel import WINDOW

IMAGES = Path(__file__).resolve().parents[1] / "docs" / "images"
TINY, LARGE, WIDE = ({"width": width, "height": height} for width, height in ((320, 200), (1280, 940), (1280, 640)))
# Run times before the pictures [s]: until bodies have fallen onto the ground, and until the page's plot has a history.
FALL, HISTORY = 1.0, 20.0
# The robot stands on its wheels if the tilt of its z axis [rad] and the height of its base link above the ground [m]
# are below these bounds.
MAX_TILT, MAX_HEIGHT = math.radians(25.0), 0.4
# Limit of the wait for a suitable instant [s].
TIMEOUT = 60.0
# The node keeps up at a real-time factor above this one, with at most so many deadlines missed in the page window: one
# step in fifty.
REAL_TIME, MOST_MISSED = 0.95, 48
# Time in which a browser without a graphics card redraws the page [ms].
DRAWING = 4000.0
# Distances of the camera behind and above the robot, and of the camera's target ahead of the robot [m].
BEHIND, ABOVE, AHEAD = 5.0, 3.6, 2.5


class Stage:
    """The demo, its page, and a browser that shows the page."""

    def __init__(self, demo: Demo, page: Page, opened: Any) -> None:
        self.demo, self.remote, self.page, self.opened = demo, demo.remote, page, opened

    def run(self, seconds: float) -> None:
        """Run the demo for ``seconds`` [s] without showing it, because drawing takes processor time from the node."""
        end = monotonic() + seconds
        while monotonic() < end:
            self.remote.watch(set(OUTPUTS))
            self.remote.spin(0.04)
            self.remote.apply_waiting()
            self.demo.drive()
            self.opened.wait_for_timeout(10)

    def on_wheels(self) -> bool:
        """Return True if the robot is known and stands on its wheels."""
        if ROBOT not in self.remote.sight.poses:
            return False
        (x, y, z), (_, i, j, _) = self.remote.sight.poses[ROBOT]
        ground = float(self.remote.ground.heights(np.array([[x, y]]))[0])
        return 1.0 - 2.0 * (i * i + j * j) > math.cos(MAX_TILT) and z - ground < MAX_HEIGHT

    def keeps_up(self) -> bool:
        """Return True if the node runs in real time and misses few deadlines. Late maps throw bodies up."""
        recent = [message for came, message in self.remote.timings if came > monotonic() - WINDOW]
        missed = sum(message.deadline_misses for message in recent)
        return bool(recent) and recent[-1].real_time_factor > REAL_TIME and missed <= MOST_MISSED

    def shoot(self, path: Path, size: Any, place_camera: Callable[[], None]) -> None:
        """Take a picture of an instant when the robot stands on its wheels and the node keeps up."""
        end = monotonic() + TIMEOUT
        while not (self.on_wheels() and self.keeps_up()):
            if monotonic() > end:
                busy = "" if self.keeps_up() else ", the machine is too busy to run the demo in real time"
                sys.exit("no picture" + (busy or ", the robot is off its wheels"))
            self.run(0.1)
        self.page.refresh()
        self.opened.set_viewport_size(size)
        self.opened.wait_for_timeout(DRAWING)
        place_camera()
        self.opened.wait_for_timeout(DRAWING)
        self.opened.screenshot(path=path)

    def stand_behind_the_robot(self) -> None:
        """Place the page's camera behind and above the robot, pointing at the median of the other bodies, and draw
        shadows, which take too much processor time while the demo runs."""
        self.page.scene.light(shadows=True)
        sight = self.remote.sight
        robot = np.array(sight.poses[ROBOT].position)
        away = np.median([pose.position for pose in sight.poses.values()], axis=0)[:2] - robot[:2]
        towards = away / max(float(np.linalg.norm(away)), 1e-9)
        position, target = robot + (*(-BEHIND * towards), ABOVE), robot + (*(AHEAD * towards), 0.0)
        self.page.cameras.turn(Camera(position, target))


@contextmanager
def stage(path: str) -> Iterator[Stage]:
    """Run the demo, the page and a browser for the length of the block."""
    with (
        isolated_unless_chosen(),
        following("/terrain_collider", "pictures", sys.argv) as (remote, _),
        closing(Page(remote, "localhost", 0)) as page,
        sync_playwright() as driver,
        closing(driver.chromium.launch(executable_path=path, args=FLAGS)) as browser,
    ):
        opened = browser.new_page(viewport=TINY)  # costs the node almost no processor time
        opened.goto(page.url)
        opened.add_style_tag(content="[role=alert] { display: none }")  # the warning of a missing graphics card
        with demo_running(remote) as demo:
            yield Stage(demo, page, opened)


def main() -> None:
    """Write both pictures."""
    path = find_browser()
    if path is None:
        sys.exit("no Chromium is installed (Debian: apt install chromium)")
    with stage(path) as shown:
        shown.run(FALL)
        shown.opened.add_style_tag(content=".mantine-Paper-root { visibility: hidden }")
        shown.shoot(IMAGES / "demo.png", WIDE, shown.stand_behind_the_robot)
    with stage(path) as shown:
        shown.run(HISTORY)
        remote = shown.remote
        shown.shoot(IMAGES / "view.png", LARGE, lambda: shown.page.cameras.look(remote.ground, remote.sight))


if __name__ == "__main__":
    main()
