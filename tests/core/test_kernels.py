"""The C++ tests of the core's kernels, by GoogleTest (Debian: apt install libgtest-dev)."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))
import core_build  # noqa: E402


def test_the_kernels_pass_their_tests() -> None:
    folder = core_build.configured()
    if "GTest_DIR:PATH=GTest_DIR-NOTFOUND" in (folder / "CMakeCache.txt").read_text():
        pytest.skip("GoogleTest is missing: apt install libgtest-dev")
    build = ["cmake", "--build", folder, "--parallel", "2", "--target", "core_tests"]
    for command in (build, ["ctest", "--test-dir", folder, "--output-on-failure"]):
        done = subprocess.run(command, check=False, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr
