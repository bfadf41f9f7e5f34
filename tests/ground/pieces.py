"""Ground of a form in one piece, or in two that meet at x = 0: maps, meshes and decks."""

from collections.abc import Callable

import numpy as np

from smartmesh_ros import Deck, HeightMap, Terrain
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.terrain.terrain import MainMesh
from smartmesh_ros.terrain.trimesh import TriangleMesh
from tests.bodies import UPRIGHT
from tests.grounds import terrain_of
from tests.terrain.surfaces import mesh_of

REACH, ROWS = 4.0, np.arange(-20, 21)  # of the ground to both sides of x = 0 [m], and across [cells]
Form = Callable[[FloatArray, FloatArray], FloatArray]
Piece = Callable[[Form, float, float, float], MainMesh | Deck]  # of a form, from one x to another, in cells of a size


def a_map(form: Form, low: float, high: float, cell: float) -> HeightMap:
    x, y = (cell * each for each in np.meshgrid(np.arange(round(low / cell), round(high / cell) + 1), ROWS))
    return HeightMap(form(x, y), resolution=cell, origin=(low, cell * ROWS[0]))


def a_mesh(form: Form, low: float, high: float, cell: float) -> TriangleMesh:
    return mesh_of(a_map(form, low, high, cell))


def a_deck(form: Form, low: float, high: float, cell: float) -> Deck:
    deck = Deck(a_map(form, low, high, cell), thickness=0.5)
    deck.place((0.0, 0.0, 0.0), UPRIGHT, time=0.0)
    return deck


def pieces(form: Form, *parts: Piece, cell: float = 0.1) -> Terrain:
    """Ground of one piece, or of two."""
    if len(parts) == 1:
        return terrain_of(all=parts[0](form, -REACH, REACH, cell))
    return terrain_of(here=parts[0](form, -REACH, 0.0, cell), there=parts[1](form, 0.0, REACH, cell))
