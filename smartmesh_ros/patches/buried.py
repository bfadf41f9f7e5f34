"""Ground straight above and below a solid, and what a solid stands on whose middle is below the ground."""

from __future__ import annotations

import math

from smartmesh_ros.compiled import compiled
from smartmesh_ros.patches.facets import Gap, Point, Solid, height_of, plane_normal, reach_along
from smartmesh_ros.patches.touchable import Touch, Window, nearest_planes, surface_at


@compiled
def below(window: Window, solid: Solid, touch: Touch) -> Touch:
    """The cell straight below a solid that touches nothing, as what it can touch; nothing where there is a hole."""
    z, _ = surface_at(window, solid.centre.x, solid.centre.y)
    if math.isnan(z):
        return touch
    a, b = int(solid.centre.y / window.spacing), int(solid.centre.x / window.spacing)
    upper = 1 if solid.centre.y / window.spacing - a > solid.centre.x / window.spacing - b else 0
    return Touch(1, a, a, b, b, a, b, upper, touch.gap, touch.margin)


@compiled
def is_buried(window: Window, solid: Solid) -> bool:
    """Return True if the middle of a solid is below the ground. Both sides of a field collide, so that a field would
    push it further down; a plane is thick and pushes it up."""
    z, _ = surface_at(window, solid.centre.x, solid.centre.y)
    return bool(z > solid.centre.z)


@compiled
def lifted_by(window: Window, solid: Solid, touch: Touch) -> Touch:
    """What a buried solid can touch, with the facet over its middle as the nearest: it leaves the ground through it."""
    over = below(window, solid, touch)
    plane, _ = nearest_planes(window, over)
    normal = plane_normal(plane)
    foot = Point(solid.centre.x, solid.centre.y, height_of(plane, solid.centre.x, solid.centre.y))
    depth = (foot.z - solid.centre.z) * normal.z
    gap = Gap(-depth - reach_along(solid, normal), normal, foot)
    return Touch(
        touch.facets, touch.top, touch.bottom, touch.left, touch.right, over.a, over.b, over.upper, gap, touch.margin
    )
