"""Parameters ``qos_overrides.<topic>.<publisher or subscription>.<policy>``, as of rclcpp's nodes.

rclpy applies them to a topic on request. It declares a parameter for each policy that it may apply, so it is asked for
those alone that are given.
"""

from __future__ import annotations

import copy
from typing import Any, Literal

from rclpy.node import Node
from rclpy.qos import QoSPolicyKind, QoSProfile
from rclpy.qos_overriding_options import QoSOverridingOptions

from smartmesh_ros.errors import InputError

PREFIX = "qos_overrides."
Kind = Literal["publisher", "subscription"]
CHOICES = {
    "history": ("keep_last", "keep_all", "system_default"),
    "reliability": ("reliable", "best_effort", "best_available", "system_default"),
    "durability": ("volatile", "transient_local", "best_available", "system_default"),
}
POLICIES = ("history", "depth", "reliability", "durability")
DEEPEST = 1_000_000


def require_override(name: str, value: Any) -> None:
    """Raise `InputError` unless a parameter whose name begins with `PREFIX` names a policy and a possible value."""
    parts = name.removeprefix(PREFIX).split(".")
    form = f"{PREFIX}<topic>.<publisher or subscription>.<policy>, with the full name of the topic"
    if len(parts) != 3 or parts[1] not in ("publisher", "subscription") or not parts[0].startswith("/"):
        raise InputError("parameter", f"{name} has no effect; it must be {form}")
    policy = parts[2]
    if policy not in POLICIES:
        raise InputError("parameter", f"{name} cannot be set; the policies are {', '.join(POLICIES)}")
    if policy == "depth":
        if type(value) is not int or not 1 <= value <= DEEPEST:
            raise InputError("parameter", f"{name} is {value!r}; it must be an integer, 1 to {DEEPEST}")
    elif value not in CHOICES[policy]:
        raise InputError("parameter", f"{name} is {value!r}; choose one of {', '.join(CHOICES[policy])}")


def with_overrides(node: Node, kind: Kind, topic: str, qos: QoSProfile | int) -> dict[str, Any]:
    """Return the arguments of rclpy that give a topic the QoS ``qos``, changed by the node's parameters."""
    overrides = [name for name in node._parameter_overrides if name.startswith(PREFIX)]
    if not overrides:
        return {"qos_profile": qos}
    prefix = f"{PREFIX}{node.resolve_topic_name(topic)}.{kind}."
    given = [QoSPolicyKind[name.removeprefix(prefix).upper()] for name in overrides if name.startswith(prefix)]
    # A copy, because rclpy changes the profile, which topics share.
    profile = QoSProfile(depth=qos) if isinstance(qos, int) else copy.copy(qos)
    return {"qos_profile": profile, "qos_overriding_options": QoSOverridingOptions(given)}


def warn_of_unused_overrides(node: Node) -> None:
    """Log a warning for each override that no topic of the node has taken."""
    for name in sorted(node._parameter_overrides):
        if name.startswith(PREFIX) and not node.has_parameter(name):
            _, topic, kind, _ = name.split(".")
            node.get_logger().warning(f"parameter {name!r} has no effect so far: the node has no {kind} of {topic}")
