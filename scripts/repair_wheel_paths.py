"""Points the CMake files of the ROS 2 wheels at this machine's Python and NumPy headers.

About 20 exported CMake files contain paths of the container that built the wheels (/opt/python/cp3xx-cp3xx/...). The
message build fails where these paths do not exist.
"""

import re
import sys
import sysconfig
from pathlib import Path

import numpy as np

PYTHON_INCLUDE = re.compile(r"/opt/python/cp\d+-cp\d+/include/python3\.\d+")
NUMPY_INCLUDE = re.compile(r"/opt/python/cp\d+-cp\d+/lib/python3\.\d+/site-packages/numpy/_core/include")


def repair(prefix: Path) -> int:
    """Rewrite the two paths in every ``share/**/*.cmake`` below ``prefix``; return the number of changed files."""
    changed = 0
    for path in sorted((prefix / "share").rglob("*.cmake")):
        text = path.read_text(errors="surrogateescape")
        repaired = NUMPY_INCLUDE.sub(np.get_include(), text)
        repaired = PYTHON_INCLUDE.sub(sysconfig.get_path("include"), repaired)
        if repaired != text:
            path.unlink()  # the file may be a hard link to one in the installer's cache
            path.write_text(repaired, errors="surrogateescape")
            changed += 1
    return changed


if __name__ == "__main__":
    print(f"repaired {repair(Path(sys.prefix))} CMake files of the ROS 2 wheels")
