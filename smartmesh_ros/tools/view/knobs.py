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
    """Kind of widget of a parameter."""

    SWITCH = "switch"
    CHOICE = "choice"
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


def knob_of(descriptor: ParameterDescriptor, value: Any) -> Knob | None:
    """Return the knob of a parameter; None if the parameter is read-only, unset, or has no description."""
    if descriptor.read_only or not descriptor.description or value is None:
        return None
    name, hint = descriptor.name, descriptor.description
    if isinstance(value, bool):
        return Knob(name=name, kind=Kind.SWITCH, hint=hint, value=value)
    if isinstance(value, str):
        choices = _choices(descriptor)
        kind = Kind.CHOICE if value in choices else Kind.TEXT
        return Knob(name=name, kind=kind, hint=hint, value=value, choices=choices if kind is Kind.CHOICE else ())
    if isinstance(value, int | float):
        return _number(descriptor, value)
    limits = f" ({descriptor.additional_constraints})" if descriptor.additional_constraints else ""
    return Knob(name=name, kind=Kind.TEXT, hint=hint + limits, value=text_of(list(value)))


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
    """Return a parameter's value as its widget shows it: lists as texts."""
    return value if isinstance(value, bool | int | float | str) else text_of(list(value))


def text_of(values: list[Any]) -> str:
    """Return a list as YAML, in one line."""
    return str(yaml.safe_dump(values, default_flow_style=True, width=math.inf)).strip()


def _choices(descriptor: ParameterDescriptor) -> tuple[str, ...]:
    words = descriptor.additional_constraints
    return tuple(words.removeprefix(CHOICES).split(", ")) if words.startswith(CHOICES) else ()


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
