"""A browser without a window, for pictures and tests of the page."""

from __future__ import annotations

import os
import shutil

# The first that is installed; the variable names another.
VARIABLE = "SMARTMESH_BROWSER"
NAMES = ("chromium", "chromium-browser", "google-chrome")
# Draws without a graphics card, and asks the network for nothing.
FLAGS = (
    "--no-sandbox", "--disable-gpu", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
    "--disable-quic", "--no-first-run", "--disable-background-networking", "--disable-component-update",
    "--disable-sync",
)  # fmt: skip


def find_browser() -> str | None:
    """The path of a Chromium; None where there is none."""
    named = os.environ.get(VARIABLE)
    paths = [shutil.which(name) for name in ([named] if named else NAMES)]
    return next((path for path in paths if path), None)
