"""What `scripts/workspace` installs, and what it says meanwhile; stand-ins take the places of its tools."""

import os
import re
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from tests.newcomer.conftest import ROOT

# Stand-in for the Python of `.venv`: writes down what it is asked to install, and takes its time.
PYTHON = """#!/bin/bash
case "$*" in
  *"config list"*) echo "global.index-url='elsewhere'" ;;
  *"pip --disable-pip-version-check install"*) echo "CFLAGS=$CFLAGS $*" >>installed; sleep "$SLOW" ;;
  *find_spec*) [ "$HAS_PYBULLET" = 1 ] ;;
esac
"""
# Stand-in for colcon: leaves the log of a build that is halfway, and takes its time.
COLCON = """#!/bin/bash
mkdir -p log/latest_build/smartmesh_msgs install build/test_interfaces/install
echo "[ 42%] Building C object" >log/latest_build/smartmesh_msgs/stdout.log
touch install/setup.bash build/test_interfaces/install/local_setup.bash
sleep "$SLOW"
"""


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """A checkout without sources, with a sourced ROS 2 Jazzy: the script that ships, and stand-ins for its tools."""
    shutil.copytree(ROOT / "requirements", tmp_path / "requirements")
    folders = ("msg_defs/cmake", "smartmesh_ros", "bin", "launch", "config", "resource", "tests/interfaces", "scripts")
    for name in folders:
        (tmp_path / name).mkdir(parents=True)
    for name in ("setup.py", "core_build.py", "setup.cfg", "package.xml", "tests/interfaces/package.xml"):
        (tmp_path / name).touch()
    tools = tmp_path / ".venv" / "bin"
    tools.mkdir(parents=True)
    (tools.parent / "pyvenv.cfg").touch()
    for name, content in (("python", PYTHON), ("colcon", COLCON), ("c++", ""), ("cmake", "")):
        (tools / name).write_text(content)
        (tools / name).chmod(0o755)
    script = (ROOT / "scripts" / "workspace").read_text()
    (tmp_path / "scripts" / "workspace").write_text(re.sub("^period=20$", "period=0.2", script, flags=re.MULTILINE))
    return tmp_path


def prepare(checkout: Path, *requirements: str, **settings: str) -> str:
    """Run `scripts/workspace prepare`; return what it says."""
    kept = {name: value for name, value in os.environ.items() if name not in ("SMARTMESH_WHEELS", "CFLAGS")}
    kept |= {"ROS_DISTRO": "jazzy", "AMENT_PREFIX_PATH": "/opt/ros/jazzy", "PYTHON": sys.executable, "SLOW": "0"}
    kept |= {"PATH": f"{checkout / '.venv' / 'bin'}:{os.environ['PATH']}", **settings}
    done = subprocess.run(
        ["bash", checkout / "scripts" / "workspace", "prepare", *requirements],
        env=kept, capture_output=True, text=True, check=False, timeout=300,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stderr


def test_what_takes_long_says_the_time_of_a_slow_machine_and_its_progress(checkout: Path) -> None:
    said = prepare(checkout, "dev", SLOW="3")
    for what in ("installing", "building the workspace", "building the tests' message packages"):
        first, *more = [line for line in said.splitlines() if f"[workspace] {what}" in line]
        assert re.search(r"\d+ to \d+ minutes", first), first
        assert more
        assert all(re.search(r": \d+ s so far", line) for line in more)
    assert re.search(r"building the workspace: \d+ s so far, 42 % of the messages", said)


def test_the_messages_end_with_the_command(checkout: Path) -> None:
    """Nothing keeps the standard error open: the run would take as long as the period of the messages."""
    script = checkout / "scripts" / "workspace"
    script.write_text(script.read_text().replace("period=0.2", "period=1000"))
    assert "so far" not in prepare(checkout, "dev")


def test_of_two_at_once_one_waits_and_finds_all_done(checkout: Path) -> None:
    """As in two terminals, in which somebody types the same command."""
    with ThreadPoolExecutor() as pool:
        said = list(pool.map(lambda _: prepare(checkout, SLOW="1"), range(2)))
    assert sum("waiting for another scripts/workspace" in one for one in said) == 1
    assert sum("building the workspace" in one for one in said) == 1
    assert (checkout / "installed").read_text().count("requirements/run.txt") == 1


def test_a_pybullet_that_is_there_stays(checkout: Path) -> None:
    said = prepare(checkout, HAS_PYBULLET="1")
    installed = (checkout / "installed").read_text()
    assert "requirements/run.txt" in installed
    assert "requirements/pybullet.txt" not in installed, said


def test_another_is_installed_once_without_debug_information_and_follows_its_pin(checkout: Path) -> None:
    for _ in range(2):
        prepare(checkout, HAS_PYBULLET=str(int((checkout / "installed").exists())), CFLAGS="-O1")
        installed = (checkout / "installed").read_text()
        assert installed.count("requirements/pybullet.txt") == 1
        assert "CFLAGS=-O1 -g0" in installed
    pin = checkout / "requirements" / "pybullet.txt"
    pin.write_text(pin.read_text() + "# another version\n")
    prepare(checkout, HAS_PYBULLET="1")
    assert (checkout / "installed").read_text().count("requirements/pybullet.txt") == 2
