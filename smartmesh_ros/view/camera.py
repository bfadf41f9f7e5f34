"""Where a camera must stand to have bodies in sight."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.view.ground import Ground
from smartmesh_ros.view.sight import Vector

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class CameraConfig:
    """How cameras are placed.

    ``bearing`` [rad]: direction from the bodies to the camera, from the x axis. ``elevations`` [rad]: angles above the
    horizon that are tried in turn until the ground hides no body. ``spare``: share of the picture's width and height
    that stays free at each edge. ``nearest`` [m]: least distance, so that one small body is seen on some ground.
    ``far``: bodies further from the median position than so many median distances are left out; one that fell off the
    terrain would make all others too small to see. ``samples``: points along a line of sight that are compared with the
    ground. ``halvings``: of the interval in which the middle of the picture is searched.
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
    """What a picture takes in: ``field_of_view`` from bottom to top [rad], ``aspect``: width over height, ``covered``:
    share of the width that the panel at the right edge covers."""

    field_of_view: float
    aspect: float
    covered: float = 0.0


class Camera(NamedTuple):
    """Where a camera is and the point that it looks at [m]."""

    position: Vector
    target: Vector


def camera_on(positions: FloatArray, radii: FloatArray, lens: Lens, ground: Ground) -> Camera:
    """The camera that has bodies at (B, 3) [m] of ``radii`` (B,) [m] in sight, as near as possible. It looks from
    higher up where ground hides bodies, and from where it hides fewest if it always hides some."""
    positions, radii = _together(positions, radii)
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


def places_in(camera: Camera, points: FloatArray, lens: Lens) -> FloatArray:
    """Where points (n, 3) [m] are in a picture (n, 2): 0 in its middle, -1 and 1 at its edges, right and up. Points
    behind the camera are far outside."""
    right, up, forward = _axes(np.subtract(camera.target, camera.position))
    away = points - np.asarray(camera.position)
    depth = np.maximum(away @ forward, 1e-6) * math.tan(0.5 * lens.field_of_view)
    return np.stack([away @ right / (lens.aspect * depth), away @ up / depth], axis=1)


def _together(positions: FloatArray, radii: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The bodies without those that are far from all others."""
    away = np.linalg.norm(positions - np.median(positions, axis=0), axis=1)
    near = away <= CONFIG.far * max(float(np.median(away)), CONFIG.nearest)
    return (positions[near], radii[near]) if near.any() else (positions, radii)


def _fitted(positions: FloatArray, radii: FloatArray, lens: Lens, elevation: float) -> Camera:
    """The nearest camera at an ``elevation`` [rad] whose picture holds all bodies."""
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
    """Least distance [m] of a camera from the middle of the bodies at which these fit between two ``edges`` of the
    picture (tangents). A body ``along`` [m] behind the middle is at x = ``across`` [m] and fits for a camera shifted by
    s [m] if low (d + along) <= x - s - r and x - s + r <= high (d + along). The bounds of s meet at the distance."""
    low, high = edges
    needed = float((across + radii - high * along).max() - (across - radii - low * along).min())
    return max(needed / (high - low), float((radii - along).max()))


def _shift(
    across: FloatArray, along: FloatArray, radii: FloatArray, edges: tuple[float, float], distance: float
) -> float:
    """Shift [m] of a camera at a ``distance`` [m] whose picture has as much room at one edge as at the other, by
    bisection between the bounds of `_distance`."""
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
    """How many bodies' tops the ground hides."""
    tops = positions + radii[:, None] * (0.0, 0.0, 1.0)
    share = np.linspace(0.0, 1.0, CONFIG.samples, endpoint=False)
    lines = np.asarray(camera.position) + share[None, :, None] * (tops - np.asarray(camera.position))[:, None, :]
    heights = ground.heights(lines[..., :2].reshape(-1, 2)).reshape(lines.shape[:2])
    return int((lines[..., 2] < heights).any(axis=1).sum())


def _axes(towards: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Unit vectors to the right, up and forward of a camera that looks ``towards`` a direction (3,), upright."""
    forward = towards / np.linalg.norm(towards)
    right = np.cross(forward, (0.0, 0.0, 1.0))
    right = right / np.linalg.norm(right)
    return right, np.cross(right, forward), forward
