"""Writes docs/parameters.md from the node's parameter specifications.

scripts/workspace run dev -- python scripts/write_parameters.py
"""

from pathlib import Path

from smartmesh_ros.node.parameters.helping import parameter_page
from smartmesh_ros.node.parameters.specifications import SPECS

if __name__ == "__main__":
    page = Path(__file__).parent.parent / "docs" / "parameters.md"
    page.write_text(parameter_page("terrain_collider", SPECS))
    print(f"wrote {page}")
