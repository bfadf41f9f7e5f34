"""The tab of parameters: each widget shows a parameter's value and sets it."""

from __future__ import annotations

import math
from collections import defaultdict
from contextlib import suppress
from functools import partial
from time import monotonic
from typing import Any, NamedTuple

import yaml
from rcl_interfaces.msg import ParameterDescriptor
from rclpy.parameter import Parameter, parameter_value_to_python

from smartmesh_ros.errors import InputError
from smartmesh_ros.tools.client.remote import Remote
from smartmesh_ros.tools.messages import parameter_from

# Time after which questions without an answer are asked again [s]: the node may have been killed.
PATIENCE = 3.0
# Prefix of a description's constraints that list choices.
CHOICES = "one of "
# Widest range of a slider, in multiples of the value, and minimum number of steps of a slider.
MAX_RELATIVE_RANGE = 100.0
SLIDER_STEPS = 200


class Knob(NamedTuple):
    """A parameter that may change: its ``name``, the ``kind`` of its widget, as viser calls it (checkbox, dropdown,
    slider, number or text), the parameter's ``value`` as the widget shows it, and further ``options`` of the widget."""

    name: str
    kind: str
    value: Any
    options: dict[str, Any]

    def add_to(self, gui: Any) -> Any:
        """Add the widget to the page; return its handle."""
        label = self.name.partition(".")[2] or self.name
        handle = getattr(gui, f"add_{self.kind}")(label, initial_value=self.value, **self.options)
        if self.kind == "number":  # viser shows seven digits at most
            handle.precision = max(0, -math.floor(math.log10(self.options.get("step", 1))))
        return handle


def knob_of(descriptor: ParameterDescriptor, value: Any) -> Knob | None:
    """Return the knob of a parameter; None if the parameter is read-only, unset, or has no description."""
    if descriptor.read_only or not descriptor.description or value is None:
        return None
    words, kind, options = descriptor.additional_constraints, "text", {"hint": descriptor.description}
    if isinstance(value, bool):
        kind = "checkbox"
    elif isinstance(value, int | float):
        kind = "number"
        for bounds in (*descriptor.integer_range, *descriptor.floating_point_range):
            low, high, whole = bounds.from_value, bounds.to_value, isinstance(value, int)
            options["hint"] += f" {low:g} to {high:g}."
            options |= {"min": low, "max": high, "step": 1 if whole else nice_step(value, low, high)}
            if high - low <= (SLIDER_STEPS if whole and not value else MAX_RELATIVE_RANGE * abs(value)):
                kind = "slider"
    elif not isinstance(value, str):
        options["hint"] += f" ({words})" if words else ""
    elif words.startswith(CHOICES) and value in (choices := words.removeprefix(CHOICES).split(", ")):
        kind, options["options"] = "dropdown", choices
    return Knob(descriptor.name, kind, shown_value(value), options)


def parameter_of(knob: Knob, given: Any) -> Parameter:
    """Return the parameter with the value that the page's user gave. Raise `InputError` if a list's text is no list."""
    if knob.kind == "text" and knob.value.startswith("["):
        with suppress(InputError):
            if isinstance((made := parameter_from(knob.name, given)).value, list):
                return made
        raise InputError("parameter", f"{knob.name} must be a list, such as {knob.value}")
    return Parameter(knob.name, value=given)


def shown_value(value: Any) -> Any:
    """Return a parameter's value as its widget shows it: lists as YAML, in one line."""
    if isinstance(value, bool | int | float | str):
        return value
    return str(yaml.safe_dump(list(value), default_flow_style=True, width=math.inf)).strip()


def nice_step(value: float, low: float, high: float) -> float:
    """Return a power of ten that divides a range into at least `SLIDER_STEPS`, and nearly divides ``value``."""
    step = 10.0 ** math.floor(math.log10((high - low) / SLIDER_STEPS))
    while abs(value / step - round(value / step)) > 1e-6 * min(1.0, abs(value / step)) and step > 1e-9:
        step *= 0.1
    return float(f"{step:.0e}")


class KnobPanel:
    """Reads a node's parameters, anew when it was restarted, and keeps the widgets equal to them."""

    def __init__(self, server: Any, remote: Remote, tab: Any) -> None:
        self._server, self._remote, self._tab = server, remote, tab
        self._knobs: dict[str, tuple[Knob, Any]] = {}  # with their handles
        self._values: dict[str, Any] = {}  # the node's values, as shown
        self._pending: dict[str, Any] = {}  # the newest values that are not sent yet, by the page's threads
        self._busy: set[str] = set()  # parameters whose answer is outstanding
        self._shown: frozenset[Any] = frozenset()  # runs of the node whose parameters are shown
        self._ask_at = 0.0  # [s]
        with tab:
            self._state = server.gui.add_markdown("waiting for the node's parameters ...")

    def update(self) -> None:
        """Send the user's changes to the node, and show the node's changes."""
        runs, now = self._remote.runs, monotonic()
        if runs - self._shown and now >= self._ask_at and self._remote.parameters.services_are_ready():
            self._ask_at = now + PATIENCE
            self._busy.clear()
            self._remote.parameters.list_parameters().add_done_callback(partial(self._on_names, runs))
        for name in self._pending.keys() - self._busy:
            value = self._pending.pop(name)
            if value != self._values[name]:
                self._set(name, value)
        changed, self._remote.changed_parameters = self._remote.changed_parameters, {}
        for name in changed.keys() & self._knobs.keys():
            self._values[name] = shown_value(changed[name])
            if name not in self._pending and name not in self._busy:
                self._knobs[name][1].value = self._values[name]

    def _on_names(self, runs: frozenset[Any], answer: Any) -> None:
        names = sorted(answer.result().result.names)
        self._remote.parameters.describe_parameters(names).add_done_callback(partial(self._on_descriptors, runs))

    def _on_descriptors(self, runs: frozenset[Any], answer: Any) -> None:
        found = answer.result().descriptors
        self._remote.parameters.get_parameters([descriptor.name for descriptor in found]).add_done_callback(
            lambda values: self._build(runs, found, values.result().values)
        )

    def _build(self, runs: frozenset[Any], descriptors: Any, values: Any) -> None:
        self._shown = runs
        groups: dict[str, list[Knob]] = defaultdict(list)
        for descriptor, value in zip(descriptors, values, strict=True):
            plain = parameter_value_to_python(value)
            if descriptor.name in self._knobs:
                self._remote.changed_parameters.setdefault(descriptor.name, [] if plain is None else plain)
            elif (knob := knob_of(descriptor, plain)) is not None:
                groups[knob.name.partition(".")[0] if "." in knob.name else "other"].append(knob)
        with self._tab:
            self._state.content = "Values that may change while the node runs. Fixed ones need a restart."
            for group, members in groups.items():
                with self._server.gui.add_folder(group, expand_by_default=group == "physics"):
                    for knob in members:
                        self._add(knob)

    def _add(self, knob: Knob) -> None:
        handle = knob.add_to(self._server.gui)
        self._knobs[knob.name], self._values[knob.name] = (knob, handle), knob.value
        handle.on_update(lambda event: self._pending.update({knob.name: event.target.value}))

    def _set(self, name: str, value: Any) -> None:
        def answered(answer: Any) -> None:
            self._busy.discard(name)
            result = answer.result().results[0]
            if result.successful:
                self._values[name] = value
            else:
                self._refuse(name, result.reason)

        try:
            parameter = parameter_of(self._knobs[name][0], value)
            self._busy.add(name)
            self._remote.parameters.set_parameters([parameter]).add_done_callback(answered)
        except InputError as error:
            self._refuse(name, str(error))

    def _refuse(self, name: str, reason: str) -> None:
        self._knobs[name][1].value = self._values[name]
        for client in self._server.get_clients().values():
            client.add_notification(f"{name} is refused:", reason, color="red")
