"""The case of a search: moving terrain, bodies, and the true ground for measurements."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from smartmesh_ros.ground.state import Vector
from smartmesh_ros.tools.evaluation.distance import Surface
from smartmesh_ros.tools.tune.events import Event, Start

# Tolerance of comparisons between times [s], because sums of steps have rounding errors.
SLACK = 1e-6


class Ground(NamedTuple):
    """The true surface of one tile at an instant: a surface without yaw, and its yaw [rad] around its origin."""

    surface: Surface
    yaw: float


class MapTopic(NamedTuple):
    """A topic with maps in a recording, its type, and ``taken_on``: the node's input topic for such maps."""

    name: str
    type_name: str
    taken_on: str


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
    parameters by name. ``notes``: messages to the user about the replay. ``map_topics``: topics of a recording's maps.
    """

    name: str
    title: str
    identity: str
    start: Mapping[str, Any]
    span: Span
    notes: Sequence[str] = ()
    map_topics: Sequence[MapTopic] = ()

    @abstractmethod
    def fresh(self) -> None:
        """Begin a run. Later arguments of the other methods start at time zero and never decrease within the run."""

    @abstractmethod
    def bodies(self) -> Sequence[Start]:
        """Return the simulated bodies of the start."""

    @abstractmethod
    def events(self, after: float, until: float) -> Sequence[Event]:
        """Return the events after one time and until another [s], in order of arrival."""

    @abstractmethod
    def truth(self, time: float) -> Sequence[Ground]:
        """Return the true ground at a time [s]."""

    @abstractmethod
    def forget(self, before: float) -> None:
        """Free data that only times before ``before`` [s] need."""

    @abstractmethod
    def reference(self) -> dict[str, Vector] | None:
        """Return positions by body [m] at the span's horizon, from a run at an eighth of the step; None = unknown."""
