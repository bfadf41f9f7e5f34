"""The case of a search: moving terrain, bodies, and the true ground for measurements; and that of a scene."""

from __future__ import annotations

import hashlib
import heapq
import math
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


@dataclass(frozen=True, kw_only=True)
class Case:
    """A scene or a recording.

    ``name``: short name for files. ``identity``: digest of everything that measurements depend on. ``start``: given
    parameters by name. ``bodies``: the simulated bodies of the start. ``events``: makes the events of a run, as they
    arrive. ``truth``: makes the true ground for a run. ``finest`` [Hz]: rate of the reference's maps, which follow the
    true ground; 0 = its maps are those of any run, None = there is no reference. ``notes``: messages to the user about
    the replay. ``sources``: sentences about the topics of a recording's maps.
    """

    name: str
    title: str
    identity: str
    start: Mapping[str, Any]
    span: Span
    bodies: Sequence[Start]
    events: Callable[[], Iterator[Event]]
    truth: Callable[[], Truth]
    finest: float | None
    notes: Sequence[str] = ()
    sources: Sequence[str] = ()


def scene_case(scene: Scene, given: Mapping[str, Any]) -> Case:
    """Return a scene with its own rate of maps and initial states of bodies."""

    def truth() -> Truth:
        ground = scene.make_ground()
        return lambda time: {"": scene.surface(np.array(ground.heights(time if scene.moves else 0.0)), time)}

    def spawn(name: str, state: BodyState, world: World) -> bool:
        world.spawn(name, scene.bodies.make_shape(), 1.0, state)
        return True

    start = {**given, "physics.friction": scene.bodies.friction}
    span = Span(search=scene.duration, confirm=LONGER * scene.duration, settle=scene.settle)
    return Case(
        name=scene.name, title=scene.title, start=start, span=span,
        identity=hashlib.sha256(f"{scene!r} {sorted(start.items())!r}".encode()).hexdigest()[:12],
        bodies=[partial(spawn, f"body_{index}", state) for index, state in enumerate(scene.starts())],
        events=lambda: maps_of(truth(), scene.map_rate, span.confirm), truth=truth,
        finest=None if scene.reference == "none" else FINE_RATE * scene.moves,
    )  # fmt: skip


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
    with Replay(settings_of({**case.start, **FINEST}), case.bodies, events) as replay:
        for _ in range(round(case.span.horizon * FINE_RATE)):
            replay.step(replay.due())
        world = replay.world
        return {name: world.state(name).position for name, body in world.bodies.items() if not body.tracked}
