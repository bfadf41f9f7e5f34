"""Meshes for tests: boxes, sheets, stairs and tables of one part or of several."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.terrain.trimesh import grid_triangles

Heights = Callable[[NDArray[np.float64], NDArray[np.float64]], NDArray[np.float64]]
Parts = tuple[NDArray[np.float64], NDArray[np.int64]]


def joined(*parts: Parts) -> Parts:
    """Return several parts as one mesh that shares no vertices between them."""
    starts = np.cumsum([0] + [len(vertices) for vertices, _ in parts[:-1]])
    return (
        np.concatenate([vertices for vertices, _ in parts]),
        np.concatenate([triangles + start for (_, triangles), start in zip(parts, starts, strict=True)]),
    )


def soup(part: Parts) -> Parts:
    """Return a mesh whose triangles share no vertices, as in an STL file."""
    vertices, triangles = part
    return vertices[triangles].reshape(-1, 3), np.arange(triangles.size).reshape(-1, 3)


def flipped(part: Parts) -> Parts:
    """Return a mesh with all triangles turned over."""
    return part[0], part[1][:, ::-1].copy()


def box(low: Sequence[float], high: Sequence[float]) -> Parts:
    """Return the closed surface of a box, counter-clockwise seen from outside."""
    corners = np.array([[x, y, z] for z in (low[2], high[2]) for y in (low[1], high[1]) for x in (low[0], high[0])])
    sides = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    triangles = np.array([t for a, b, c, d in sides for t in ((a, b, c), (a, c, d))])
    return corners.astype(np.float64), triangles


def sheet(size: float, cells: int, height: Heights | None = None) -> Parts:
    """Return a square open surface of ``size`` [m] around the origin, of cells x cells squares cut as height maps."""
    x, y = np.meshgrid(*[np.linspace(-size / 2, size / 2, cells + 1)] * 2)
    z = np.zeros_like(x) if height is None else height(x, y)
    return np.stack([x, y, z], -1).reshape(-1, 3), grid_triangles(cells + 1, cells + 1)


def stairs(steps: int, rise: float, tread: float) -> Parts:
    """Return one surface of treads and risers that goes up along x from the origin, 2 m wide, treads at rise * k."""
    profile = [(-tread, 0.0)]
    for k in range(steps):
        profile += [(tread * k, rise * k), (tread * k, rise * (k + 1))]
    profile.append((tread * steps, rise * steps))
    vertices = np.array([[x, y, z] for x, z in profile for y in (-1.0, 1.0)])
    triangles = [t for k in range(0, 2 * len(profile) - 2, 2) for t in ((k, k + 2, k + 3), (k, k + 3, k + 1))]
    return vertices, np.array(triangles)


def blocks(steps: int, rise: float, tread: float) -> Parts:
    """Return the same stairs as closed boxes side by side on the floor, of different widths."""
    return joined(
        *[
            box((tread * (k - 1), -1.0 - 0.1 * (k % 2), -0.1), (tread * k, 1.0 + 0.1 * (k % 2), rise * k))
            for k in range(steps + 1)
        ]
    )
