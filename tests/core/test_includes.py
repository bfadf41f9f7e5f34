"""The folders of the C++ core include one another one way, and only two of them know Bullet or Python."""

import re
from pathlib import Path

import pytest

CORE = Path(__file__).parents[2] / "smartmesh_ros" / "core"
# Files of a folder may include those beside them and of the folders before, but for these.
ORDER = ("math", "map", "mesh", "ground", "shape", "contact", "soil", "step", "bullet", "python")
NEVER = {("shape", "map"), ("shape", "mesh"), ("shape", "ground"), ("soil", "mesh"), ("soil", "contact")}
SOURCES = sorted(path for name in ORDER for path in (CORE / name).glob("*.*") if path.suffix in {".cpp", ".h"})


@pytest.mark.parametrize("folder", ORDER)
def test_includes_follow_the_arrows(folder: str) -> None:
    allowed = {folder} | {name for name in ORDER[: ORDER.index(folder)] if (folder, name) not in NEVER}
    for path in (path for path in SOURCES if path.parent.name == folder):
        for form, name in re.findall(r'^#include ([<"])([^>"]+)[>"]', path.read_text(), re.M):
            first = name.split("/")[0]
            if form == '"':
                assert first in allowed, (path, name)
            if first in {"BulletCollision", "BulletDynamics", "LinearMath", "btBulletDynamicsCommon.h", "examples"}:
                assert folder in {"bullet", "python"}, (path, name)
            if first == "nanobind" or first == "Python.h":
                assert folder == "python", (path, name)


def test_every_file_has_a_folder() -> None:
    assert SOURCES and not [path.name for path in CORE.iterdir() if path.suffix in {".cpp", ".h"}]
