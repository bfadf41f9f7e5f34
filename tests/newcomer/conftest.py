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

from smartmesh_ros import machine_code

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
# What is made, and not part of the repository.
MADE = (
    ".git", ".venv", "build", "install", "log", "out", "__pycache__", "_machine_code", "*.egg-info", ".*_cache",
    ".hypothesis", "*.so",
)  # fmt: skip
# A function that is called from another file, its caller, and what calls that.
RETURNED = "return corner[2]"
CALLEE = f"\n\n@compiled\ndef corner_gap(corner):\n    {RETURNED}\n"
CALLER = """
from smartmesh_ros.patches import facets


@compiled
def gap_to_corner(corner):
    return facets.corner_gap(corner)
"""
# A warm-up with nothing else to compile, which takes seconds.
SMALL_WARM_UP = """

def run_through() -> None:
    from smartmesh_ros.patches.foot import gap_to_corner

    gap_to_corner(np.zeros(3))
"""
ASK_GAP = (
    "import numpy; from smartmesh_ros.patches.foot import gap_to_corner; "
    "print(gap_to_corner(numpy.array([0.0, 0.0, 0.05])))"
)
ASK_PLACE = "from smartmesh_ros import machine_code; print(machine_code.complete())"
ASK_CORE = "from smartmesh_ros.core import _core; print(_core.__file__)"
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
        kept[name] = os.pathsep.join(part for part in parts if not within(part, ROOT / "install", ROOT / "build"))
    return kept


def within(path: str, *folders: Path) -> bool:
    """Whether a path is below one of the folders."""
    return any(Path(path).is_relative_to(folder) for folder in folders)


def readme_block(beginning: str) -> list[str]:
    """The lines of the README's one code block in which a line starts with ``beginning``, without comments."""
    blocks = re.findall(r"```(?:bash|console)?\n(.*?)```", (ROOT / "README.md").read_text(), re.DOTALL)
    [block] = [block for block in blocks if re.search(f"^{re.escape(beginning)}", block, re.MULTILINE)]
    return [line.partition("  #")[0].strip() for line in block.splitlines() if line.strip()]


def line_with(words: str, lines: list[str]) -> str:
    """The one line that holds the words."""
    [line] = [line for line in lines if words in line]
    return line


def copy_of_this(folder: Path, *, compiled: bool = False) -> None:
    """Copies this repository as it is in version control, what is not committed yet included, and libraries of the core
    that are compiled already; on request with the machine code of all functions, which takes long to make."""
    shutil.copytree(ROOT, folder, ignore=shutil.ignore_patterns(*MADE))
    if (compiled_core := ROOT / "build" / "core").is_dir():
        shutil.copytree(compiled_core, folder / "build" / "core")
    if compiled:
        made = machine_code.prepare()
        assert made is not None
        shutil.copytree(made, folder / "smartmesh_ros" / machine_code.FOLDER_NAME / made.name)


def add_caller_and_callee(package: Path) -> None:
    """Adds a compiled function to one file of a package, one that calls it to another, and a warm-up of no others."""
    for name, more in (
        ("patches/facets.py", CALLEE),
        ("patches/foot.py", CALLER),
        ("warm_up.py", SMALL_WARM_UP),
    ):
        with (package / name).open("a") as file:
            file.write(more)


def change_callee(package: Path) -> None:
    """Changes what the called function returns, and nothing in the file of its caller."""
    file = package / "patches" / "facets.py"
    text = file.read_text()
    assert text.count(RETURNED) == 1
    file.write_text(text.replace(RETURNED, "return -corner[2]"))


@pytest.fixture(scope="session")
def sources(tmp_path_factory: pytest.TempPathFactory) -> Workspace:
    """The workspace before it is built: this repository, linked as the README says, and the user's package."""
    folder = tmp_path_factory.mktemp("newcomer") / "ws"
    (folder / "src").mkdir(parents=True)
    copy_of_this(folder / "src" / "smartmesh_ros", compiled=True)
    shutil.copytree(HERE / "my_robot", folder / "src" / "my_robot")
    made = Workspace(folder)
    made.run(line_with("ln -s", readme_block("ln -s")), sourced=False)
    return made


@pytest.fixture(scope="session")
def workspace(sources: Workspace) -> Workspace:
    """The workspace, built with the README's command but for the messages, whose C++ takes minutes: those of this
    environment, which `make` built from the same sources."""
    build, _, _ = line_with("colcon", readme_block("ln -s")).partition(" && ")
    installed = sources.folder / "install"
    installed.mkdir()
    (installed / MESSAGES).symlink_to(get_package_prefix(MESSAGES))
    sources.run(f"{build} --packages-skip {MESSAGES}", sourced=False)
    assert Path(sys.prefix) in Path(shutil.which("colcon") or "").parents or shutil.which("ros2")
    return sources
