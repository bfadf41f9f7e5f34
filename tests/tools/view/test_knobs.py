"""The tab of parameters beside a node that is killed and started again."""

from contextlib import closing, nullcontext
from types import SimpleNamespace
from typing import Any

import pytest
import rclpy

from smartmesh_ros.tools.testing import COLLIDER, Probe, Process

pytest.importorskip("viser", reason="viser is not installed; scripts/workspace run dev view")

from smartmesh_ros.tools.client.remote import Remote
from smartmesh_ros.tools.view.knobs import KnobPanel


class Gui:
    """What the panel needs of viser: widgets by their labels."""

    def __init__(self) -> None:
        self.gui, self.widgets = self, dict[str, Any]()

    def add_folder(self, *_: Any, **__: Any) -> Any:
        return nullcontext()

    def __getattr__(self, add_kind: str) -> Any:
        def add(label: str, initial_value: Any = None, **_: Any) -> Any:
            self.widgets[label] = SimpleNamespace(value=initial_value, on_update=lambda _: None)
            return self.widgets[label]

        return add


def test_the_page_shows_the_parameters_of_the_node_that_runs_now(probe: Probe) -> None:
    """Also where it was killed in the middle of an answer, and the page stayed open meanwhile."""
    rclpy.init()
    server = Gui()
    with closing(Remote(COLLIDER)) as remote:
        panel = KnobPanel(server, remote, nullcontext())

        def shown() -> Any:
            remote.spin(0.05)
            panel.update()
            return "rate" in server.widgets and server.widgets["rate"].value

        for rate in (100.0, 120.0):
            with Process("terrain_collider", {"physics.rate": rate}) as process:
                probe.wait_for(lambda rate=rate: shown() == rate, watch=process)
                process.process.kill()
    rclpy.try_shutdown()
