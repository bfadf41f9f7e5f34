"""Inputs of a recording or a scene, and their replay through the core in this process, in simulated time, with the
node's order of inputs."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from smartmesh_ros.errors import InputError
from smartmesh_ros.ground.limits import SIZES, require_between
from smartmesh_ros.io.rasters import FloatGrid, Raster
from smartmesh_ros.node.inputs.conversions import BodyInput, RobotNames, joint_commands_from
from smartmesh_ros.node.inputs.terrain_inputs import take_map
from smartmesh_ros.node.inputs.tracking import Tracking
from smartmesh_ros.node.parameters.settings import Settings
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.terrain import Terrain
from smartmesh_ros.world.world import World

# Spawns a body; returns False if there is no ground below it yet.
Start = Callable[[World], bool]
# Tolerance of comparisons between times [s], because sums of steps have rounding errors.
SLACK = 1e-6


@dataclass(frozen=True, kw_only=True, eq=False)
class Event:
    """An input that arrives at ``arrives`` [s] of simulated time and is valid for its stamp ``at`` [s], without a stamp
    for its arrival."""

    arrives: float
    at: float


@dataclass(frozen=True, kw_only=True, eq=False)
class Change(Event):
    """A change of a tile. ``delay`` [s]: see `HeightMap.delay`."""

    tile: str
    velocities: FloatGrid | None = None
    delay: float = 0.0


@dataclass(frozen=True, kw_only=True, eq=False)
class MapCame(Change):
    """A whole map; ``raster`` None = the tile is removed."""

    raster: Raster | None


@dataclass(frozen=True, kw_only=True, eq=False)
class RegionCame(Change):
    """New heights [m] of a rectangle."""

    row: int
    column: int
    heights: FloatGrid


@dataclass(frozen=True, kw_only=True, eq=False)
class BodiesCame(Event):
    """Dictated poses in the terrain's frame; ``gone``: bodies that are no longer in the message."""

    bodies: tuple[BodyInput, ...]
    gone: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True, eq=False)
class JointsCame(Event):
    """A command to robots' joints, as a sensor_msgs/JointState."""

    message: Any


class Replay:
    """One world with its bodies and inputs. Close it, or use it as a context manager.

    ``events``: in order of arrival. ``refused``: counts of refused events by reason. A refused event does not change
    the world.
    """

    def __init__(self, settings: Settings, bodies: Sequence[Start], events: Iterator[Event]) -> None:
        self.settings = settings
        self.world = World(config=settings.world)
        self.tracking = Tracking(self.world, settings.body_timeout, settings.max_velocity)
        self.refused: Counter[str] = Counter()
        self._names = RobotNames(self.world, always=settings.robot_prefix)
        self._events, self._next = events, next(events, None)
        self._waiting = list(bodies)
        self._spawn()

    def __enter__(self) -> Replay:
        return self

    def __exit__(self, *_: object) -> None:
        self.world.close()

    def due(self) -> list[Event]:
        """Return the events that have arrived since the last call."""
        found = []
        while self._next is not None and self._next.arrives <= self.world.time + SLACK:
            found.append(self._next)
            self._next = next(self._events, None)
        return found

    def step(self, events: Iterable[Event]) -> None:
        """Apply the events, then run one step."""
        for event in events:
            try:
                self._take(event)
            except InputError as error:
                self.refused[error.reason] += 1
        self.tracking.expire(self.world.time)
        self.world.step()

    def _take(self, event: Event) -> None:
        if isinstance(event, Change):
            change_terrain(self.world.terrain, self.settings, event)
            self._spawn()
        elif isinstance(event, BodiesCame):
            self._track(event)
        elif isinstance(event, JointsCame):
            lasts = self.settings.command_timeout or math.inf
            for robot, joint, command in joint_commands_from(event.message, self.world, self._names.prefixes()):
                self.world.command(robot, joint, command, lasts)

    def _track(self, event: BodiesCame) -> None:
        radii = [body.radius or self.settings.default_radius for body in event.bodies]
        for body, radius in zip(event.bodies, radii, strict=True):
            known = self.world.bodies.get(body.name)
            if known is not None and not known.tracked:
                raise InputError("duplicate_id", f"{body.name!r} is simulated; a tracked body needs another name")
            require_between(f"radius of {body.name!r}", radius, SIZES, "m")
        for body, radius in zip(event.bodies, radii, strict=True):
            self.tracking.update(body.name, radius, body.state, event.at, self.world.time, stated=body.stated)
        for name in event.gone:
            self.tracking.forget(name)

    def _spawn(self) -> None:
        """Spawn the waiting bodies that have ground below them."""
        waiting, self._waiting = self._waiting, []
        self._waiting = [start for start in waiting if not start(self.world)]


def change_terrain(terrain: Terrain, settings: Settings, change: Change) -> None:
    """Apply a change; raise `InputError` if the node would refuse it."""
    if isinstance(change, RegionCame):
        tile = terrain.tile(change.tile)
        if not isinstance(tile, HeightMap):
            raise InputError("unknown_tile", f"tile {change.tile!r} is a general mesh")
        tile.update_region(change.row, change.column, change.heights, time=change.at, velocities=change.velocities)
        tile.delay = change.delay
    elif isinstance(change, MapCame) and change.raster is not None:
        take_map(terrain, settings, change.tile, change.raster, change.velocities, change.at)
        terrain.tiles[change.tile].delay = change.delay
    else:
        terrain.remove(change.tile)
