"""What is tuned: a scene or a bag, replayed with other parameters, and the true ground to measure against."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from operator import itemgetter
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.errors import InputError
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.tools.evaluation.distance import Surface
from smartmesh_ros.tools.evaluation.scene import FOLDER, Scene, read_scene
from smartmesh_ros.tools.messages import heightmap_message
from smartmesh_ros.tools.replay.bag import Bag
from smartmesh_ros.tools.replay.replay import Replay
from smartmesh_ros.world.world import World

# Longest replay of a bag if none is given [s].
LONGEST = 5.0


@dataclass(frozen=True, kw_only=True)
class Case:
    """A scene or a bag, to be run in any process. ``source``: a scene's file or a bag. ``parameters``: those that all
    runs have in common. ``length``, ``settle`` [s]: of a run, and of its beginning that is not measured."""

    source: Path
    title: str
    parameters: Mapping[str, Any] = field(default_factory=dict)
    remaps: Sequence[tuple[str, str]] = ()
    length: float
    settle: float

    def start(self, values: Mapping[str, Any]) -> tuple[Replay, SceneGround | RecordedGround]:
        """Return a replay with these parameters at its beginning, and its true ground; raise `InputError`."""
        parameters = {**self.parameters, **values}
        if self.source.suffix != ".yaml":
            return Replay(self.source, parameters, remap=self.remaps), RecordedGround()
        scene = read_scene(self.source)
        friction = {"physics.friction": scene.bodies.friction}
        replay = Replay(maps_of(scene), {**parameters, **friction}, remap=self.remaps)
        for number, state in enumerate(scene.starts()):
            replay.world.spawn(f"body_{number}", scene.bodies.make_shape(), 1.0, state)
        return replay, SceneGround(scene)


def open_case(
    source: str, parameters: Mapping[str, Any], remaps: Sequence[tuple[str, str]], seconds: float | None
) -> Case:
    """Return the case of a bag, a scene's file or a scene's name; raise `InputError` if there is none."""
    given, scene = Path(source), FOLDER / f"{source}.yaml"
    path = scene if scene.is_file() and not given.exists() else given
    if not path.exists():
        known = ", ".join(sorted(file.stem for file in FOLDER.glob("*.yaml")))
        raise InputError("source", f"there is no bag and no scene {source!r}; the scenes are {known}")
    common: dict[str, Any] = {"parameters": dict(parameters), "remaps": tuple(remaps)}
    if path.suffix == ".yaml" and path.name != "metadata.yaml":
        found = read_scene(path)
        length = seconds or found.duration
        return Case(source=path, title=found.title, length=length, settle=min(found.settle, 0.5 * length), **common)
    bag = Bag(path)
    probe = Case(source=bag.path, title=f"the bag {bag.path.resolve().name}", length=LONGEST, settle=0.0, **common)
    with probe.start({})[0] as replay:
        length = min(seconds or LONGEST, bag.end - replay.clock.start)
    if length < 0.1:
        raise bag.refusal("length", f"{length:.3g} s of messages for the node; record at least 0.1 s of maps")
    return replace(probe, length=length, settle=min(0.5, 0.25 * length))


def maps_of(scene: Scene) -> list[tuple[str, float, Any]]:
    """Return the maps of a scene at its rate; a single one at rate 0."""
    ground, found = scene.make_ground(), []
    count = math.ceil(scene.duration * scene.map_rate) + 1
    for time in [number / scene.map_rate for number in range(count)] if scene.moves else [0.0]:
        surface = scene.surface(np.array(ground.heights(time)), time)
        grid = surface.geometry
        message = heightmap_message(surface.heights, resolution=grid.resolution, origin=grid.origin)
        found.append(("heightmap", time, message))
    return found


class SceneGround:
    """The true ground of a scene."""

    def __init__(self, scene: Scene) -> None:
        self._scene, self._ground = scene, scene.make_ground()

    def note(self, world: World, *, measured: bool) -> None:
        """Do nothing: the ground is known at any time."""

    def at(self, time: float) -> list[Surface]:
        """Return the true surfaces at a time [s] of the run, which may be over and does not decrease."""
        scene = self._scene
        return [scene.surface(np.array(self._ground.heights(time if scene.moves else 0.0)), time)]


class RecordedGround:
    """The true ground of a bag: interpolated between the map before and the map after an instant. Where changes are
    corrections, it is the ground that the node shows, which approaches the corrected one over ``terrain.settle``."""

    def __init__(self) -> None:
        self._maps: dict[str, list[tuple[float, Surface]]] = defaultdict(list)  # by tile, in order of time [s]
        self._revisions: dict[str, int] = {}

    def note(self, world: World, *, measured: bool) -> None:
        """Look at the world after each step and message; ``measured``: at the instant of a snapshot."""
        tiles = {name: tile for name, tile in world.terrain.tiles.items() if isinstance(tile, HeightMap)}
        for name, tile in tiles.items():
            corrects = tile.motion.corrects
            if measured if corrects else self._revisions.get(name) != tile.revision:
                time, heights = (world.time, _shown(tile, world.time)) if corrects else (tile.time, tile.heights.copy())
                self._maps[name].append((time, Surface(tile.geometry, heights)))
                self._revisions[name] = tile.revision
        for name in self._revisions.keys() - tiles.keys():  # no ground from now on
            del self._revisions[name]
            _, last = self._maps[name][-1]
            nothing = Surface(last.geometry, np.full_like(last.heights, np.nan))
            self._maps[name] += [(world.time, last), (world.time, nothing)]

    def at(self, time: float) -> list[Surface]:
        """Return the surfaces at a time [s] of a run that is over."""
        return [_between(maps, time) for maps in self._maps.values() if maps[0][0] <= time]


def _between(maps: list[tuple[float, Surface]], time: float) -> Surface:
    after = bisect_right(maps, time, key=itemgetter(0))
    start, before = maps[after - 1]
    heights = before.heights.astype(np.float64)
    if after < len(maps) and maps[after][1].geometry == before.geometry:
        end, last = maps[after]
        heights += (time - start) / (end - start) * (last.heights - heights)
    return Surface(before.geometry, heights)


def _shown(tile: HeightMap, time: float) -> NDArray[np.float32]:
    geometry = tile.geometry
    indices = np.arange(geometry.size).reshape(geometry.rows, geometry.columns)
    return np.asarray(tile.sample(indices, time).heights - geometry.origin[2], np.float32)
