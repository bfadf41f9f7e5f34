"""The tab of parameters: each widget shows a parameter's value and sets it."""

from __future__ import annotations

from collections import defaultdict
from typing import Any

from rclpy.parameter import parameter_value_to_python

from smartmesh_ros.errors import InputError
from smartmesh_ros.tools.view.knobs import Knob, knob_of, parameter_of, shown_value
from smartmesh_ros.tools.view.remote import Remote


class KnobPanel:
    """Reads a node's parameters once, and keeps the widgets equal to them."""

    def __init__(self, server: Any, remote: Remote, tab: Any) -> None:
        self._server, self._remote, self._tab = server, remote, tab
        self._knobs: dict[str, tuple[Knob, Any]] = {}  # with their handles
        self._values: dict[str, Any] = {}  # the node's values, as shown
        self._pending: dict[str, Any] = {}  # the newest values that are not sent yet, by the page's threads
        self._busy: set[str] = set()  # parameters whose answer is outstanding
        self._asked = False
        with tab:
            self._state = server.gui.add_markdown("waiting for the node's parameters ...")

    def update(self) -> None:
        """Send the user's changes to the node, and show the node's changes."""
        if not self._asked and self._remote.parameters.services_are_ready():
            self._asked = True
            self._remote.parameters.list_parameters().add_done_callback(self._on_names)
        for name in self._pending.keys() - self._busy:
            value = self._pending.pop(name)
            if value != self._values[name]:
                self._set(name, value)
        changed, self._remote.changed_parameters = self._remote.changed_parameters, {}
        for name in changed.keys() & self._knobs.keys():
            self._values[name] = shown_value(changed[name])
            if name not in self._pending and name not in self._busy:
                self._knobs[name][1].value = self._values[name]

    def _on_names(self, answer: Any) -> None:
        names = sorted(answer.result().result.names)
        self._remote.parameters.describe_parameters(names).add_done_callback(self._on_descriptors)

    def _on_descriptors(self, answer: Any) -> None:
        descriptors = list(answer.result().descriptors)
        names = [descriptor.name for descriptor in descriptors]
        self._remote.parameters.get_parameters(names).add_done_callback(
            lambda values: self._build(descriptors, values.result().values)
        )

    def _build(self, descriptors: list[Any], values: Any) -> None:
        groups: dict[str, list[Knob]] = defaultdict(list)
        for descriptor, value in zip(descriptors, values, strict=True):
            knob = knob_of(descriptor, parameter_value_to_python(value))
            if knob is not None:
                groups[knob.name.partition(".")[0] if "." in knob.name else "other"].append(knob)
        with self._tab:
            self._state.content = "Values that may change while the node runs. Fixed ones need a restart."
            for group, members in groups.items():
                with self._server.gui.add_folder(group, expand_by_default=group in ("physics", "patch")):
                    for knob in members:
                        self._add(knob)

    def _add(self, knob: Knob) -> None:
        handle = knob.add_to(self._server.gui)
        self._knobs[knob.name], self._values[knob.name] = (knob, handle), knob.value
        handle.on_update(lambda event: self._pending.update({knob.name: event.target.value}))

    def _set(self, name: str, value: Any) -> None:
        try:
            parameter = parameter_of(self._knobs[name][0], value)
        except InputError as error:
            self._refuse(name, str(error))
            return
        self._busy.add(name)
        self._remote.parameters.set_parameters([parameter]).add_done_callback(
            lambda answer: self._answered(name, value, answer.result().results[0])
        )

    def _answered(self, name: str, value: Any, result: Any) -> None:
        self._busy.discard(name)
        if result.successful:
            self._values[name] = value
        else:
            self._refuse(name, result.reason)

    def _refuse(self, name: str, reason: str) -> None:
        """Show the reason, and restore the node's value."""
        self._knobs[name][1].value = self._values[name]
        for client in self._server.get_clients().values():
            client.add_notification(f"{name} is refused:", reason, color="red")
