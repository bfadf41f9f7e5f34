"""A headless browser for pictures and tests of the page."""

from __future__ import annotations

import os
import shutil

# The environment variable overrides the names, of which the first installed one is used.
VARIABLE = "SMARTMESH_BROWSER"
NAMES = ("chromium", "chromium-browser", "google-chrome")
# Render in software. Playwright adds the flags of a browser without network access of its own.
FLAGS = ["--disable-gpu", "--use-gl=angle", "--use-angle=swiftshader", "--disable-quic"]


def find_browser() -> str | None:
    """Return the path of a Chromium, or None if none is installed."""
    named = os.environ.get(VARIABLE)
    paths = [shutil.which(name) for name in ([named] if named else NAMES)]
    return next((path for path in paths if path), None)
