#!/usr/bin/env python3
"""Writes docs/images/demo.png, as the view draws the demo, and docs/images/view.png, its page; `make pictures`."""

import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from playwright.sync_api import sync_playwright

from smartmesh_ros.testing import Process
from smartmesh_ros.view.browser import FLAGS, find_browser

IMAGES = Path(__file__).resolve().parents[1] / "docs" / "images"
SIZE, TINY = {"width": 1280, "height": 800}, {"width": 320, "height": 200}
# The page is shown once its plot has a history, and the bodies have fallen onto the ground [s].
HISTORY, FALL = 20.0, 1.5


def page_picture(path: str) -> None:
    """The page, over a node that runs the demo."""
    with Process("view", arguments=["--demo", "--port", "0"]) as view, sync_playwright() as driver:
        while "shown at" not in view.output:
            if view.process.poll() is not None:
                sys.exit(view.output)
            time.sleep(0.1)
        browser = driver.chromium.launch(executable_path=path, args=list(FLAGS))
        page = browser.new_page(viewport=TINY)  # which costs the node next to nothing meanwhile
        page.goto(view.output.rpartition("shown at ")[2].split()[0])
        page.get_by_text("running", exact=False).first.wait_for()
        page.wait_for_timeout(1000.0 * HISTORY)
        page.get_by_role("button", name="Reset").click()  # bodies are back where the camera looks
        page.wait_for_timeout(1000.0 * FALL)
        page.get_by_role("button", name="Pause").click()
        page.get_by_role("button", name="Continue").wait_for()
        page.set_viewport_size(SIZE)
        page.wait_for_timeout(2000.0)
        for close in page.get_by_role("alert").get_by_role("button").all():  # that there is no graphics card
            close.click()
        page.screenshot(path=IMAGES / "view.png")
        browser.close()


def main() -> None:
    """Writes both."""
    path = find_browser()
    if path is None:
        sys.exit("no Chromium is installed (Debian: apt install chromium)")
    with tempfile.TemporaryDirectory() as folder:
        demo = shutil.which("smartmesh-demo") or "install/smartmesh_ros/lib/smartmesh_ros/smartmesh-demo"
        subprocess.run([demo, "--seconds", "8", "--out", folder], check=True)
        shutil.copy(Path(folder) / "demo.png", IMAGES / "demo.png")
    page_picture(path)


if __name__ == "__main__":
    main()
