"""A workspace as a new user makes it: a copy of this repository in an empty folder, beside a package of the user's."""

import os
import re
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest
from ament_index_python.packages import get_package_prefix

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
# What is made, and not part of the repository.
MADE = (
    ".git", ".venv", "build", "install", "log", "out", "__pycache__", "*.egg-info", ".*_cache",
    ".hypothesis", "*.so",
)  # fmt: skip
MESSAGES = "smartmesh_msgs"
# Patience with commands that compile [s].
LONG = 900


@dataclass(frozen=True)
class Workspace:
    """A folder with ``src/``, and how commands are run in it."""

    folder: Path

    def run(self, command: str, *, sourced: bool = True, check: bool = True) -> subprocess.CompletedProcess[str]:
        """Runs a command of bash in the workspace, its packages sourced unless ``sourced`` is false."""
        script = f"source install/setup.bash && {command}" if sourced else command
        result = subprocess.run(
            ["bash", "-c", script],
            cwd=self.folder,
            env=environment(),
            capture_output=True,
            text=True,
            timeout=LONG,
            check=False,
        )
        if check and result.returncode:
            raise AssertionError(f"{command} ended with {result.returncode}:\n{result.stdout}\n{result.stderr}")
        return result


def environment() -> dict[str, str]:
    """This environment without the packages of this repository: ROS alone is sourced."""
    kept = {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "COLCON_PREFIX_PATH")}
    for name in ("AMENT_PREFIX_PATH", "CMAKE_PREFIX_PATH", "LD_LIBRARY_PATH", "PATH"):
        parts = [part for part in os.environ.get(name, "").split(os.pathsep) if part]
        made = [part for part in parts if {ROOT / "install", ROOT / "build"} & {Path(part), *Path(part).parents}]
        kept[name] = os.pathsep.join(part for part in parts if part not in made)
    return kept


def recipe_line(words: str) -> str:
    """The one line that holds the words of the README's recipe for a workspace, without comments."""
    blocks = re.findall(r"```\w*\n(.*?)```", (ROOT / "README.md").read_text(), re.DOTALL)
    [recipe] = [block for block in blocks if "\nln -s" in block]
    [line] = [line for line in (line.partition("  #")[0].strip() for line in recipe.splitlines()) if words in line]
    return line


def build_command() -> str:
    """The README's command that builds a workspace."""
    return recipe_line("colcon").partition(" && ")[0]


def copy_of_this(folder: Path) -> None:
    """Copies this repository as it is in version control, what is not committed yet included, and libraries of the core
    that are compiled already."""
    shutil.copytree(ROOT, folder, ignore=shutil.ignore_patterns(*MADE))
    if (compiled_core := ROOT / "build" / "core").is_dir():
        shutil.copytree(compiled_core, folder / "build" / "core")


@pytest.fixture(scope="session")
def sources(tmp_path_factory: pytest.TempPathFactory) -> Workspace:
    """The workspace before it is built: this repository, linked as the README says, and the user's package."""
    folder = tmp_path_factory.mktemp("newcomer") / "ws"
    (folder / "src").mkdir(parents=True)
    copy_of_this(folder / "src" / "smartmesh_ros")
    shutil.copytree(HERE / "my_robot", folder / "src" / "my_robot")
    made = Workspace(folder)
    made.run(recipe_line("ln -s"), sourced=False)
    return made


@pytest.fixture(scope="session")
def workspace(sources: Workspace) -> Workspace:
    """The workspace, built with the README's command but for the messages, whose C++ takes minutes: those of this
    environment, which `make` built from the same sources."""
    installed = sources.folder / "install"
    installed.mkdir()
    (installed / MESSAGES).symlink_to(get_package_prefix(MESSAGES))
    sources.run(f"{build_command()} --packages-skip {MESSAGES}", sourced=False)
    assert Path(sys.prefix) in Path(shutil.which("colcon") or "").parents or shutil.which("ros2")
    return sources
