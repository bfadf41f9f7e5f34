"""Height scans of the bodies of a world, and their delay."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import replace

from smartmesh_ros.errors import require
from smartmesh_ros.ground.bullet import undone
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.terrain.height_scan import HeightScan, require_scan
from smartmesh_ros.world.world import ROUNDING, World


class HeightScanner:
    """Scans of bodies of a world by the settings ``scan``, which are known ``scan.delay`` [s] after they were measured:
    they show the ground and the poses as they were then."""

    def __init__(self, world: World, names: str | Sequence[str], scan: HeightScan) -> None:
        require(isinstance(world, World), "height_scan", "the world of a height scanner", world, "a World")
        require_scan(scan)
        self._world, self._names, self._scan = world, names, replace(scan, delay=0.0)
        self._delay = scan.delay
        self._waiting: deque[tuple[float, FloatArray]] = deque()
        self._last: FloatArray | None = None

    def measure(self) -> None:
        """Scan now. Raises `InputError`, and forgets, if there is no body of one of the names."""
        world = self._world
        if self._waiting and self._waiting[-1][0] > world.time:  # the world's time was reset
            self.forget()
        with undone(self.forget):  # a body that comes back under the name of one that went is another one
            self._waiting.append((world.time, world.height_scan(self._names, self._scan)))

    def take(self) -> FloatArray | None:
        """Return the newest values (n, k) that are known by now and were not returned before; None: there are none."""
        found = None
        now = self._world.time - self._delay + ROUNDING * self._world.dt
        while self._waiting and self._waiting[0][0] <= now:
            found = self._waiting.popleft()[1]
        return found

    def forget(self) -> None:
        """Forget what was measured."""
        self._waiting.clear()
        self._last = None

    def read(self) -> FloatArray:
        """Scan now, and return the newest values (n, k) that are known by now; the first ones at the beginning."""
        self.measure()
        found = self.take()
        self._last = found if found is not None else self._waiting[0][1] if self._last is None else self._last
        return self._last
