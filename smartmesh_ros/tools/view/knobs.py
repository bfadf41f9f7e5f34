"""The kind and bounds of the page's widget for each parameter, from the node's descriptions."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum
from typing import Any

import yaml
from rcl_interfaces.msg import ParameterDescriptor
from rclpy.parameter import Parameter

from smartmesh_ros.errors import InputError

# Prefix of a description's constraints that list choices.
CHOICES = "one of "
# Widest range of a slider, in multiples of the value, and minimum number of steps of a slider.
MAX_RELATIVE_RANGE = 100.0
SLIDER_STEPS = 200


class Kind(Enum):
    """Kind of widget of a parameter, as viser calls it."""

    SWITCH = "checkbox"
    CHOICE = "dropdown"
    SLIDER = "slider"
    NUMBER = "number"
    TEXT = "text"


@dataclass(frozen=True, kw_only=True)
class Knob:
    """A parameter that may change: ``name``, description (``hint``), present ``value``, and its range ``low`` to
    ``high`` in steps of ``step``, or its ``choices``. Lists are YAML texts."""

    name: str
    kind: Kind
    hint: str
    value: Any
    low: float | int | None = None
    high: float | int | None = None
    step: float | int | None = None
    choices: tuple[str, ...] = ()

    def add_to(self, gui: Any) -> Any:
        """Add the widget to the page; return its handle."""
        options: dict[str, Any] = {"options": self.choices} if self.choices else {}
        if self.kind in (Kind.SLIDER, Kind.NUMBER):
            options = {"min": self.low, "max": self.high, "step": self.step}
        add = getattr(gui, f"add_{self.kind.value}")
        return add(self.name.partition(".")[2] or self.name, initial_value=self.value, hint=self.hint, **options)


def knob_of(descriptor: ParameterDescriptor, value: Any) -> Knob | None:
    """Return the knob of a parameter; None if the parameter is read-only, unset, or has no description."""
    if descriptor.read_only or not descriptor.description or value is None:
        return None
    if isinstance(value, int | float) and not isinstance(value, bool):
        return _number(descriptor, value)
    words, hint, kind = descriptor.additional_constraints, descriptor.description, Kind.TEXT
    choices: tuple[str, ...] = ()
    if isinstance(value, bool):
        kind = Kind.SWITCH
    elif not isinstance(value, str):
        hint += f" ({words})" if words else ""
    elif words.startswith(CHOICES) and value in (found := words.removeprefix(CHOICES).split(", ")):
        kind, choices = Kind.CHOICE, tuple(found)
    return Knob(name=descriptor.name, kind=kind, hint=hint, value=shown_value(value), choices=choices)


def parameter_of(knob: Knob, given: Any) -> Parameter:
    """Return the parameter with the value that the page's user gave. Raise `InputError` if a list's text is no list."""
    if knob.kind is Kind.TEXT and knob.value.startswith("["):
        try:
            given = yaml.safe_load(given)
        except yaml.YAMLError:
            given = None
        if not isinstance(given, list):
            raise InputError("parameter", f"{knob.name} must be a list, such as {knob.value}")
        given = [float(item) if isinstance(item, int) and not isinstance(item, bool) else item for item in given]
    return Parameter(knob.name, value=given)


def shown_value(value: Any) -> Any:
    """Return a parameter's value as its widget shows it: lists as YAML, in one line."""
    if isinstance(value, bool | int | float | str):
        return value
    return str(yaml.safe_dump(list(value), default_flow_style=True, width=math.inf)).strip()


def _number(descriptor: ParameterDescriptor, value: float) -> Knob:
    whole = isinstance(value, int)
    ranges = descriptor.integer_range if whole else descriptor.floating_point_range
    if not ranges:
        return Knob(name=descriptor.name, kind=Kind.NUMBER, hint=descriptor.description, value=value)
    low, high = ranges[0].from_value, ranges[0].to_value
    hint = f"{descriptor.description} {low:g} to {high:g}."
    step: float | int = 1 if whole else nice_step(value, low, high)
    fits = high - low <= (SLIDER_STEPS if whole and not value else MAX_RELATIVE_RANGE * abs(value))
    kind = Kind.SLIDER if fits else Kind.NUMBER
    return Knob(name=descriptor.name, kind=kind, hint=hint, value=value, low=low, high=high, step=step)


def nice_step(value: float, low: float, high: float) -> float:
    """Return a power of ten that divides a range into at least `SLIDER_STEPS`, and nearly divides ``value``."""
    step = 10.0 ** math.floor(math.log10((high - low) / SLIDER_STEPS))
    while abs(value / step - round(value / step)) > 1e-6 and step > 1e-9:
        step *= 0.1
    return float(f"{step:.0e}")
