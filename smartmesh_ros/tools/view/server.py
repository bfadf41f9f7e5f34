"""The server of a page, without viser's own output."""

from __future__ import annotations

import io
import logging
from contextlib import redirect_stdout
from typing import Any

import viser


def start_server(host: str, port: int, label: str | None = None) -> Any:
    """Start a viser server at a ``port``; 0 = any free port."""
    # Browsers open connections without using them, which websockets reports as errors.
    logging.getLogger("websockets.server").setLevel(logging.CRITICAL)
    with redirect_stdout(io.StringIO()):
        return viser.ViserServer(host=host, port=port, label=label, verbose=False)


def stop_server(server: Any) -> None:
    """Stop a server."""
    with redirect_stdout(io.StringIO()):
        server.stop()
