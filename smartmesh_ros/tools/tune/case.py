"""The case of a search: moving terrain, bodies, and the true ground for measurements; and that of a scene."""

from __future__ import annotations

import hashlib
import heapq
import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from smartmesh_ros.ground.state import BodyState, Vector
from smartmesh_ros.io.rasters import Raster
from smartmesh_ros.tools.evaluation.distance import Surface
from smartmesh_ros.tools.evaluation.scene import Scene
from smartmesh_ros.tools.tune.replay import Change, Event, MapCame, Replay, Start
from smartmesh_ros.tools.tune.start import settings_of
from smartmesh_ros.world.world import World

# The true surfaces of all tiles by name at a time [s]; from call to call the time never decreases.
Truth = Callable[[float], Mapping[str, Surface]]
# Rate of the reference run [Hz]: eight times the default.
FINE_RATE = 8 * 240.0
FINEST: Mapping[str, Any] = {
    "physics.rate": FINE_RATE,
    "patch.kind": "auto",
    "patch.rate": 0.0,
    "terrain.motion": "extrapolate",
    "terrain.min_interval": 0.0,  # maps come with every step, and each gives a velocity of its own
}
# Length of a confirming run, in searching runs.
LONGER = 2.0


@dataclass(frozen=True, kw_only=True)
class Span:
    """Lengths [s] of searching and confirming runs, and of their beginning that is not measured."""

    search: float
    confirm: float
    settle: float

    @property
    def horizon(self) -> float:
        """Time at which bodies are compared with the reference [s]. Later their motion is chaotic because of
        contacts."""
        return min(1.0, self.search)


class Case(ABC):
    """A scene or a recording.

    ``name``: short name for files. ``identity``: digest of everything that measurements depend on. ``start``: given
    parameters by name. ``finest`` [Hz]: rate of the reference's maps, which follow the true ground; 0 = its maps are
    those of any run, None = there is no reference. ``notes``: messages to the user about the replay. ``sources``:
    sentences about the topics of a recording's maps.
    """

    name: str
    title: str
    identity: str
    start: Mapping[str, Any]
    span: Span
    finest: float | None
    notes: Sequence[str] = ()
    sources: Sequence[str] = ()

    @abstractmethod
    def bodies(self) -> Sequence[Start]:
        """Return the simulated bodies of the start."""

    @abstractmethod
    def events(self) -> Iterator[Event]:
        """Return the events of a run, in order of arrival."""

    @abstractmethod
    def truth(self) -> Truth:
        """Return the true ground for a run."""


class SceneCase(Case):
    """A scene with its own rate of maps and initial states of bodies."""

    def __init__(self, scene: Scene, start: Mapping[str, Any]) -> None:
        self.name, self.title = scene.name, scene.title
        self.start = {**start, "physics.friction": scene.bodies.friction}
        self.identity = hashlib.sha256(f"{scene!r} {sorted(self.start.items())!r}".encode()).hexdigest()[:12]
        self.span = Span(search=scene.duration, confirm=LONGER * scene.duration, settle=scene.settle)
        self.finest = None if scene.reference == "none" else FINE_RATE * scene.moves
        self._scene = scene
        self._states = scene.starts()

    def bodies(self) -> Sequence[Start]:
        return [partial(self._spawn, f"body_{index}", state) for index, state in enumerate(self._states)]

    def events(self) -> Iterator[Event]:
        return maps_of(self.truth(), self._scene.map_rate, self.span.confirm)

    def truth(self) -> Truth:
        scene, ground = self._scene, self._scene.make_ground()
        return lambda time: {"": scene.surface(np.array(ground.heights(time if scene.moves else 0.0)), time)}

    def _spawn(self, name: str, state: BodyState, world: World) -> bool:
        world.spawn(name, self._scene.bodies.make_shape(), 1.0, state)
        return True


def maps_of(truth: Truth, rate: float, duration: float) -> Iterator[Event]:
    """Yield maps of the true ground at a ``rate`` [Hz] for ``duration`` [s]; a single one at rate 0."""
    for time in (number / rate for number in range(math.ceil(duration * rate) + 1)) if rate else (0.0,):
        for tile, surface in truth(time).items():
            raster = Raster(surface.geometry, surface.heights.astype(np.float32))
            yield MapCame(arrives=time, at=time, tile=tile, raster=raster)


def reference(case: Case) -> dict[str, Vector] | None:
    """Return positions by simulated body [m] at the span's horizon, from a run at an eighth of the step with patches
    that are refreshed in every step; None = unknown."""
    if case.finest is None:
        return None
    events = case.events()
    if case.finest:
        maps = maps_of(case.truth(), case.finest, case.span.horizon)
        others = (event for event in events if not isinstance(event, Change))
        events = heapq.merge(maps, others, key=lambda event: event.arrives)
    with Replay(settings_of({**case.start, **FINEST}), case.bodies(), events) as replay:
        for _ in range(round(case.span.horizon * FINE_RATE)):
            replay.step(replay.due())
        world = replay.world
        return {name: world.state(name).position for name, body in world.bodies.items() if not body.tracked}
