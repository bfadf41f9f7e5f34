"""Contacts with meshes that are no height maps, against the library coal."""

from __future__ import annotations

import coal
import numpy as np
import pytest

from smartmesh_ros.core import _core
from smartmesh_ros.terrain.trimesh import TriangleMesh
from tests.core import mesh_parts
from tests.core.contact_cases import IDENTITY, body, coal_triangle, distance, motion_of, random_rotation
from tests.core.mesh_parts import Parts

EXACT = 1e-6  # [m]
MARGIN = 0.01  # [m]
# Overlaps by less than this must have a contact that says so [m]. A deeper body may be on the other side.
SHALLOW = 6e-3
MESHES = {
    "stairs": mesh_parts.stairs(4, 0.15, 0.4),
    "soup": mesh_parts.soup(mesh_parts.stairs(4, 0.15, 0.4)),
    "blocks": mesh_parts.blocks(4, 0.15, 0.4),
    "sheet": mesh_parts.sheet(1.0, 2),
    "plate": mesh_parts.box((-0.5, -0.5, -0.01), (0.5, 0.5, 0.0)),
    "box": mesh_parts.box((-0.5, -0.5, -0.15), (0.5, 0.5, 0.15)),
}


class Triangles:
    """The triangles of a mesh, for coal."""

    def __init__(self, mesh: Parts) -> None:
        vertices, triangles = mesh
        self.made = [coal_triangle(vertices[corners]) for corners in triangles]
        self.low, self.high = vertices[triangles].min(axis=1), vertices[triangles].max(axis=1)

    def distance(self, shape: object, turn: np.ndarray, at: np.ndarray, reach: float) -> float:
        """Return the least signed distance of a shape from the triangles within its ``reach`` [m]."""
        near = np.all((self.low <= at + reach) & (self.high >= at - reach), axis=1)
        pose = coal.Transform3s(turn, at)
        return min((distance(self.made[k], IDENTITY, shape, pose) for k in np.flatnonzero(near)), default=np.inf)


@pytest.mark.parametrize("name", ["ball", "capsule", "box", "cylinder", "hull", "wheel"])
@pytest.mark.parametrize("form", MESHES)
def test_distances_are_exact_and_no_shallow_overlap_is_missed(form: str, name: str) -> None:
    vertices, corners = mesh = MESHES[form]
    tile = TriangleMesh(vertices, corners).core_reader
    triangles, wrong, apart, shallow = Triangles(mesh), [], 0, 0
    for seed in range(120):
        rng = np.random.default_rng(seed)
        made, turn = body(name, 0.1, rng), random_rotation(rng)
        place = rng.dirichlet((0.5, 0.5, 0.5)) @ vertices[corners[rng.integers(len(corners))]]
        way = rng.normal(size=3)
        way *= np.sign(place @ way if form == "box" else way[2]) / np.linalg.norm(way)
        at = place + 1.5 * made.reach * way
        for _ in range(6):  # from the outside to the mesh
            at = at - way * np.clip(triangles.distance(made.coal, turn, at, made.reach + 0.05), 0.0, 0.05)
        at = at - way * rng.uniform(-MARGIN, 0.5 * SHALLOW)
        pose = np.ascontiguousarray(np.vstack([turn, at]))
        still = motion_of((0.0, 0.0, 0.0))
        contacts = np.asarray(_core.find_contacts(made.core, [tile], pose, still, 0.0, MARGIN))
        found = float(contacts[:, 6].min(initial=np.inf))
        true = triangles.distance(made.coal, turn, at, made.reach + 0.05)
        if true > EXACT:
            apart += 1
            right = abs(found - true) <= EXACT or min(true, found) > MARGIN - EXACT
        else:
            true = triangles.distance(made.deep, turn, at, made.reach)
            shallow += true > -SHALLOW
            right = not -SHALLOW < true < -1e-4 or found < 0.0
        if not right:
            wrong.append((seed, true, found))
    assert not wrong
    assert apart > 10 and shallow > 5
