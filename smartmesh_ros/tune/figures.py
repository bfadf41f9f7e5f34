"""What a run costs and how true it is, and what is asked of both."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, fields, replace
from typing import Any

from smartmesh_ros.errors import InputError

# Penetration below this is taken as none [m]: PyBullet lets bodies at rest overlap by half of it.
FLOOR = 2e-5


@dataclass(frozen=True, kw_only=True)
class Figures:
    """One setting in one case.

    ``cost``: processor time of taking maps in, patches and steps, per simulated second [s], which is the share of a
    core at real time. ``longest``: processor time of the longest step, with what arrived before it [s]. ``penetration``
    and ``hover``: 99th percentiles [m], as the accuracy study has them. ``deviation``: median distance from the
    reference [m], NaN = none. ``lost``: bodies whose centre was below the ground, or that left everything;
    ``rescued``: times that bodies were put back onto the ground. ``ran`` [s] of simulated time; ``note``: why not
    longer.
    """

    cost: float = math.nan
    longest: float = math.nan
    penetration: float = math.nan
    hover: float = math.nan
    deviation: float = math.nan
    lost: int = 0
    rescued: int = 0
    bodies: int = 0
    ran: float = 0.0
    note: str = ""

    @property
    def error(self) -> float:
        """Penetration as the chart has it [m]; infinite where it was not measured."""
        return math.inf if math.isnan(self.penetration) or self.note else max(self.penetration, FLOOR)

    def as_json(self) -> dict[str, Any]:
        """The figures as JSON has them: what is not a number is left out."""
        return {name: value for name, value in asdict(self).items() if value == value}

    @classmethod
    def from_json(cls, values: dict[str, Any]) -> Figures:
        """The figures that `as_json` gave."""
        known = {field.name for field in fields(cls)}
        return cls(**{name: value for name, value in values.items() if name in known})


@dataclass(frozen=True, kw_only=True)
class Asked:
    """What the user asks for; None = nothing of this kind.

    ``budget``: share of a core. ``penetration``, ``hover``, ``deviation`` [m] and ``deadline`` [s] for the longest step
    are the most that is allowed.
    """

    budget: float | None = None
    penetration: float | None = None
    deadline: float | None = None
    hover: float | None = None
    deviation: float | None = None

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if value is not None and not (math.isfinite(value) and value > 0.0):
                raise InputError("budget", f"--{field.name} is {value:g}; it must be a number greater than zero")

    @property
    def words(self) -> str:
        """What is asked, in words."""
        said = {
            "budget": "{:g} of a core", "penetration": "{:g} m of penetration", "deadline": "{:g} s for a step",
            "hover": "{:g} m of hover", "deviation": "{:g} m of deviation",
        }  # fmt: skip
        given = [text.format(value) for name, text in said.items() if (value := getattr(self, name)) is not None]
        return ", ".join(f"at most {text}" for text in given) or "no more penetration than the defaults have"


@dataclass(frozen=True, kw_only=True)
class Allowance:
    """How much worse than the defaults' the figures may be that nobody asked about: factors, and what is always allowed
    [m]. Half the rate of steps doubles how far a body's way deviates."""

    factor: float = 2.0
    hover: float = 5e-4
    deviation: float = 5e-3


ALLOWANCE = Allowance()


@dataclass(frozen=True, kw_only=True)
class Limits:
    """The most that a setting may have of each figure, all of them numbers; infinite = anything."""

    cost: float = math.inf
    penetration: float = math.inf
    longest: float = math.inf
    hover: float = math.inf
    deviation: float = math.inf
    failed: int = 0

    @classmethod
    def of(cls, asked: Asked, defaults: Figures) -> Limits:
        """What is asked, and where nothing is, what the defaults allow."""

        def allowed(wanted: float | None, known: float, least: float) -> float:
            if wanted is not None:
                return wanted
            return math.inf if math.isnan(known) else max(ALLOWANCE.factor * known, least)

        free = asked.budget is None and asked.penetration is None and asked.deadline is None
        return cls(
            cost=asked.budget or math.inf,
            penetration=asked.penetration or (defaults.error if free else math.inf),
            longest=asked.deadline or math.inf,
            hover=allowed(asked.hover, defaults.hover, ALLOWANCE.hover),
            deviation=allowed(asked.deviation, defaults.deviation, ALLOWANCE.deviation),
            failed=defaults.lost + defaults.rescued,
        )

    def tightened(self, share: float) -> Limits:
        """The limits with only a share of each length and time allowed; the cost is kept, and so is what counts as no
        penetration."""
        return replace(
            self, penetration=max(share * self.penetration, FLOOR), longest=share * self.longest,
            hover=share * self.hover, deviation=share * self.deviation,
        )  # fmt: skip

    def excess(self, figures: Figures) -> dict[str, float]:
        """By how many times each limit is passed, less one; those that are kept are left out."""
        found = {
            "cost": figures.cost / self.cost,
            "penetration": figures.error / self.penetration if math.isfinite(self.penetration) else figures.error / 1e9,
            "longest": figures.longest / self.longest,
            "hover": figures.hover / self.hover,
            "deviation": 0.0 if math.isnan(figures.deviation) else figures.deviation / self.deviation,
            "failed": (1.0 + figures.lost + figures.rescued) / (1.0 + self.failed),
        }
        return {name: ratio - 1.0 if ratio > 1.0 else math.inf for name, ratio in found.items() if not ratio <= 1.0}
