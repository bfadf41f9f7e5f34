"""A node whose parameters are a table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter

from smartmesh_ros.node.parameters.declaring import NONE, Spec, nearest
from smartmesh_ros.node.parameters.qos_overrides import require_overrides, with_overrides
from smartmesh_ros.node.parameters.refused_arguments import refused_arguments


class ParameterNode(Node):
    """A node that refuses invalid arguments with `InputError`, and changes of parameters with what would be right.

    Its topics take ``qos_overrides``. ``removed``: parameters of earlier versions, and what replaces them.
    """

    def __init__(self, name: str, specs: Sequence[Spec], removed: Mapping[str, str] = NONE, **options: Any) -> None:
        self._specs, self._removed = specs, removed
        with refused_arguments():
            super().__init__(name, **options)
        require_overrides(self)

    def set_parameters_atomically(self, parameter_list: list[Parameter]) -> SetParametersResult:
        """Set parameters like rclpy, with refusals that say what would be right."""
        for name in (parameter.name for parameter in parameter_list):
            if reason := self._objection(name):
                return SetParametersResult(successful=False, reason=reason)
        return super().set_parameters_atomically(parameter_list)

    def _objection(self, name: str) -> str:
        """Return why a parameter cannot change, empty = it can. The reasons of rclpy do not say what would be right."""
        if name in self._removed:
            return f"{name} is gone: {self._removed[name]}"
        if not self.has_parameter(name):
            return f"parameter {name!r} is unknown{nearest(name, self._specs)}"
        if not any(spec.name == name and spec.read_only for spec in self._specs):
            return ""
        return f"{name} is fixed after the start; restart the node with -p {name}:=..., or with a file that sets it"

    def create_publisher(self, msg_type: Any, topic: str, qos_profile: Any, **options: Any) -> Any:
        """Create a publisher like rclpy, with the QoS that parameters give it."""
        chosen = with_overrides(self, "publisher", topic, qos_profile)
        return super().create_publisher(msg_type, topic, **chosen, **options)

    def create_subscription(self, msg_type: Any, topic: str, callback: Any, qos_profile: Any, **options: Any) -> Any:
        """Create a subscription like rclpy, with the QoS that parameters give it."""
        chosen = with_overrides(self, "subscription", topic, qos_profile)
        return super().create_subscription(msg_type, topic, callback, **chosen, **options)
