"""Colours, and the meshes of shapes."""

from __future__ import annotations

import math
from enum import Enum
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray
from smartmesh_msgs.msg import BodyDescription

Colour = tuple[int, int, int]

GROUND: Colour = (196, 186, 168)
TRACKED: Colour = (150, 150, 158)
CONTACT: Colour = (214, 39, 40)
SELECTED: Colour = (255, 214, 10)
# Colours of bodies, by shape.
BODY_COLOURS: dict[int, Colour] = {
    BodyDescription.SPHERE: (52, 92, 168),
    BodyDescription.BOX: (139, 58, 120),
    BodyDescription.CYLINDER: (30, 116, 96),
    BodyDescription.CAPSULE: (120, 94, 40),
}
# Grey of sleeping bodies, and its share in their colour.
ASLEEP: Colour = (176, 176, 180)
GREYNESS = 0.65
# Faces around the circumference of a round body.
SECTIONS = 24


class PatchLook(Enum):
    """Entries of the patches' legend: words and colour."""

    FIELD_1 = ("heightfield, every sample", (240, 120, 20))
    FIELD_2 = ("heightfield, every 2nd", (245, 175, 40))
    FIELD_4 = ("heightfield, every 3rd or 4th", (250, 215, 90))
    FIELD_MORE = ("heightfield, coarser", (180, 205, 70))
    MESH = ("mesh", (222, 110, 180))

    @property
    def words(self) -> str:
        """Text in the legend."""
        return self.value[0]

    @property
    def colour(self) -> Colour:
        """Red, green and blue, 0 to 255."""
        return self.value[1]


def patch_look(kind: str, stride: int) -> PatchLook:
    """Return the look of a patch of a ``kind`` (as in `smartmesh_ros.tools.client.Patch`) at a ``stride`` [samples]."""
    if kind != "heightfield":
        return PatchLook.MESH
    if stride <= 2:
        return PatchLook.FIELD_1 if stride <= 1 else PatchLook.FIELD_2
    return PatchLook.FIELD_4 if stride <= 4 else PatchLook.FIELD_MORE


def shape_mesh(kind: int, dimensions: tuple[float, ...]) -> Any:
    """Return the mesh of a primitive shape of BodyDescription with its ``dimensions`` [m]. Not for robots."""
    make: Any = trimesh.creation
    if kind == BodyDescription.BOX:
        return make.box(dimensions)
    if kind == BodyDescription.CYLINDER:
        return make.cylinder(dimensions[0], dimensions[1], sections=SECTIONS)
    if kind == BodyDescription.CAPSULE:
        return make.capsule(dimensions[1], dimensions[0], count=(SECTIONS, SECTIONS))
    return make.uv_sphere(dimensions[0], count=(SECTIONS // 2, SECTIONS))


def greyed(colour: Colour) -> Colour:
    """Return the colour of a sleeping body."""
    r, g, b = (round((1.0 - GREYNESS) * own + GREYNESS * grey) for own, grey in zip(colour, ASLEEP, strict=True))
    return r, g, b


def with_edges(mesh: Any) -> Any:
    """Return a mesh with separate vertices on either side of each sharp edge, so that shading is not smoothed there."""
    return trimesh.graph.smooth_shade(mesh, angle=math.radians(40.0))


def radius_of(kind: int, dimensions: tuple[float, ...]) -> float:
    """Return the radius [m] of a shape's bounding sphere around its centre."""
    if kind == BodyDescription.BOX:
        return float(0.5 * np.linalg.norm(dimensions))
    if kind == BodyDescription.CYLINDER:
        return float(np.hypot(dimensions[0], 0.5 * dimensions[1]))
    return dimensions[0] + (0.5 * dimensions[1] if kind == BodyDescription.CAPSULE else 0.0)


def arrows(
    positions: NDArray[np.float64], normals: NDArray[np.float64], forces: NDArray[np.float64], length: float
) -> NDArray[np.float64]:
    """Return arrows (n, 2, 3) from contacts at ``positions`` (n, 3) [m] along ``normals`` (n, 3).

    The arrow of the largest of ``forces`` (n,) [N] is ``length`` [m] long. Lengths grow with the root of the force, so
    that small forces are visible too. Contacts without force have no arrow.
    """
    pressing = np.nan_to_num(forces) > 0.0
    positions, normals, forces = positions[pressing], normals[pressing], forces[pressing]
    longest = forces.max(initial=1e-9)
    return np.stack([positions, positions + (length * np.sqrt(forces / longest))[:, None] * normals], axis=1)


def ring() -> Any:
    """Return a ring of radius 1 around z, the mark of the selected body."""
    return trimesh.creation.torus(1.0, 0.05, major_sections=2 * SECTIONS, minor_sections=8)
