"""Rows and columns of the stability matrix."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from studies.configurations import BARE
from studies.report.config import ReportConfig

# The report's colliders; None = contacts from the map.
Method = ReportConfig | None
Figure = Callable[[Method], float]

METHODS: dict[str, Method] = {
    "defaults": None,
    "heightfield": ReportConfig(kind="heightfield"),
    "rebuilt trimesh": ReportConfig(kind="trimesh", **BARE),
    "convex hull": ReportConfig(kind="hull", **BARE),
    "whole trimesh": ReportConfig(kind="whole_trimesh", **BARE),
    "whole heightfield": ReportConfig(kind="whole_heightfield", **BARE),
}


@dataclass(frozen=True)
class Row:
    """One test: ``figure`` of a method must not exceed ``limit`` [``unit``].

    ``source``: where the limit comes from. ``quick``: part of the quick run, and of the tests for the defaults.
    ``skip``: methods it makes no sense for, or that take too long.
    """

    name: str
    figure: Figure
    limit: float
    unit: str
    source: str
    quick: bool = False
    skip: tuple[str, ...] = ()


# A row for the defaults alone: the other methods are there for their colliders' sake.
own_row = partial(Row, skip=tuple(name for name in METHODS if name != "defaults"))


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """A cell: ``figure`` [``unit``], None = not run; infinite = lost or not reached."""

    row: str
    method: str
    figure: float | None
    limit: float
    unit: str
    source: str

    @property
    def passed(self) -> bool | None:
        """Return True if the figure is within the limit; None if there is no figure."""
        return None if self.figure is None else bool(self.figure <= self.limit)
