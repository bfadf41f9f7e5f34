"""The package runs with compiled functions and without, and compiles nothing while it runs."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

SMALL = """
import warnings
with warnings.catch_warnings(record=True) as caught:
    warnings.simplefilter("always")
    from smartmesh_ros import HeightMap, Terrain, PatchConfig
    from smartmesh_ros.patches.selector import Selector
    from smartmesh_ros.patches.shapes import ShapeTable, box
    import numpy as np
    table = ShapeTable()
    table.reserve(2)
    for slot in range(2):
        table.put(slot, box((0.4, 0.4, 0.4)))
    heights = 0.1 * np.sin(np.arange(400.0)).reshape(20, 20)
    selector = Selector(Terrain(HeightMap(heights, resolution=0.1)), PatchConfig())
    selector.reserve(2)
    bodies = np.zeros((2, 13))
    bodies[:, :3], bodies[:, 6] = [(1.0, 1.0, 0.2), (1.0, 1.0, 3.0)], 1.0
    selector.update(np.arange(2), table.shapes, bodies, 0.0, 0.02)
print(selector.supports["state"].tolist())
for warning in caught:
    if issubclass(warning.category, RuntimeWarning):
        print("warning:", warning.message)
"""


def run(script: str, **environment: str) -> list[str]:
    """The lines that a process of its own prints."""
    done = subprocess.run(
        [sys.executable, "-c", script],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return [line for line in done.stdout.splitlines() if not line.startswith("argv[0]")]  # PyBullet says that


def path_with(folder: Path) -> str:
    """The Python path with a folder in front, and this package."""
    here = str(Path(__file__).resolve().parents[1])
    return os.pathsep.join([str(folder), here, os.environ.get("PYTHONPATH", "")])


@pytest.mark.parametrize("problem", ["ImportError('no numba')", "RuntimeError('Numba needs NumPy 2.1 or less')"])
def test_without_numba_it_runs_as_python_and_says_so_once(tmp_path: Path, problem: str) -> None:
    (tmp_path / "numba.py").write_text(f"raise {problem}\n")
    states, *warnings = run(SMALL, PYTHONPATH=path_with(tmp_path))
    assert states == "[1, 1]", "as with Numba, see below"
    assert len(warnings) == 1
    assert "pip install numba" in warnings[0]


def test_with_numba_it_warns_of_nothing() -> None:
    assert run(SMALL) == ["[1, 1]"]


CALLS = """
import sys
from smartmesh_ros.compiled import compiled


@compiled
def half(x):
    return 0.5 * x


@compiled
def quarter(x):
    return half(half(x))


calls = {"caller": lambda: quarter(8.0), "called": lambda: half(8.0), "other types": lambda: half(8)}
print([calls[name]() for name in sys.argv[1:]])
"""


@pytest.mark.parametrize("order", [["caller", "called", "caller"], ["called", "caller", "called"]])
def test_python_may_call_what_was_compiled_for_a_compiled_caller(tmp_path: Path, order: list[str]) -> None:
    """Code without a wrapper for Python would end the process; the second process loads what the first one kept."""
    script = tmp_path / "calls.py"
    script.write_text(CALLS)
    results = {"caller": 2.0, "called": 4.0, "other types": 4.0}
    environment = {"PYTHONPATH": path_with(tmp_path), "SMARTMESH_MACHINE_CODE": str(tmp_path / "kept")}
    for names in (order, ["caller"], [*reversed(order), "other types", *order]):
        code = f"import runpy, sys; sys.argv[1:] = {names!r}; runpy.run_path({str(script)!r})"
        assert run(code, **environment) == [str([results[name] for name in names])]
