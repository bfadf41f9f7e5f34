"""The tab of parameters: each widget shows a parameter's value, sets it, and shows why a value was refused."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable
from queue import SimpleQueue
from typing import Any

from smartmesh_ros.errors import InputError
from smartmesh_ros.tools.view.knobs import Kind, Knob, knob_of, parameter_of, shown_value
from smartmesh_ros.tools.view.remote import Remote


class KnobPanel:
    """Reads a node's parameters once, and keeps the widgets equal to them."""

    def __init__(self, server: Any, remote: Remote, tab: Any) -> None:
        self._gui, self._remote, self._tab = server.gui, remote, tab
        self._knobs: dict[str, Knob] = {}
        self._handles: dict[str, Any] = {}
        self._refusals: dict[str, Any] = {}
        self._values: dict[str, Any] = {}  # the node's values, as shown
        self._pending: dict[str, Any] = {}  # the newest values that are not sent yet
        self._busy: set[str] = set()  # parameters whose answer is outstanding
        self._changes: SimpleQueue[tuple[str, Any]] = SimpleQueue()  # by the page's threads
        self._asked = False
        with tab:
            self._state = server.gui.add_markdown("waiting for the node's parameters ...")

    def update(self) -> None:
        """Send the user's changes to the node, and show the node's changes."""
        if not self._asked and self._remote.parameters.services_are_ready():
            self._asked = True
            self._ask_names()
        while not self._changes.empty():
            name, value = self._changes.get()
            if value != self._values.get(name):
                self._pending[name] = value
        for name in list(self._pending):
            if name not in self._busy:
                self._set(name, self._pending.pop(name))
        changed, self._remote.changed_parameters = self._remote.changed_parameters, {}
        for name, value in changed.items():
            if name in self._handles:
                self._show(name, shown_value(value))

    def _ask_names(self) -> None:
        self._remote.parameters.list_parameters().add_done_callback(
            lambda names: self._ask_descriptions(sorted(names.result().result.names))
        )

    def _ask_descriptions(self, names: list[str]) -> None:
        self._remote.parameters.describe_parameters(names).add_done_callback(
            lambda described: self._ask_values(names, described.result().descriptors)
        )

    def _ask_values(self, names: list[str], descriptors: Any) -> None:
        from rclpy.parameter import parameter_value_to_python

        def build(values: Any) -> None:
            found = [parameter_value_to_python(value) for value in values.result().values]
            knobs = [knob_of(descriptor, value) for descriptor, value in zip(descriptors, found, strict=True)]
            self._build([knob for knob in knobs if knob is not None])

        self._remote.parameters.get_parameters(names).add_done_callback(build)

    def _build(self, knobs: list[Knob]) -> None:
        groups: dict[str, list[Knob]] = defaultdict(list)
        for knob in knobs:
            groups[knob.name.partition(".")[0] if "." in knob.name else "other"].append(knob)
        with self._tab:
            self._state.content = "Values that may change while the node runs. Fixed ones need a restart."
            for group, members in groups.items():
                with self._gui.add_folder(group, expand_by_default=group in ("physics", "patch")):
                    for knob in members:
                        self._add(knob)

    def _add(self, knob: Knob) -> None:
        self._knobs[knob.name], self._values[knob.name] = knob, knob.value
        handle = _widget(self._gui, knob)
        handle.on_update(lambda event: self._changes.put((knob.name, event.target.value)))
        self._handles[knob.name] = handle
        self._refusals[knob.name] = self._gui.add_markdown("", visible=False)

    def _set(self, name: str, value: Any) -> None:
        try:
            parameter = parameter_of(self._knobs[name], value)
        except InputError as error:
            self._refuse(name, str(error))
            return
        self._busy.add(name)
        self._remote.parameters.set_parameters([parameter]).add_done_callback(
            lambda answer: self._answered(name, value, answer.result().results[0])
        )

    def _answered(self, name: str, value: Any, result: Any) -> None:
        self._busy.discard(name)
        if not result.successful:
            self._refuse(name, result.reason)
            return
        self._refusals[name].visible = False
        self._values[name] = value

    def _refuse(self, name: str, reason: str) -> None:
        """Show the reason, and restore the node's value."""
        self._refusals[name].content = f"**refused:** {reason}"
        self._refusals[name].visible = True
        self._handles[name].value = self._values[name]

    def _show(self, name: str, value: Any) -> None:
        if value == self._values[name]:
            return
        self._values[name] = value
        if name not in self._pending and name not in self._busy:
            self._handles[name].value = value


def _widget(gui: Any, knob: Knob) -> Any:
    label = knob.name.partition(".")[2] or knob.name
    makers: dict[Kind, Callable[[], Any]] = {
        Kind.SWITCH: lambda: gui.add_checkbox(label, knob.value, hint=knob.hint),
        Kind.CHOICE: lambda: gui.add_dropdown(label, knob.choices, initial_value=knob.value, hint=knob.hint),
        Kind.TEXT: lambda: gui.add_text(label, knob.value, hint=knob.hint),
        Kind.NUMBER: lambda: gui.add_number(
            label, knob.value, min=knob.low, max=knob.high, step=knob.step, hint=knob.hint
        ),
        Kind.SLIDER: lambda: gui.add_slider(label, knob.low, knob.high, knob.step, knob.value, hint=knob.hint),
    }
    return makers[knob.kind]()
