"""A node whose parameters are a table, and its parameters ``qos_overrides.<topic>.<publisher or
subscription>.<policy>``, as of rclcpp's nodes.

rclpy applies the overrides to a topic on request. It declares a parameter for each policy that it may apply, so it is
asked for those alone that are given.
"""

from __future__ import annotations

import copy
import re
from collections.abc import Mapping, Sequence
from typing import Any, Literal

from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSPolicyKind, QoSProfile
from rclpy.qos_overriding_options import QoSOverridingOptions

from smartmesh_ros.errors import InputError
from smartmesh_ros.node.parameters.declaring import NONE, QOS, Spec, checked_value, given_parameters, nearest
from smartmesh_ros.node.parameters.helping import refused_arguments

POLICIES = {
    "history": Spec("", "", "", choices=("keep_last", "keep_all", "system_default")),
    "depth": Spec("", 10, "", 1, 1_000_000),
    "reliability": Spec("", "", "", choices=("reliable", "best_effort", "best_available", "system_default")),
    "durability": Spec("", "", "", choices=("volatile", "transient_local", "best_available", "system_default")),
}


def require_overrides(node: Node) -> None:
    """Raise `InputError` unless each given parameter of this kind names a policy, and a possible value of it."""
    for name, given in given_parameters(node).items():
        if not name.startswith(QOS):
            continue
        form = re.fullmatch(rf"{QOS}/[^.]*\.(?:publisher|subscription)\.({'|'.join(POLICIES)})", name)
        if form is None:
            right = f"{QOS}<topic>.<publisher or subscription>.<policy>, with the full name of the topic"
            raise InputError("parameter", f"{name} must be {right} and one of the policies {', '.join(POLICIES)}")
        checked_value(POLICIES[form[1]]._replace(name=name), given.value)


def with_overrides(
    node: Node, kind: Literal["publisher", "subscription"], topic: str, qos: QoSProfile | int
) -> dict[str, Any]:
    """Return the arguments of rclpy that give a topic the QoS ``qos``, changed by the node's parameters."""
    given, prefix = given_parameters(node), f"{QOS}{node.resolve_topic_name(topic)}.{kind}."
    policies = [QoSPolicyKind[policy.upper()] for policy in POLICIES if f"{prefix}{policy}" in given]
    if not policies:
        return {"qos_profile": qos}
    # A copy, because rclpy changes the profile, which topics share.
    profile = QoSProfile(depth=qos) if isinstance(qos, int) else copy.copy(qos)
    return {"qos_profile": profile, "qos_overriding_options": QoSOverridingOptions(policies)}


def warn_of_unused_overrides(node: Node) -> None:
    """Log a warning for each override that no topic of the node has taken."""
    for name in sorted(given_parameters(node)):
        if name.startswith(QOS) and not node.has_parameter(name):
            _, topic, kind, _ = name.split(".")
            node.get_logger().warning(f"parameter {name!r} has no effect so far: the node has no {kind} of {topic}")


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
