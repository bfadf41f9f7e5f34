"""Meshes of a viser scene."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.tools.view.looks import Colour


class Mesh(NamedTuple):
    """``vertices`` (V, 3) [m] and ``triangles`` (T, 3) of one ``colour``, seen from the front or from both sides."""

    vertices: NDArray[Any]
    triangles: NDArray[Any]
    colour: Colour
    side: Literal["front", "double"] = "front"


class Meshes:
    """The meshes of one part of a scene, by path. Only changes are sent to browsers."""

    def __init__(self, scene: Any) -> None:
        self._scene = scene
        self._handles: dict[str, Any] = {}

    def show(self, meshes: Mapping[str, Mesh]) -> None:
        """Show these meshes and no others."""
        for path in self._handles.keys() - meshes.keys():
            self._handles.pop(path).remove()
        for path, mesh in meshes.items():
            known = self._handles.get(path)
            if known is not None and np.array_equal(known.faces, mesh.triangles):
                known.vertices = mesh.vertices
            else:
                self._handles[path] = self._scene.add_mesh_simple(
                    path, mesh.vertices, mesh.triangles, color=mesh.colour, side=mesh.side, cast_shadow=False
                )
