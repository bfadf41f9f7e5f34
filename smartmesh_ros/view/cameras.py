"""The cameras of the open pages: each looks at the bodies at first, and then where its user turns it."""

from __future__ import annotations

import math
from time import monotonic
from typing import Any

import numpy as np

from smartmesh_ros.view.camera import Camera, Lens, camera_on
from smartmesh_ros.view.ground import Ground
from smartmesh_ros.view.scene import bodies_of
from smartmesh_ros.view.sight import Sight

# Before anything is known, pages look from here to the origin [m].
START = Camera((-6.3, -7.1, 6.9), (0.0, 0.0, 0.0))
# Nothing nearer is drawn [m]. Smaller values resolve the depth of far things less finely.
NEAREST = 0.05
# A page that was opened so long ago [s] does not wait for bodies that are described but have no pose.
PATIENCE = 2.0
# Width of the panel and its margins [pixels].
PANEL = 340
# Positions nearer than this are the same [m]: the page rounds to single precision.
SAME = 1e-2


class Cameras:
    """The cameras of a viser server's pages. A page whose address names a camera, or whose user has moved it, is left
    alone."""

    def __init__(self, server: Any) -> None:
        self._server = server
        self._given = [START]  # every camera that pages have started with
        self._since: dict[int, float] = {}  # when pages were opened [s]
        self._done: set[int] = set()  # pages that looked at the bodies once
        self._start_with(START)

    def update(self, ground: Ground, sight: Sight) -> None:
        """Turns the cameras of new pages to the bodies, as soon as the poses of all of them are known."""
        clients = self._server.get_clients()
        self._done &= clients.keys()
        self._since = {number: self._since.get(number, monotonic()) for number in clients}
        for number, client in clients.items():
            if number in self._done:
                continue
            known = bool(sight.poses) and sight.appearances.keys() <= sight.poses.keys()
            late = monotonic() > self._since[number] + PATIENCE
            # A page may tell of the browser's own camera before it takes the one that it is given, so that is no reason
            # to leave the page alone for good.
            if (known or (late and sight.poses)) and self._is_unmoved(client):
                self._done.add(number)
                self._turn(client, ground, sight)

    def look(self, ground: Ground, sight: Sight) -> None:
        """Turns the cameras of all pages to the bodies."""
        for client in self._server.get_clients().values() if sight.poses else ():
            self._turn(client, ground, sight)

    def turn(self, found: Camera) -> None:
        """Turns the cameras of all pages to a place."""
        for client in self._server.get_clients().values():
            self._place(client, found)

    def _is_unmoved(self, client: Any) -> bool:
        return any(math.dist(client.camera.position, given.position) < SAME for given in self._given)

    def _turn(self, client: Any, ground: Ground, sight: Sight) -> None:
        camera = client.camera
        width, height = max(camera.image_width, 1), max(camera.image_height, 1)
        lens = Lens(camera.fov, width / height, PANEL / width if width > 2 * PANEL else 0.0)
        self._place(client, camera_on(*bodies_of(sight), lens, ground))

    def _place(self, client: Any, found: Camera) -> None:
        camera = client.camera
        camera.near = NEAREST
        camera.position = np.array(found.position)
        camera.look_at = np.array(found.target)
        self._start_with(found)

    def _start_with(self, found: Camera) -> None:
        """Has later pages, and "reset view" of all, start with a camera."""
        self._given.append(found)
        start = self._server.initial_camera
        start.near, start.position, start.look_at = NEAREST, found.position, found.target
