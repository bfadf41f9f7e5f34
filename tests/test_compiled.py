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
    from smartmesh_ros.patches.shapes import SHAPE
    import numpy as np
    shape = np.zeros(2, SHAPE).view(np.recarray)
    for name in ("half_x", "half_y", "half_z", "radius"):
        shape[name] = 0.2
    shape["turn"] = (0.0, 0.0, 0.0, 1.0)
    heights = 0.1 * np.sin(np.arange(400.0)).reshape(20, 20)
    selector = Selector(Terrain(HeightMap(heights, resolution=0.1)), PatchConfig())
    selector.adopt(shape, np.ones(2, bool), np.full(2, -1))
    bodies = np.zeros((2, 13))
    bodies[:, :3], bodies[:, 6] = [(1.0, 1.0, 0.2), (1.0, 1.0, 3.0)], 1.0
    selector.update(bodies, 0.0, 0.02)
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
    assert states == run(SMALL)[0] == "[2, 0]"
    assert len(warnings) == 1
    assert "pip install numba" in warnings[0]


def test_with_numba_it_warns_of_nothing() -> None:
    assert run(SMALL) == ["[2, 0]"]


LOOP = """
import numpy as np
from numba.core.dispatcher import Dispatcher
import gc
from smartmesh_ros import BodyState, Box, Capsule, Cylinder, HeightMap, PatchConfig, Sphere, World, WorldConfig
from smartmesh_ros.warm_up import warm_up

def signatures():
    return {f"{d.py_func.__module__}.{d.py_func.__name__}": len(d.signatures)
            for d in gc.get_objects() if isinstance(d, Dispatcher)
            and d.py_func.__module__.startswith("smartmesh_ros")}

warm_up()
r, c = np.indices((60, 60)) * 0.1
ground = lambda t: 0.1 * np.sin(r + 2.0 * t) * np.cos(c)
before = signatures()
heightmap = HeightMap(ground(0.0), resolution=0.1)
with World(heightmap) as world:
    for index, shape in enumerate((Sphere(0.1), Box(0.2, 0.3, 0.1), Cylinder(0.1, 0.2), Capsule(0.1, 0.2))):
        world.spawn(f"body {index}", shape, 1.0, BodyState((1.5 + index, 2.0, 0.5)))
    world.spawn("fast", Sphere(0.05), 1.0, BodyState((3.0, 4.0, 1.0), linear=(0.0, 0.0, -20.0)))
    world.spawn("below", Sphere(0.1), 1.0, BodyState((4.0, 4.0, -1.0)))
    world.track("tracked", 0.3, BodyState((2.0, 4.0, 0.2)))
    for step in range(100):
        if step % 4 == 0:
            heightmap.replace(ground(world.time), time=world.time)
        world.step()
        world.ground.batches
after = signatures()
print(sorted(name for name, count in after.items() if count != before.get(name, 0)))
"""


def test_nothing_is_compiled_while_a_world_runs() -> None:
    pytest.importorskip("smartmesh_ros.warm_up")
    assert run(LOOP) == ["[]"]
