"""The case of a search: moving terrain, bodies, and the true ground for measurements."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from smartmesh_ros.io.rasters import FloatGrid, Raster
from smartmesh_ros.node.inputs.conversions import BodyInput
from smartmesh_ros.tools.evaluation.distance import Surface
from smartmesh_ros.world.world import World

# Spawns a body; returns False if there is no ground below it yet.
Start = Callable[[World], bool]


@dataclass(frozen=True, kw_only=True, eq=False)
class Event:
    """An input that arrives at ``arrives`` [s] of simulated time and is valid for its stamp ``at`` [s]. Without a stamp
    (``stamped`` False) it is valid for the time of the step that applies it."""

    arrives: float
    at: float
    stamped: bool = True

    def time(self, now: float) -> float:
        """Return the time [s] for which the event is valid if it is applied at ``now`` [s]."""
        return self.at if self.stamped else now


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


class Ground(NamedTuple):
    """The true surface of one tile at an instant: a surface without yaw, and its yaw [rad] around its origin."""

    surface: Surface
    yaw: float = 0.0


# The true ground at a time [s]; from call to call the time never decreases.
Truth = Callable[[float], Sequence[Ground]]


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
    parameters by name. ``notes``: messages to the user about the replay. ``sources``: sentences about the topics of a
    recording's maps.
    """

    name: str
    title: str
    identity: str
    start: Mapping[str, Any]
    span: Span
    notes: Sequence[str] = ()
    sources: Sequence[str] = ()

    @abstractmethod
    def bodies(self) -> Sequence[Start]:
        """Return the simulated bodies of the start."""

    @abstractmethod
    def events(self) -> Iterator[Event]:
        """Return the events of a run, in order of arrival."""

    @abstractmethod
    def finest_events(self) -> Iterator[Event] | None:
        """Return the events of the reference run, in which maps follow the true ground; None = no reference."""

    @abstractmethod
    def truth(self) -> Truth:
        """Return the true ground for a run."""
