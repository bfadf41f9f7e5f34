"""Fixtures of the tests of the view."""

from collections.abc import Iterator
from contextlib import closing
from typing import Any

import pytest
import rclpy

from smartmesh_ros.tools.client.remote import Remote
from smartmesh_ros.tools.testing import COLLIDER


@pytest.fixture
def remote(domain: int) -> Iterator[Remote]:
    """What a view knows of the node."""
    rclpy.init()
    with closing(Remote(COLLIDER)) as made:
        yield made
    rclpy.try_shutdown()


@pytest.fixture
def server() -> Iterator[Any]:
    """A viser server without a browser."""
    pytest.importorskip("viser", reason="viser is not installed; scripts/workspace run dev view")
    from smartmesh_ros.tools.view.page import start_server

    made = start_server("127.0.0.1", 0)
    yield made
    made.stop()


@pytest.fixture
def drawn(server: Any) -> dict[str, Any]:
    """What the server's scene shows, by path."""
    handles: dict[str, Any] = server.scene._handle_from_node_name
    return handles
