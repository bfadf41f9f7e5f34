"""Runs the core's tests and mixed scenes with a core that is built with AddressSanitizer and UBSan, asserts on.

Usage: python scripts/sanitize.py [SECONDS]
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

import core_build  # noqa: E402

PACKAGE = ROOT / "build" / "sanitize" / "smartmesh_ros"


def prepare() -> None:
    """Make a package beside the real one: links to its files, and the sanitized core."""
    (PACKAGE / "core").mkdir(parents=True, exist_ok=True)
    for path in [*(ROOT / "smartmesh_ros").iterdir(), *(ROOT / "smartmesh_ros/core").glob("*.py")]:
        link = PACKAGE / path.relative_to(ROOT / "smartmesh_ros")
        if not link.exists():
            link.symlink_to(path)
    core_build.build(PACKAGE / "core" / core_build.LIBRARY, "-DSANITIZE=ON")


def runtime(name: str) -> str:
    """Return the path of a sanitizer's library."""
    done = subprocess.run([os.environ.get("CXX", "c++"), f"-print-file-name={name}"], check=True, capture_output=True)
    return done.stdout.decode().strip()


def run(*command: str) -> None:
    """Run Python with the sanitized core; exit if it fails."""
    environment = {
        **os.environ,
        "LD_PRELOAD": " ".join([runtime("libasan.so"), runtime("libubsan.so"), runtime("libstdc++.so")]),
        "ASAN_OPTIONS": "detect_leaks=0:abort_on_error=0",  # Python itself frees little at its end
        "UBSAN_OPTIONS": "print_stacktrace=1",
        "PYTHONPATH": os.pathsep.join([str(PACKAGE.parent), str(ROOT)]),
        "PYTHONSAFEPATH": "1",  # else the working folder, with the real package, comes first
        "PYTHONMALLOC": "malloc",
        "OPENBLAS_NUM_THREADS": "1",
    }
    done = subprocess.run([sys.executable, *command], check=False, cwd=ROOT, env=environment)
    if done.returncode != 0:
        raise SystemExit(f"smartmesh_ros: {' '.join(command)} failed with the sanitized core ({done.returncode})")


if __name__ == "__main__":
    prepare()
    # Without the tests' own conftest, which starts processes and needs ROS.
    run("-m", "pytest", "--noconftest", "-q", "-p", "no:cacheprovider", "-n", "auto", "tests/core")
    run("-m", "scripts.mixed_scenes", sys.argv[1] if len(sys.argv) > 1 else "30")
