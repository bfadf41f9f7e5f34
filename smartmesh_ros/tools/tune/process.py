"""A process of a search that runs on several."""

from __future__ import annotations

import signal
from argparse import Namespace
from contextlib import suppress

from smartmesh_ros.startup.executables import silence_pybullet


def take_part(options: Namespace, index: int) -> None:
    """Measure trials of a prepared search, as process number ``index`` of it. PyBullet is silenced before measuring
    imports it. SIGTERM acts like Ctrl-C, which marks the open trial as failed."""
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    silence_pybullet()
    with suppress(KeyboardInterrupt):
        from smartmesh_ros.tools.tune.opening import open_search

        open_search(options, index).run(options.trials)
