"""Checks which patch settings a main mesh allows."""

from __future__ import annotations

from smartmesh_ros.ground.colliders.whole_mesh import require_whole
from smartmesh_ros.patches.config import ANYWHERE, PatchConfig, is_whole
from smartmesh_ros.report.methods import require_search, require_search_on
from smartmesh_ros.terrain.terrain import MainMesh
from smartmesh_ros.terrain.trimesh import TriangleMesh


def require_usable(config: PatchConfig, mesh: MainMesh, *, exact: bool) -> None:
    """Raise `InputError` if ``mesh`` does not allow the patch settings ``config``; the message names settings that it
    allows. ``exact``: contacts come from the map, which every mesh allows; the search for patches that are shown may
    not work on it."""
    if exact:
        if isinstance(mesh, TriangleMesh) and config.search not in ANYWHERE:
            require_search_on(config.search, mesh.shape)
        return
    if isinstance(mesh, TriangleMesh):
        require_search(config.search, mesh)
    if is_whole(config.kind):
        require_whole(config.kind, mesh)
