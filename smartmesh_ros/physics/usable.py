"""Which settings of patches a main mesh allows."""

from __future__ import annotations

from smartmesh_ros.patches.config import PatchConfig
from smartmesh_ros.physics.whole_mesh import require_whole
from smartmesh_ros.search.methods import require_search
from smartmesh_ros.terrain.terrain import MainMesh
from smartmesh_ros.terrain.trimesh import TriangleMesh


def require_usable(config: PatchConfig, mesh: MainMesh) -> None:
    """Raises `InputError` where patches cannot be made of ``mesh`` as ``config`` says; the message says what can."""
    if isinstance(mesh, TriangleMesh):
        require_search(config.search, mesh)
    if config.kind == "whole_trimesh" or config.kind == "whole_heightfield":
        require_whole(config.kind, mesh)
