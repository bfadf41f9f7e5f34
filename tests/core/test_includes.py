"""The folders of the C++ core include one another one way, and only two of them know Bullet or Python."""

import re
from pathlib import Path

import pytest

CORE = Path(__file__).parents[2] / "smartmesh_ros" / "core"
# What the files of a folder may include, besides those beside them.
ARROWS: dict[str, set[str]] = {
    "math": set(),
    "map": {"math"},
    "mesh": {"math", "map"},
    "ground": {"math", "map", "mesh"},
    "shape": {"math"},
    "contact": {"math", "map", "mesh", "ground", "shape"},
    "soil": {"math", "map", "ground", "shape"},
    "step": {"math", "map", "mesh", "ground", "shape", "contact", "soil"},
    "bullet": {"math", "map", "mesh", "ground", "shape", "contact", "soil", "step"},
    "python": {"math", "map", "mesh", "ground", "shape", "contact", "soil", "step", "bullet"},
}
SOURCES = sorted(path for name in ARROWS for path in (CORE / name).glob("*.*") if path.suffix in {".cpp", ".h"})


@pytest.mark.parametrize("folder", ARROWS)
def test_includes_follow_the_arrows(folder: str) -> None:
    for path in (path for path in SOURCES if path.parent.name == folder):
        for form, name in re.findall(r'^#include ([<"])([^>"]+)[>"]', path.read_text(), re.M):
            first = name.split("/")[0]
            if form == '"':
                assert first == folder or first in ARROWS[folder], (path, name)
            if first in {"BulletCollision", "BulletDynamics", "LinearMath", "btBulletDynamicsCommon.h", "examples"}:
                assert folder in {"bullet", "python"}, (path, name)
            if first == "nanobind" or first == "Python.h":
                assert folder == "python", (path, name)


def test_every_file_has_a_folder() -> None:
    assert SOURCES and not [path.name for path in CORE.iterdir() if path.suffix in {".cpp", ".h"}]
