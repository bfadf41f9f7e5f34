"""Transfer of a map to each engine, in the engine's own format, which is prepared before the measurement."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from studies.bench.moving import Waves, doubles


class Handing(NamedTuple):
    """``advance`` prepares the next frame, ``give`` transfers it."""

    advance: Callable[[], object]
    give: Callable[[], None]


def handing(name: str, engine: Any, waves: Waves) -> Handing:
    """Return the cheapest transfer of maps: float32 for this package, normalised heights for MuJoCo."""
    if name == "smartmesh":
        return Handing(waves.next, lambda: engine.set_ground(waves.now))
    if name == "mujoco":
        ready = waves.converted(engine.normalised)
        return Handing(ready.next, lambda: engine.write(ready.now))
    maps = waves.converted(doubles)
    return Handing(maps.next, lambda: engine.set_ground(maps.now))
