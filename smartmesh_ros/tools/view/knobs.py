"""The kind and bounds of the page's widget for each parameter, from the node's descriptions."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal

import yaml
from rcl_interfaces.msg import ParameterDescriptor
from rclpy.parameter import Parameter

from smartmesh_ros.errors import InputError

# Kind of widget, as viser calls it.
Kind = Literal["checkbox", "dropdown", "slider", "number", "text"]
# Prefix of a description's constraints that list choices.
CHOICES = "one of "
# Widest range of a slider, in multiples of the value, and minimum number of steps of a slider.
MAX_RELATIVE_RANGE = 100.0
SLIDER_STEPS = 200


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
        if self.kind in ("slider", "number"):
            options = {"min": self.low, "max": self.high, "step": self.step}
        add = getattr(gui, f"add_{self.kind}")
        return add(self.name.partition(".")[2] or self.name, initial_value=self.value, hint=self.hint, **options)


def knob_of(descriptor: ParameterDescriptor, value: Any) -> Knob | None:
    """Return the knob of a parameter; None if the parameter is read-only, unset, or has no description."""
    if descriptor.read_only or not descriptor.description or value is None:
        return None
    words, hint = descriptor.additional_constraints, descriptor.description
    kind: Kind = "text"
    more: dict[str, Any] = {}
    if isinstance(value, bool):
        kind = "checkbox"
    elif isinstance(value, int | float):
        kind = "number"
        for bounds in (*descriptor.integer_range, *descriptor.floating_point_range):
            low, high, whole = bounds.from_value, bounds.to_value, isinstance(value, int)
            hint = f"{hint} {low:g} to {high:g}."
            more = {"low": low, "high": high, "step": 1 if whole else nice_step(value, low, high)}
            if high - low <= (SLIDER_STEPS if whole and not value else MAX_RELATIVE_RANGE * abs(value)):
                kind = "slider"
    elif not isinstance(value, str):
        hint += f" ({words})" if words else ""
    elif words.startswith(CHOICES) and value in (choices := words.removeprefix(CHOICES).split(", ")):
        kind, more = "dropdown", {"choices": tuple(choices)}
    return Knob(name=descriptor.name, kind=kind, hint=hint, value=shown_value(value), **more)


def parameter_of(knob: Knob, given: Any) -> Parameter:
    """Return the parameter with the value that the page's user gave. Raise `InputError` if a list's text is no list."""
    if knob.kind == "text" and knob.value.startswith("["):
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


def nice_step(value: float, low: float, high: float) -> float:
    """Return a power of ten that divides a range into at least `SLIDER_STEPS`, and nearly divides ``value``."""
    step = 10.0 ** math.floor(math.log10((high - low) / SLIDER_STEPS))
    while abs(value / step - round(value / step)) > 1e-6 and step > 1e-9:
        step *= 0.1
    return float(f"{step:.0e}")
