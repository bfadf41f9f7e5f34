"""The README's code runs as it stands there, and its tables name what exists."""

import re
import subprocess
import sys
from pathlib import Path

README = (Path(__file__).parent.parent / "README.md").read_text()


def test_the_ten_lines_run_and_the_ball_rides_the_wave() -> None:
    [code] = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    check = """
(bx, _, z), _ = p.getBasePositionAndOrientation(ball)
below = terrain.at([[bx, 0.0]], 479 / 240).heights[0]
assert 0.15 < z - below < 0.4, (z, below)
"""
    result = subprocess.run([sys.executable, "-c", code + check], capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr


def test_the_parameter_table_is_that_of_the_node() -> None:
    from smartmesh_ros.node.parameters import SPECS

    [table] = re.findall(r"### Parameters\n\n(.*?)\n\n", README, re.DOTALL)
    named: set[str] = set()
    for row in table.splitlines()[2:]:
        prefix = ""
        for name in re.findall(r"`([^`]+)`", row.split("|")[1]):
            prefix = prefix if name.startswith(".") else name.split(".")[0]
            named.add(prefix + name if name.startswith(".") else name)
    assert named == {spec.name for spec in SPECS}
