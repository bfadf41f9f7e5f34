"""Ground straight above and below a solid, and the support of a solid whose middle is below the ground."""

from __future__ import annotations

import math

from smartmesh_ros.compiled import compiled
from smartmesh_ros.patches.contact_candidates import Candidates, Window, nearest_planes, surface_at
from smartmesh_ros.patches.facets import Point, height_of, plane_normal, scaled
from smartmesh_ros.patches.gaps import Gap
from smartmesh_ros.patches.solids import Solid, reach_along


@compiled
def candidate_below(window: Window, solid: Solid, candidates: Candidates) -> Candidates:
    """Return the cell straight below a solid that reaches no facet as its only candidate; unchanged over a hole."""
    z, _ = surface_at(window, solid.centre.x, solid.centre.y)
    if math.isnan(z):
        return candidates
    a, b = int(solid.centre.y / window.spacing), int(solid.centre.x / window.spacing)
    upper = 1 if solid.centre.y / window.spacing - a > solid.centre.x / window.spacing - b else 0
    return Candidates(1, a, a, b, b, a, b, upper, candidates.gap, candidates.margin)


@compiled
def is_buried(window: Window, solid: Solid) -> bool:
    """Return True if the middle of a solid is below the ground. A field would push the solid further down, because both
    sides of a field collide; a plane is thick and pushes the solid up."""
    z, _ = surface_at(window, solid.centre.x, solid.centre.y)
    return bool(z > solid.centre.z)


@compiled
def candidate_above(window: Window, solid: Solid, candidates: Candidates) -> Candidates:
    """Return the candidates of a buried solid, with the facet straight above its middle as the nearest, because the
    solid leaves the ground through this facet."""
    over = candidate_below(window, solid, candidates)
    plane, _ = nearest_planes(window, over)
    normal = plane_normal(plane)
    foot = Point(solid.centre.x, solid.centre.y, height_of(plane, solid.centre.x, solid.centre.y))
    depth = (foot.z - solid.centre.z) * normal.z
    gap = Gap(-depth - reach_along(solid, scaled(normal, -1.0)), normal, foot)
    return Candidates(
        candidates.facets,
        candidates.top,
        candidates.bottom,
        candidates.left,
        candidates.right,
        over.a,
        over.b,
        over.upper,
        gap,
        candidates.margin,
    )
