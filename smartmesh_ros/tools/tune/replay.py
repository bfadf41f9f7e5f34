"""Replay of a case through the core in this process, in simulated time, with the node's order of inputs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence

from smartmesh_ros.errors import InputError
from smartmesh_ros.ground.limits import SIZES, require_between
from smartmesh_ros.node.inputs.joint_commands import joint_commands_from
from smartmesh_ros.node.inputs.map_taking import take_map
from smartmesh_ros.node.inputs.tracking import Tracking
from smartmesh_ros.node.parameters.settings import Settings
from smartmesh_ros.node.robot_names import RobotNames
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.tools.tune.events import BodiesCame, Event, JointsCame, MapCame, RegionCame, Start
from smartmesh_ros.world.world import World


class Replay:
    """One world with its bodies and inputs. Close it, or use it as a context manager.

    ``refused``: counts of refused events by reason. A refused event does not change the world.
    """

    def __init__(self, settings: Settings, bodies: Sequence[Start]) -> None:
        self.settings = settings
        self.world = World(config=settings.world)
        self.tracking = Tracking(self.world, settings.body_timeout, settings.max_velocity)
        self._names = RobotNames(self.world, always=settings.robot_prefix)
        self.refused: Counter[str] = Counter()
        self._waiting = list(bodies)
        self._spawn()

    def __enter__(self) -> Replay:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the world."""
        self.world.close()

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
        time = event.time(self.world.time)
        if isinstance(event, MapCame):
            if event.raster is None:
                self.world.terrain.remove(event.tile)
            else:
                take_map(
                    self.world.terrain,
                    self.settings,
                    event.tile,
                    event.raster,
                    event.velocities,
                    event.time(self.world.time),
                )
                self.world.terrain.tiles[event.tile].delay = event.delay
            self._spawn()
        elif isinstance(event, RegionCame):
            tile = self.world.terrain.tile(event.tile)
            if not isinstance(tile, HeightMap):
                raise InputError("unknown_tile", f"tile {event.tile!r} is a general mesh")
            tile.update_region(event.row, event.column, event.heights, time=time, velocities=event.velocities)
            tile.delay = event.delay
            self._spawn()
        elif isinstance(event, BodiesCame):
            self._track(event)
        elif isinstance(event, JointsCame):
            for robot, joint, command in joint_commands_from(event.message, self.world, self._names.prefixes()):
                self.world.command(robot, joint, command)

    def _track(self, event: BodiesCame) -> None:
        radii = [body.radius or self.settings.default_radius for body in event.bodies]
        for body, radius in zip(event.bodies, radii, strict=True):
            known = self.world.bodies.get(body.name)
            if known is not None and not known.tracked:
                raise InputError("duplicate_id", f"{body.name!r} is simulated; a tracked body needs another name")
            require_between(f"radius of {body.name!r}", radius, SIZES, "m")
        for body, radius in zip(event.bodies, radii, strict=True):
            time = event.time(self.world.time)
            self.tracking.update(body.name, radius, body.state, time, self.world.time, stated=body.stated)
        for name in event.gone:
            self.tracking.forget(name)

    def _spawn(self) -> None:
        """Spawn the waiting bodies that have ground below them."""
        waiting, self._waiting = self._waiting, []
        self._waiting = [start for start in waiting if not start(self.world)]
