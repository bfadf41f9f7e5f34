"""Writes docs/parameters.md from the node's parameter specifications.

scripts/workspace run dev -- python scripts/write_parameters.py
"""

from itertools import groupby
from pathlib import Path

from smartmesh_ros.node.parameters.helping import typed
from smartmesh_ros.node.parameters.specifications import SPECS

HEAD = """# Parameters of `terrain_collider`

Written by `scripts/write_parameters.py` from the node's declarations. Defaults are written as in a file
or after `-p`. *fixed* parameters need a restart; `ros2 param set` changes all others while the node runs.
"""


def parameter_page() -> str:
    """Return a Markdown page with one table of parameters per group (first part of the name)."""
    lines = [HEAD.rstrip()]
    for group, members in groupby(SPECS, lambda spec: spec.name.partition(".")[0] if "." in spec.name else "others"):
        lines += ["", f"## {group}", "", "| name | default | values | change | meaning |", "|---|---|---|---|---|"]
        for spec in members:
            values = ", ".join(f"`{choice}`" for choice in spec.choices) or spec.values
            change = "fixed" if spec.read_only else "any time"
            cells = (f"`{spec.name}`", f"`{typed(spec.default)}`", values, change, spec.description.replace("|", "\\|"))
            lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    page = Path(__file__).parent.parent / "docs" / "parameters.md"
    page.write_text(parameter_page())
    print(f"wrote {page}")
