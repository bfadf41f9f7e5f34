"""How each engine is handed a map: in the form it keeps it in, which is made before anything is timed."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from studies.bench.moving import Waves, doubles


class Handing(NamedTuple):
    """``advance`` makes the next frame ready, ``give`` hands it over."""

    advance: Callable[[], object]
    give: Callable[[], None]


def handing(name: str, engine: Any, waves: Waves) -> Handing:
    """The least that handing over a map can cost: float32 for this package, heights in its range for MuJoCo."""
    if name == "smartmesh":
        return Handing(waves.next, lambda: engine.set_ground(waves.now))
    if name == "mujoco":
        ready = waves.converted(engine.normalised)
        return Handing(ready.next, lambda: engine.write(ready.now))
    maps = waves.converted(doubles)
    return Handing(maps.next, lambda: engine.set_ground(maps.now))
