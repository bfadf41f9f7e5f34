"""The page: scene, controls and parameters of one node."""

from __future__ import annotations

from typing import Any

import numpy as np

from smartmesh_ros.view.knob_panel import KnobPanel
from smartmesh_ros.view.panel import Panel
from smartmesh_ros.view.remote import OF_ROBOTS, OUTPUTS, Remote
from smartmesh_ros.view.scene import Scene, bodies_of
from smartmesh_ros.view.server import start_server, stop_server

# Where a page looks from at first, in lengths of what there is to be seen.
FROM = np.array([-0.8, -1.0, 0.8])
# Nearer things are not drawn [m]: the nearer, the less the depth of far things is told apart.
NEAREST = 0.05


class Page:
    """Serves the page on ``host`` and ``port`` (the next free one where it is taken); ``url`` tells where."""

    def __init__(self, remote: Remote, host: str, port: int) -> None:
        self._remote = remote
        self._server: Any = start_server(host, port, remote.name)
        self._server.gui.configure_theme(show_logo=False, show_share_button=False, control_width="medium")
        self.scene = Scene(self._server)
        tabs = self._server.gui.add_tab_group()
        self._panel = Panel(self._server, remote, self.scene, tabs.add_tab("Node"))
        self._knobs = KnobPanel(self._server, remote, tabs.add_tab("Parameters"))
        self._looked = False
        self.url = f"http://{'localhost' if host == '0.0.0.0' else host}:{self._server.get_port()}"

    def close(self) -> None:
        """Stops serving."""
        stop_server(self._server)

    def refresh(self) -> None:
        """Brings the page up to date; without anybody who looks at it, there is nothing to do."""
        remote = self._remote
        if not self._server.get_clients():
            remote.watch(set())
            return
        remote.watch(self._wanted())
        remote.settle()
        self.scene.show(remote.ground, remote.sight)
        self._panel.update()
        self._knobs.update()
        if not self._looked and remote.sight.poses:
            self._looked = True
            self._look()

    def _wanted(self) -> set[str]:
        """The outputs that there is something to see of."""
        topics = set(OUTPUTS)
        if not self.scene.show_contacts:
            topics.discard("contacts")
        if not any(known.urdf for known in self._remote.sight.appearances.values()):
            topics -= OF_ROBOTS
        return topics

    def _look(self) -> None:
        """Turns the cameras to the bodies."""
        positions, radii = bodies_of(self._remote.sight)
        middle = np.median(positions, axis=0)
        size = max(float(np.percentile(np.linalg.norm(positions - middle, axis=1), 80)), 6.0 * float(np.max(radii)))
        camera = self._server.initial_camera
        camera.near, camera.position, camera.look_at = NEAREST, middle + size * FROM, middle
