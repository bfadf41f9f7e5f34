"""Pictures of what the view shows, by a browser without a window."""

from __future__ import annotations

import subprocess
import tempfile
from contextlib import suppress
from time import monotonic, sleep
from typing import Any, NamedTuple

import numpy as np
import viser
from numpy.typing import NDArray

from smartmesh_ros.view.browser import FLAGS
from smartmesh_ros.view.ground import Ground
from smartmesh_ros.view.scene import Scene
from smartmesh_ros.view.server import start_server, stop_server
from smartmesh_ros.view.sight import Sight

# A browser has so long to open the page, and to draw a picture without a graphics card [s].
PATIENCE = 60.0
SETTLING = 1.0


class Camera(NamedTuple):
    """Where a picture is taken from and what is in its middle [m], and how much it shows from bottom to top [rad]."""

    position: tuple[float, float, float]
    target: tuple[float, float, float]
    field_of_view: float


class Studio:
    """A page that only the browser ``path`` of this studio looks at, in pictures of ``size`` (width, height) pixels. A
    context manager."""

    def __init__(self, path: str, size: tuple[int, int]) -> None:
        self.size = size
        self._warm = False
        self._folder = tempfile.TemporaryDirectory()
        self.server: Any = start_server("127.0.0.1", 0)
        self.scene = Scene(self.server, fine=True)
        command = [
            path, "--headless", f"--user-data-dir={self._folder.name}", f"--window-size={size[0]},{size[1] + 200}",
            *FLAGS, f"http://127.0.0.1:{self.server.get_port()}",
        ]  # fmt: skip
        self._browser = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

    def __enter__(self) -> Studio:
        return self

    def __exit__(self, *_: object) -> None:
        self._browser.terminate()
        with suppress(subprocess.TimeoutExpired):
            self._browser.wait(10.0)
        self._browser.kill()
        stop_server(self.server)
        with suppress(OSError):  # the browser's own processes may still write
            self._folder.cleanup()

    def shoot(self, ground: Ground, sight: Sight, camera: Camera) -> NDArray[np.uint8]:
        """A picture (height, width, 3). Raises `TimeoutError` if the browser draws none."""
        self.scene.show(ground, sight)
        if not self._warm:
            # The browser reads meshes of robots while it draws.
            self._warm = True
            self.shoot(ground, sight, camera)
            sleep(SETTLING)
        width, height = self.size
        picture = self._client().get_render(
            height, width, position=camera.position, wxyz=wxyz_of(camera), fov=camera.field_of_view,
            transport_format="png", timeout=PATIENCE,
        )  # fmt: skip
        opaque = picture[..., 3:] / 255.0
        return np.asarray(np.rint(picture[..., :3] * opaque + 255.0 * (1.0 - opaque)), np.uint8)

    def _client(self) -> Any:
        end = monotonic() + PATIENCE
        while not (clients := self.server.get_clients()):
            if monotonic() > end or self._browser.poll() is not None:
                raise TimeoutError(f"the browser opened no page in {PATIENCE:.0f} s")
            sleep(0.05)
        return next(iter(clients.values()))


def places_in(camera: Camera, points: NDArray[np.float64], aspect: float) -> NDArray[np.float64]:
    """Where points (n, 3) [m] are in a picture (n, 2): 0 in its middle, -1 and 1 at its edges, right and up; beyond
    where they are behind the camera."""
    right, down, forward = _axes(camera)
    away = points - np.asarray(camera.position)
    depth = np.maximum(away @ forward, 1e-6) * np.tan(0.5 * camera.field_of_view)
    return np.stack([away @ right / (aspect * depth), -(away @ down) / depth], axis=1)


def wxyz_of(camera: Camera) -> tuple[float, float, float, float]:
    """The turn of a camera that looks at its target, upright: its z points there, and its y down."""
    w, x, y, z = viser.transforms.SO3.from_matrix(np.stack(_axes(camera), axis=1)).wxyz.tolist()
    return w, x, y, z


def _axes(camera: Camera) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Unit vectors to the right, down and forward."""
    forward = np.subtract(camera.target, camera.position)
    forward = forward / np.linalg.norm(forward)
    right = np.cross(forward, (0.0, 0.0, 1.0))
    right = right / np.linalg.norm(right)
    return right, np.cross(forward, right), forward
