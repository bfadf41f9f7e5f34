"""The page: scene, controls and parameters of one node."""

from __future__ import annotations

import io
import logging
from asyncio import Protocol, get_running_loop, run, run_coroutine_threadsafe
from contextlib import redirect_stdout
from typing import Any

import viser

from smartmesh_ros.errors import InputError
from smartmesh_ros.tools.client.remote import OUTPUTS, Remote
from smartmesh_ros.tools.view.camera import Cameras
from smartmesh_ros.tools.view.knobs import KnobPanel
from smartmesh_ros.tools.view.panel import Panel
from smartmesh_ros.tools.view.scene import Scene


class Page:
    """Serves the page at ``url``, on ``host`` and ``port`` or the next free port. Raises `InputError` if ``host`` is
    not an address of this machine."""

    def __init__(self, remote: Remote, host: str, port: int) -> None:
        self._remote = remote
        self._server: Any = start_server(host, port, remote.name)
        self._server.gui.configure_theme(show_logo=False, show_share_button=False, control_width="medium")
        self.scene = Scene(self._server)
        self.cameras = Cameras(self._server)
        tabs = self._server.gui.add_tab_group()
        self._panel = Panel(self._server, remote, self.scene, self.cameras, tabs.add_tab("Node"))
        self._knobs = KnobPanel(self._server, remote, tabs.add_tab("Parameters"))
        self.url = url_of(host, self._server.get_port())

    def close(self) -> None:
        """Stop serving, without viser's own output."""
        with redirect_stdout(io.StringIO()):
            self._server.stop()

    def refresh(self) -> None:
        """Refresh the page. If no browser is connected, unsubscribe from the node's outputs instead."""
        # By the thread that sends to browsers, which sends nothing meanwhile: viser may fail if another one queues
        # messages while it sends.
        run_coroutine_threadsafe(self._refresh(), self._server.get_event_loop()).result()

    async def _refresh(self) -> None:
        remote = self._remote
        if not self._server.get_clients():
            remote.watch(set())
            remote.sight.poses.clear()  # a page that opens later waits for new poses
            return
        hidden = set() if self.scene.show_contacts else {"contacts"}
        remote.watch(OUTPUTS.keys() - hidden)
        remote.apply_waiting()
        self.scene.show(remote.ground, remote.sight)
        self._panel.update()
        self._knobs.update()
        self.cameras.update(remote.ground, remote.sight)


def url_of(host: str, port: int) -> str:
    """Return the address by which a browser on this machine finds a page."""
    shown = "localhost" if host in ("", "0.0.0.0", "::") else f"[{host}]" if ":" in host else host
    return f"http://{shown}:{port}"


def start_server(host: str, port: int, label: str | None = None) -> Any:
    """Start a viser server at a ``port``, 0 = any free port, without viser's own output. Raises `InputError`."""
    try:
        run(_listen(host))
    except (OSError, UnicodeError) as error:  # UnicodeError: no name, such as "a..b"
        words = "name an address of this machine, such as 127.0.0.1, or 0.0.0.0 for all"
        raise InputError("host", f"the page cannot listen on {host!r}: {error}; {words}") from None
    # Browsers open connections without using them, which websockets reports as errors.
    logging.getLogger("websockets.server").setLevel(logging.CRITICAL)
    with redirect_stdout(io.StringIO()):
        return viser.ViserServer(host=host, port=port, label=label, verbose=False)


async def _listen(host: str) -> None:
    """Listen once as viser does, which would wait forever where that fails."""
    (await get_running_loop().create_server(Protocol, host, 0)).close()
