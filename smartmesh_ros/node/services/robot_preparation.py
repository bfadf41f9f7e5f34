"""Robots are prepared in a thread, while the physics steps."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

from smartmesh_ros.node.services.turns import Waiting
from smartmesh_ros.world.robots.prepared import PreparedRobot, prepare_robot
from smartmesh_ros.world.robots.workshop import WORKSHOP


class RobotPreparation:
    """Prepares robots one after another."""

    def __init__(self) -> None:
        self._threads = ThreadPoolExecutor(max_workers=1, thread_name_prefix="robots")

    async def prepared(self, urdf: Callable[[], str]) -> PreparedRobot:
        """Return the robot of the text or path that ``urdf`` returns in the thread. Raises `InputError`."""
        future = self._threads.submit(lambda: prepare_robot(urdf()))
        while not future.done():
            await Waiting()
        return future.result()

    def close(self) -> None:
        """Give up all work."""
        self._threads.shutdown(wait=False, cancel_futures=True)
        WORKSHOP.close()
