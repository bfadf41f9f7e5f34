"""What a search is done on: terrain that moves, bodies, and the truth that they are measured against."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from smartmesh_ros.evaluation.distance import Surface
from smartmesh_ros.physics.state import Vector
from smartmesh_ros.tune.events import Event, Start

# What arrives within so much of a step still belongs to it [s]: a sum of steps is not quite what it stands for.
SLACK = 1e-6


class Ground(NamedTuple):
    """The true surface of one tile at an instant: a surface without yaw, and by how much it is turned about z [rad]
    around its origin."""

    surface: Surface
    yaw: float


class MapTopic(NamedTuple):
    """Where the maps of a recording were: a topic and its type, and ``taken_on``, the node's own topic for these."""

    name: str
    type_name: str
    taken_on: str


@dataclass(frozen=True, kw_only=True)
class Span:
    """How long the searching runs and the confirming ones are [s], and what is not measured at first [s]."""

    search: float
    confirm: float
    settle: float

    @property
    def horizon(self) -> float:
        """When bodies are compared with the reference [s]: later contacts make their ways chaotic."""
        return min(1.0, self.search)


class Case(ABC):
    """A scene or a recording.

    ``name``: short, for files. ``identity``: changes when anything changes that measurements depend on. ``start``: the
    parameters that are given, by name. ``notes``: what the user should know of how it is replayed. ``map_topics``: of a
    recording.
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
        """Begins a run: times that are asked for start at zero again, and never go back until the next call."""

    @abstractmethod
    def bodies(self) -> Sequence[Start]:
        """The simulated bodies of the start."""

    @abstractmethod
    def events(self, after: float, until: float) -> Sequence[Event]:
        """What arrives after one time and until another [s], in its order."""

    @abstractmethod
    def truth(self, time: float) -> Sequence[Ground]:
        """The ground as it is at a time [s], which must not go back within a run."""

    @abstractmethod
    def forget(self, before: float) -> None:
        """Frees what only times before [s] need."""

    @abstractmethod
    def reference(self) -> dict[str, Vector] | None:
        """Where bodies are at the span's horizon in a run at an eighth of the step, by name [m]; None = not known."""
