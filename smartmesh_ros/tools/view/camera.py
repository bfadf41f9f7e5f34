"""The cameras of the open pages: each is placed once so that it shows all bodies, and then left to its user."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.tools.client.ground import Ground
from smartmesh_ros.tools.client.sight import Sight

# Direction from the bodies to the camera, from the x axis [rad].
BEARING = math.radians(-130.0)
# Angles above the horizon, of which the first is taken at which the ground hides the fewest bodies [rad].
ELEVATIONS = tuple(math.radians(angle) for angle in (40.0, 50.0, 65.0, 80.0))
# Margin at each edge, as a fraction of the picture's width and height.
SPARE = 0.06
# Minimum distance [m], so that a small body is shown with some ground around.
CLOSEST = 4.0
# Bodies further than this many median distances from the median position are ignored, because a few that rolled away
# would make all others too small to see.
FAR = 1.5
# Near clipping distance [m]. Lower values reduce the depth resolution of distant objects.
NEAREST = 0.05
# Width of the panel and its margins [pixels].
PANEL = 340
# Positions closer together count as equal [m], because the page rounds to single precision.
SAME_POSITION = 1e-2


class Lens(NamedTuple):
    """Geometry of a picture: ``field_of_view`` from bottom to top [rad], ``aspect``: width over height, ``covered``:
    fraction of the width that the panel at the right edge covers."""

    field_of_view: float
    aspect: float
    covered: float = 0.0


class Camera(NamedTuple):
    """Position of a camera and the point that it looks at [m]."""

    position: FloatArray
    target: FloatArray


# Camera of pages that open before any body is known [m].
START = Camera(np.array([-6.3, -7.1, 6.9]), np.zeros(3))


def camera_on(positions: FloatArray, radii: FloatArray, lens: Lens, ground: Ground) -> Camera:
    """Return the nearest camera that shows bodies at (B, 3) [m] of ``radii`` (B,) [m]."""
    away = np.linalg.norm(positions - np.median(positions, axis=0), axis=1)
    near = away <= FAR * max(float(np.median(away)), CLOSEST)
    positions, radii = positions[near], radii[near]
    found = [_fitted(positions, radii, lens, elevation) for elevation in ELEVATIONS]
    return found[int(np.argmin([_hidden(camera, positions, radii, ground) for camera in found]))]


def _fitted(positions: FloatArray, radii: FloatArray, lens: Lens, elevation: float) -> Camera:
    """Return the nearest camera at an ``elevation`` [rad] that shows the ball around all bodies.

    Between two edges of the picture, ``low`` and ``high`` [rad] from the line of sight, a ball of radius R in the
    middle of both fits from a distance of R / sin((high - low) / 2).
    """
    b, e = BEARING, elevation
    forward = -np.array([math.cos(e) * math.cos(b), math.cos(e) * math.sin(b), math.sin(e)])
    right = np.array([-math.sin(b), math.cos(b), 0.0])
    middle = 0.5 * ((positions - radii[:, None]).min(axis=0) + (positions + radii[:, None]).max(axis=0))
    radius = float((np.linalg.norm(positions - middle, axis=1) + radii).max())
    tall, edge = math.tan(0.5 * lens.field_of_view), 1.0 - SPARE
    low, high = (math.atan(share * lens.aspect * tall) for share in (-edge, edge - 2.0 * lens.covered))
    beside = 0.5 * (low + high)
    distance = max(
        CLOSEST, radius / math.sin(math.atan(edge * tall)),
        math.cos(beside) * radius / math.sin(0.5 * (high - low)),
    )  # fmt: skip
    target = middle - distance * math.tan(beside) * right
    return Camera(target - distance * forward, target)


def _hidden(camera: Camera, positions: FloatArray, radii: FloatArray, ground: Ground) -> int:
    """Return the number of bodies whose tops the ground hides."""
    tops = positions + radii[:, None] * (0.0, 0.0, 1.0)
    towards = camera.position - tops
    lengths = np.linalg.norm(towards, axis=1)
    return int((ground.distances(tops, towards, float(lengths.max())) < lengths).sum())


class Cameras:
    """The cameras of a viser server's pages. `update` skips a page whose address contains a camera, or whose user has
    moved the camera."""

    def __init__(self, server: Any) -> None:
        self._server = server
        self._given: list[Camera] = []  # all initial cameras of pages
        self._done: set[int] = set()  # pages that were turned to the bodies
        self._start_with(START)

    def update(self, ground: Ground, sight: Sight) -> None:
        """Turn the cameras of new pages to the bodies once the poses of all simulated bodies are known."""
        described = {name for name, known in sight.appearances.items() if not known.tracked}
        if not sight.poses or not described <= sight.poses.keys():
            return
        for number, client in self._server.get_clients().items():
            # A page may report the browser's default camera before it applies its initial one. So a camera that seems
            # moved is checked again in the next update.
            moved = min(math.dist(client.camera.position, given.position) for given in self._given) > SAME_POSITION
            if number not in self._done and not moved:
                self._done.add(number)
                self._turn(client, ground, sight)

    def look(self, ground: Ground, sight: Sight) -> None:
        """Turn the cameras of all pages to the bodies."""
        for client in self._server.get_clients().values() if sight.poses else ():
            self._turn(client, ground, sight)

    def turn(self, found: Camera) -> None:
        """Set the cameras of all pages."""
        for client in self._server.get_clients().values():
            self._place(client, found)

    def _turn(self, client: Any, ground: Ground, sight: Sight) -> None:
        width, height = max(client.camera.image_width, 1), max(client.camera.image_height, 1)
        lens = Lens(client.camera.fov, width / height, PANEL / width if width > 2 * PANEL else 0.0)
        self._place(client, camera_on(*sight.bodies, lens, ground))

    def _place(self, client: Any, found: Camera) -> None:
        camera = client.camera
        camera.near, camera.position, camera.look_at = NEAREST, found.position, found.target
        self._start_with(found)

    def _start_with(self, found: Camera) -> None:
        """Make a camera the initial one of later pages, and of "reset view" on all pages."""
        self._given.append(found)
        start = self._server.initial_camera
        start.near, start.position, start.look_at = NEAREST, found.position, found.target
