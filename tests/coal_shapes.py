"""Shapes of the library coal."""

from typing import Any

import coal
import numpy as np


def vectors(points: np.ndarray) -> Any:
    made = coal.StdVec_Vec3s()
    for point in points:
        made.append(np.array(point))
    return made


def coal_hull(points: np.ndarray) -> Any:
    return coal.ConvexBase.convexHull(vectors(points), True, "Qt")


def coal_triangle(corners: np.ndarray) -> Any:
    triangles = coal.StdVec_Triangle()
    triangles.append(coal.Triangle(0, 1, 2))
    return coal.Convex(vectors(corners), triangles)
