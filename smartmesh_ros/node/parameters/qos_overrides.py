"""Parameters ``qos_overrides.<topic>.<publisher or subscription>.<policy>``, as of rclcpp's nodes.

rclpy applies them to a topic on request. It declares a parameter for each policy that it may apply, so it is asked for
those alone that are given.
"""

from __future__ import annotations

import copy
import re
from typing import Any, Literal

from rclpy.node import Node
from rclpy.qos import QoSPolicyKind, QoSProfile
from rclpy.qos_overriding_options import QoSOverridingOptions

from smartmesh_ros.errors import InputError
from smartmesh_ros.node.parameters.declaring import QOS, Spec, checked_value, given_parameters

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
