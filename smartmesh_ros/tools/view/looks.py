"""Colours, and the meshes of shapes."""

from __future__ import annotations

import math
from enum import Enum
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray
from smartmesh_msgs.msg import BodyDescription

from smartmesh_ros.terrain.colours import Colour
from smartmesh_ros.terrain.grid import FloatArray

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


class Legend(Enum):
    """Entries with their ``words``, their ``colour``, and the ``least`` value that they stand for."""

    def __init__(self, words: str, colour: Colour, least: float) -> None:
        self.words, self.colour, self.least = words, colour, least


class PatchLook(Legend):
    """Entries of the patches' legend, those of maps by their least stride [samples]."""

    SAMPLES = "samples of a map", (240, 120, 20), 1
    FEWER = "fewer samples, under a large body", (250, 215, 90), 2
    MESH = "triangles of a mesh", (222, 110, 180), math.inf


def patch_look(kind: str, stride: float) -> PatchLook:
    """Return the look of a patch of a ``kind`` (as in `smartmesh_ros.tools.client.Patch`) at a ``stride`` [samples]."""
    stride = stride if kind == "heightfield" else math.inf
    return [look for look in PatchLook if look.least <= max(stride, 1)][-1]


def shape_mesh(kind: int, dimensions: tuple[float, ...]) -> Any:
    """Return the mesh of a primitive shape of BodyDescription with its ``dimensions`` [m]. Not for robots."""
    make: Any = trimesh.creation
    if kind == BodyDescription.BOX:
        return make.box(dimensions)
    if kind == BodyDescription.CYLINDER:
        return make.cylinder(height=dimensions[0], radius=dimensions[1], sections=SECTIONS)
    if kind == BodyDescription.CAPSULE:
        return make.capsule(height=dimensions[0], radius=dimensions[1], count=(SECTIONS, SECTIONS))
    return make.uv_sphere(dimensions[0], count=(SECTIONS // 2, SECTIONS))


def body_colours(kind: int, tracked: bool, asleep: list[bool]) -> NDArray[np.uint8]:
    """Return the colours (n, 3) of bodies of one kind; sleeping ones are greyed."""
    own = np.array(TRACKED if tracked else BODY_COLOURS.get(kind, TRACKED))
    grey = (1.0 - GREYNESS) * own + GREYNESS * np.array(ASLEEP)
    return np.rint(np.where(np.array(asleep)[:, None], grey, own)).astype(np.uint8)


def arrows(contacts: FloatArray, length: float) -> FloatArray:
    """Return arrows (n, 2, 3) [m] from ``contacts`` (m, 7), their positions [m], normals and forces [N].

    The arrow of the largest force is ``length`` [m] long. Lengths grow with the root of the force, so that small forces
    are visible too. Contacts without force have no arrow.
    """
    pressing = contacts[np.nan_to_num(contacts[:, 6]) > 0.0]
    starts, normals, forces = pressing[:, :3], pressing[:, 3:6], pressing[:, 6:]
    return np.stack([starts, starts + length * np.sqrt(forces / forces.max(initial=1e-9)) * normals], axis=1)
