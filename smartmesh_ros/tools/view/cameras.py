"""The cameras of the open pages: each is turned to the bodies once, and then left to its user."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from smartmesh_ros.tools.view.camera import Camera, Lens, camera_on
from smartmesh_ros.tools.view.ground import Ground
from smartmesh_ros.tools.view.sight import Sight

# Camera of pages that open before any body is known [m].
START = Camera((-6.3, -7.1, 6.9), (0.0, 0.0, 0.0))
# Near clipping distance [m]. Lower values reduce the depth resolution of distant objects.
NEAREST = 0.05
# Width of the panel and its margins [pixels].
PANEL = 340
# Positions closer together count as equal [m], because the page rounds to single precision.
SAME_POSITION = 1e-2


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
        camera = client.camera
        width, height = max(camera.image_width, 1), max(camera.image_height, 1)
        lens = Lens(camera.fov, width / height, PANEL / width if width > 2 * PANEL else 0.0)
        self._place(client, camera_on(*sight.bodies, lens, ground))

    def _place(self, client: Any, found: Camera) -> None:
        camera = client.camera
        camera.near = NEAREST
        camera.position, camera.look_at = np.array(found.position), np.array(found.target)
        self._start_with(found)

    def _start_with(self, found: Camera) -> None:
        """Make a camera the initial one of later pages, and of "reset view" on all pages."""
        self._given.append(found)
        start = self._server.initial_camera
        start.near, start.position, start.look_at = NEAREST, found.position, found.target
