"""The server of a page, which leaves it to its user to say where it is."""

from __future__ import annotations

import io
import logging
from contextlib import redirect_stdout
from typing import Any

import viser


def start_server(host: str, port: int, label: str | None = None) -> Any:
    """A viser server at a ``port``, 0 = any that is free."""
    # Browsers open connections that they then do not use.
    logging.getLogger("websockets.server").setLevel(logging.CRITICAL)
    with redirect_stdout(io.StringIO()):
        return viser.ViserServer(host=host, port=port, label=label, verbose=False)


def stop_server(server: Any) -> None:
    """Ends a server."""
    with redirect_stdout(io.StringIO()):
        server.stop()
