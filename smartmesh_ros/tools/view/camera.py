"""Camera poses that show all bodies."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.tools.view.ground import Ground
from smartmesh_ros.tools.view.sight import Vector

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class CameraConfig:
    """Settings of the camera placement.

    ``bearing`` [rad]: direction from the bodies to the camera, from the x axis. ``elevations`` [rad]: angles above the
    horizon, tried in this order until the ground hides no body. ``spare``: margin at each edge, as a fraction of the
    picture's width and height. ``nearest`` [m]: minimum distance, so that a small body is shown with some ground
    around. ``far``: bodies further than this many median distances from the median position are ignored, because one
    body that fell off the terrain would make all others too small to see. ``samples``: points along a line of sight
    that are compared with the ground. ``halvings``: bisection steps in the search for the middle of the picture.
    """

    bearing: float = math.radians(-130.0)
    elevations: tuple[float, ...] = tuple(math.radians(angle) for angle in (32.0, 45.0, 60.0, 80.0))
    spare: float = 0.06
    nearest: float = 4.0
    far: float = 6.0
    samples: int = 64
    halvings: int = 30


CONFIG = CameraConfig()


class Lens(NamedTuple):
    """Geometry of a picture: ``field_of_view`` from bottom to top [rad], ``aspect``: width over height, ``covered``:
    fraction of the width that the panel at the right edge covers."""

    field_of_view: float
    aspect: float
    covered: float = 0.0


class Camera(NamedTuple):
    """Position of a camera and the point that it looks at [m]."""

    position: Vector
    target: Vector


def camera_on(positions: FloatArray, radii: FloatArray, lens: Lens, ground: Ground) -> Camera:
    """Return the nearest camera that shows bodies at (B, 3) [m] of ``radii`` (B,) [m].

    The elevation is the lowest at which the ground hides no body. If the ground hides bodies at every elevation, the
    elevation is the one with the fewest hidden bodies.
    """
    positions, radii = _without_outliers(positions, radii)
    best, hidden = None, len(positions) + 1
    for elevation in CONFIG.elevations:
        found = _fitted(positions, radii, lens, elevation)
        count = _hidden(found, positions, radii, ground)
        if count < hidden:
            best, hidden = found, count
        if not hidden:
            break
    assert best is not None
    return best


def _without_outliers(positions: FloatArray, radii: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return positions and radii without bodies that are far from all others."""
    away = np.linalg.norm(positions - np.median(positions, axis=0), axis=1)
    near = away <= CONFIG.far * max(float(np.median(away)), CONFIG.nearest)
    return (positions[near], radii[near]) if near.any() else (positions, radii)


def _fitted(positions: FloatArray, radii: FloatArray, lens: Lens, elevation: float) -> Camera:
    """Return the nearest camera at an ``elevation`` [rad] that shows all bodies."""
    level = math.cos(elevation)
    forward = -np.array([level * math.cos(CONFIG.bearing), level * math.sin(CONFIG.bearing), math.sin(elevation)])
    right, up, forward = _axes(forward)
    middle = positions.mean(axis=0)
    away = positions - middle
    across, above, along = away @ right, away @ up, away @ forward
    half = math.tan(0.5 * lens.field_of_view)
    edges = CONFIG.spare - 1.0, 1.0 - CONFIG.spare
    wide = (lens.aspect * half * edges[0], lens.aspect * half * (edges[1] - 2.0 * lens.covered))
    tall = (half * edges[0], half * edges[1])
    distance = max(_distance(across, along, radii, wide), _distance(above, along, radii, tall), CONFIG.nearest)
    shift = _shift(across, along, radii, wide, distance) * right + _shift(above, along, radii, tall, distance) * up
    position = middle + shift - distance * forward
    x, y, z = position.tolist()
    u, v, w = (position + distance * forward).tolist()
    return Camera((x, y, z), (u, v, w))


def _distance(across: FloatArray, along: FloatArray, radii: FloatArray, edges: tuple[float, float]) -> float:
    """Return the minimum distance d [m] of a camera from the middle of the bodies at which the bodies fit between two
    ``edges`` of the picture (tangents).

    A body ``along`` [m] behind the middle and ``across`` x [m] beside it fits for a camera shifted by s [m] if
    low (d + along) <= x - s - r and x - s + r <= high (d + along). At the minimum distance the bounds on s are equal.
    """
    low, high = edges
    needed = float((across + radii - high * along).max() - (across - radii - low * along).min())
    return max(needed / (high - low), float((radii - along).max()))


def _shift(
    across: FloatArray, along: FloatArray, radii: FloatArray, edges: tuple[float, float], distance: float
) -> float:
    """Return the shift [m] of a camera at a ``distance`` [m] with equal margins at both edges, by bisection between the
    bounds of `_distance`."""
    low, high = edges
    depth = np.maximum(distance + along, 1e-6)
    least = float((across + radii - high * depth).max())
    most = float((across - radii - low * depth).min())
    for _ in range(CONFIG.halvings):
        middle = 0.5 * (least + most)
        room = float(((across + radii - middle) / depth).max() + ((across - radii - middle) / depth).min())
        least, most = (middle, most) if room > low + high else (least, middle)
    return 0.5 * (least + most)


def _hidden(camera: Camera, positions: FloatArray, radii: FloatArray, ground: Ground) -> int:
    """Return the number of bodies whose tops the ground hides."""
    tops = positions + radii[:, None] * (0.0, 0.0, 1.0)
    share = np.linspace(0.0, 1.0, CONFIG.samples, endpoint=False)
    lines = np.asarray(camera.position) + share[None, :, None] * (tops - np.asarray(camera.position))[:, None, :]
    heights = ground.heights(lines[..., :2].reshape(-1, 2)).reshape(lines.shape[:2])
    return int((lines[..., 2] < heights).any(axis=1).sum())


def _axes(towards: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return unit vectors right, up and forward of an upright camera that looks ``towards`` a direction (3,)."""
    forward = towards / np.linalg.norm(towards)
    right = np.cross(forward, (0.0, 0.0, 1.0))
    right = right / np.linalg.norm(right)
    return right, np.cross(right, forward), forward
