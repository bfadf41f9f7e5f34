"""Machine code is never older than its sources; whatever is wrong with the place it is kept in, the functions run."""

from __future__ import annotations

import ast
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from smartmesh_ros import compiled, compiling, machine_code
from tests.test_compiled import SMALL

pytestmark = pytest.mark.skipif(
    compiled.numba is None or compiled.numba.config.DISABLE_JIT, reason="nothing is compiled"
)
PATIENCE = 300.0
# A caller in one file and the function that it calls in another.
GAP = """
import numpy as np
from smartmesh_ros.patches import facets, foot
from smartmesh_ros import machine_code
corner = np.array([0.0, 0.0, 0.05])
print(foot.gap_to_corner(corner) if hasattr(foot, "gap_to_corner") else "missing")
"""
CALLEE = """

@compiled
def corner_gap(corner):
    return corner[2]
"""
CALLER = """

@compiled
def gap_to_corner(corner):
    return facets.corner_gap(corner)
"""
PREPARE = "from smartmesh_ros import machine_code; print(machine_code.prepare())"
# The command line, after a change of the modules that it uses.
COMMAND = """
from smartmesh_ros import machine_code, compiling
{}
compiling.main([])
"""
# Why there is no machine code, by what is done to the modules or to the environment, or by what the warm-up does.
REASONS = [
    ("", {"NUMBA_DISABLE_JIT": "1"}, "", "the environment variable NUMBA_DISABLE_JIT is set"),
    ("", {machine_code.FOLDER_VARIABLE: "/proc/nowhere"}, "", "no folder for machine code is writable (tried /proc/no"),
    ("machine_code._version_of = lambda name: 'none'", {}, "", "Numba is not installed"),
    ("machine_code.find_spec = lambda name: None", {}, "", "PyBullet is not installed"),
    ("machine_code.os.fork = None; del machine_code.os.fork", {}, "", "processes cannot be forked on linux"),
    ("machine_code.DIGEST = '0123456789abcdef'", {}, "", "(ended with 1: the sources changed meanwhile)"),
    ("", {}, "raise OSError('no such scene')", "(ended with 1: OSError: no such scene)"),
    ("", {}, "import os; os.kill(os.getpid(), 9)", "(ended by signal 9)"),
]
# Compiles nothing, but says that it was asked to.
STUB = """
import pathlib, sys, time
from smartmesh_ros import machine_code
def compile(place, lock, progress):
    with open(sys.argv[1], "a") as file:
        print("compiled", file=file)
    (place / machine_code.COMPLETE).touch()
machine_code._compile = compile
print(machine_code.prepare())
"""


def environment(folder: Path | str, package: Path = machine_code.PACKAGE) -> dict[str, str]:
    """The environment of a process that keeps machine code in a folder."""
    path = os.pathsep.join([str(package.parent), os.environ.get("PYTHONPATH", "")])
    return {**os.environ, machine_code.FOLDER_VARIABLE: str(folder), "PYTHONPATH": path}


def run(
    script: str, folder: Path | str, *arguments: str, package: Path = machine_code.PACKAGE
) -> tuple[str, list[str]]:
    """What a script prints, and the lines of its standard error."""
    command = [sys.executable, "-P", "-c", script, *arguments]
    done = subprocess.run(
        command, env=environment(folder, package), capture_output=True, text=True, check=False, timeout=PATIENCE
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.strip(), done.stderr.splitlines()


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """A copy of the package in which a function of `foot` calls one of `facets`."""
    return copied(tmp_path)


@pytest.fixture(scope="module")
def compiled_once(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The machine code of both functions; take a copy."""
    folder = tmp_path_factory.mktemp("compiled")
    assert run(GAP, folder / "kept", package=copied(folder)) == ("0.05", [])
    return folder / "kept"


@pytest.fixture
def kept(compiled_once: Path, tmp_path: Path) -> Path:
    """A folder with the machine code of both functions."""
    return Path(shutil.copytree(compiled_once, tmp_path / "kept"))


def copied(folder: Path) -> Path:
    """Copy the package into a folder, and add the two functions."""
    copy = folder / "copy" / "smartmesh_ros"
    shutil.copytree(machine_code.PACKAGE, copy, ignore=shutil.ignore_patterns("__pycache__", machine_code.FOLDER_NAME))
    for name, more in (
        ("facets", CALLEE),
        ("foot", "\nfrom smartmesh_ros.patches import facets\n" + CALLER),
    ):
        with (copy / "patches" / f"{name}.py").open("a") as file:
            file.write(more)
    return copy


def test_a_caller_of_a_function_that_changed_is_compiled_again(package: Path, kept: Path) -> None:
    facets = package / "patches" / "facets.py"
    assert run(GAP, kept, package=package) == ("0.05", [])
    names = set(kept.iterdir())
    facets.write_text(facets.read_text().replace("return corner[2]", "return -corner[2]"))
    assert run(GAP, kept, package=package) == ("-0.05", [])
    assert len(set(kept.iterdir()) - names) == 1


def test_numbas_own_cache_would_have_kept_the_old_code(package: Path, tmp_path: Path) -> None:
    """The control of the test above."""
    facets = package / "patches" / "facets.py"
    module = package / "compiled.py"
    module.write_text(module.read_text().replace("self._cache = CodeCache(function, self)", "self.enable_caching()"))
    assert run(GAP, tmp_path / "kept", package=package)[0] == "0.05"
    facets.write_text(facets.read_text().replace("return corner[2]", "return -corner[2]"))
    assert run(GAP, tmp_path / "kept", package=package)[0] == "0.05"


def test_the_digest_is_of_every_module_that_one_with_compiled_functions_imports() -> None:
    contents = machine_code._contents(machine_code.PACKAGE)
    taken = machine_code._compiled_from(contents)
    assert {name for name, content in contents.items() if b"@compiled" in content} - {"compiled.py"} <= taken
    for name in taken:
        for module in _imports(ast.parse(contents[name])):
            file = module.replace(".", "/") + ".py"
            assert file in taken or file not in contents, f"{name} imports {file}"


def _imports(tree: ast.AST) -> set[str]:
    """Modules of this package that a module may import, by their names in it."""
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found |= {name.name for name in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            found |= {node.module, *(f"{node.module}.{name.name}" for name in node.names)}
    return {name.removeprefix("smartmesh_ros.") for name in found if name.startswith("smartmesh_ros.")}


def test_code_of_other_sources_is_removed_and_that_of_other_versions_stays(tmp_path: Path) -> None:
    for name in (f"{machine_code.DIGEST}-a", f"{machine_code.DIGEST}-b", "0123456789abcdef-a"):
        (tmp_path / name).mkdir()
    machine_code.remove_old(tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        f"{machine_code.DIGEST}-a",
        f"{machine_code.DIGEST}-b",
    ]


def test_everything_that_a_warm_up_needs_is_compiled_beforehand() -> None:
    place = machine_code.prepare()
    assert place is not None
    script = """
import gc
from numba.core.dispatcher import Dispatcher
from smartmesh_ros.compiling import NO_BODIES
from smartmesh_ros.node.fleet.peer_states import PeerReader
from smartmesh_ros.warm_up import warm_up
warm_up()
PeerReader().read(NO_BODIES, 0, 0)
made = [d for d in gc.get_objects() if isinstance(d, Dispatcher) and d.py_func.__module__.startswith("smartmesh_ros")]
print(sum(map(len, (d.signatures for d in made))) > 20, [d for d in made if d.stats.cache_misses])
"""
    said, lines = run(script, place.parent)
    assert said.splitlines()[-1] == "True []"
    assert not [line for line in lines if "smartmesh_ros" in line]


@pytest.mark.parametrize("harm", ["cut short", "a byte changed", "nothing left"])
def test_damaged_code_is_compiled_again_and_one_line_says_so(package: Path, kept: Path, harm: str) -> None:
    files = [path for path in kept.glob("*/*") if path.is_file()]
    assert len(files) == 2
    for path in files:
        content = bytearray(path.read_bytes())
        content[len(content) // 2] ^= 255
        path.write_bytes({"cut short": content[:100], "a byte changed": content, "nothing left": b""}[harm])
    said, lines = run(GAP, kept, package=package)
    assert said == "0.05"
    assert "is damaged" in lines[0]
    assert len(lines) <= 2
    assert run(GAP, kept, package=package) == ("0.05", [])


def test_where_nothing_can_be_written_a_line_says_so_and_the_choice_of_patches_is_the_same() -> None:
    """Bit by bit: what is kept is compiled for a generic processor, what is not for this one."""
    prepare, records = (
        "from smartmesh_ros import machine_code; machine_code.prepare()",
        "print(selector.supports.tobytes())",
    )
    place = machine_code.prepare()
    assert place is not None
    expected, _ = run(SMALL + records, place.parent)
    assert expected.splitlines()[0] == "[1, 1]"
    said, [line] = run(prepare + SMALL + records, "/proc/nowhere")
    assert said == expected
    assert "no folder for machine code is writable (tried /proc/nowhere): every start compiles" in line
    assert machine_code.FOLDER_VARIABLE in line


@pytest.mark.parametrize(
    "other", ["py3.9-numba0.68.1-numpy2.4-linux-x86_64", "py3.11-numba0.60.0-numpy1.26-linux-aarch64"]
)
def test_code_for_another_python_or_processor_is_named_and_left_alone(tmp_path: Path, other: str) -> None:
    there = tmp_path / f"{machine_code.DIGEST}-{other}"
    there.mkdir()
    (there / machine_code.COMPLETE).touch()
    (there / "some").write_bytes(b"code")
    said, [line] = run(STUB, tmp_path, str(tmp_path / "log"))
    assert f"existing machine code is for {other}, not {machine_code.platform_tag()}" in line
    assert said == str(tmp_path / machine_code.name())
    assert (there / "some").read_bytes() == b"code"


def test_of_processes_that_start_together_one_compiles(tmp_path: Path) -> None:
    log = tmp_path / "log"
    command = [sys.executable, "-P", "-c", STUB, str(log)]
    started = [
        subprocess.Popen(command, env=environment(tmp_path / "kept"), stdout=subprocess.PIPE, text=True)
        for _ in range(4)
    ]
    said = {process.communicate(timeout=PATIENCE)[0].strip() for process in started}
    assert said == {str(tmp_path / "kept" / machine_code.name())}
    assert log.read_text() == "compiled\n"


def test_a_process_waits_for_another_that_compiles_and_not_for_one_that_died(tmp_path: Path) -> None:
    (tmp_path / "some").mkdir()
    hold = "import time; from smartmesh_ros import machine_code; from pathlib import Path; import sys\n"
    hold += "with machine_code._locked(Path(sys.argv[1])): print('held', flush=True); time.sleep(1000)"
    command = [sys.executable, "-P", "-c", hold, str(tmp_path / "some")]
    holder = subprocess.Popen(command, env=environment(tmp_path), stdout=subprocess.PIPE, text=True)
    assert holder.stdout is not None
    assert holder.stdout.readline() == "held\n"
    log = tmp_path / "log"
    waiting = subprocess.Popen(
        [sys.executable, "-P", "-c", STUB, str(log)],
        env=environment(tmp_path), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert waiting.stderr is not None
    assert "compiling once" in waiting.stderr.readline()
    assert "another process compiles the same functions; waiting for it" in waiting.stderr.readline()
    assert not log.exists()
    holder.kill()
    holder.communicate()
    assert waiting.communicate(timeout=PATIENCE)[0].strip() == str(tmp_path / machine_code.name())
    assert log.read_text() == "compiled\n"


def test_processes_that_compile_end_with_the_one_that_waits_for_them(tmp_path: Path) -> None:
    started = subprocess.Popen([sys.executable, "-P", "-c", PREPARE], env=environment(tmp_path), stderr=subprocess.PIPE)
    end = time.monotonic() + PATIENCE
    while not any(tmp_path.rglob("*.lock")):  # a function is being compiled
        assert time.monotonic() < end
        time.sleep(0.05)
    started.send_signal(signal.SIGKILL)
    started.communicate()
    with machine_code._locked(tmp_path / "some"):  # which they hold as well
        assert not any(tmp_path.rglob(machine_code.COMPLETE))


def test_sources_that_changed_meanwhile_leave_nothing_that_counts_as_complete(tmp_path: Path) -> None:
    place = tmp_path / machine_code.name()
    place.mkdir()
    script = "from smartmesh_ros.compiling import fill; fill()"
    command = [sys.executable, "-P", "-c", script, str(place), "0123456789abcdef", str(os.getpid())]
    done = subprocess.run(command, env=environment(tmp_path), capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "the sources changed" in done.stderr
    assert not list(place.iterdir())


@pytest.mark.parametrize(("change", "settings", "warm_up", "reason"), REASONS)
def test_the_command_says_why_nothing_was_compiled(
    package: Path, tmp_path: Path, change: str, settings: dict[str, str], warm_up: str, reason: str
) -> None:
    with (package / "warm_up.py").open("a") as file:
        file.write(f"\n\n{warm_up}\n")
    command = [sys.executable, "-P", "-c", COMMAND.format(change)]
    there = {**environment(tmp_path / "kept", package), **settings}
    done = subprocess.run(command, env=there, capture_output=True, text=True, check=False, timeout=PATIENCE)
    assert done.returncode == 1
    last = done.stderr.splitlines()[-1]
    assert last.startswith("nothing was compiled in advance: ")
    assert reason in last


def test_progress_counts_what_is_compiled_and_tells_the_time_left(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """Two of four functions are there, one of them for two kinds of arguments."""
    for name in ("a.f-1", "a.f-2", "a.g-1"):
        (tmp_path / f"{name}.{compiled.GENERIC}").touch()
    monkeypatch.setattr(compiling, "PROGRESS_PERIOD", 0.0)
    child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(0.5)"])
    compiling._wait([child.pid], tmp_path, os.getppid(), 4)
    assert "compiled 2 of 4 functions in 0 s, about 0 s left" in capfd.readouterr().out


def test_the_expected_time_is_that_of_an_idle_and_of_a_slow_machine() -> None:
    for cores in (1, 2, 4):
        least, most = (60 * int(part) for part in machine_code._minutes(cores).split() if part.isdigit())
        idle = machine_code.START_TIME + machine_code.COMPILE_TIME / cores
        assert least <= max(60, 1.5 * idle)
        assert most >= 5 * idle
