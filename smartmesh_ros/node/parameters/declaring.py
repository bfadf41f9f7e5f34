"""Nodes whose parameters are a table: declared with description and bounds, and checked by the same code at start and
run time.

They also have the parameters ``qos_overrides.<topic>.<publisher or subscription>.<policy>``, as of rclcpp's nodes.
rclpy applies the overrides to a topic on request. It declares a parameter for each policy that it may apply, so it is
asked for those alone that are given.
"""

from __future__ import annotations

import copy
import math
import re
from array import array
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import partial
from typing import Any, Literal, NamedTuple

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult
from rclpy.exceptions import ParameterException
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSPolicyKind, QoSProfile
from rclpy.qos_overriding_options import QoSOverridingOptions

from smartmesh_ros.errors import InputError, suggestion

# Beginning of the names of parameters that change the QoS of topics.
QOS = "qos_overrides."


class Spec(NamedTuple):
    """One parameter: name, default, effect, bounds or choices; ``read_only`` parameters are fixed after the start.

    ``place``: dotted path of the field of the node's settings that takes its value, if it has such settings.
    """

    name: str
    default: Any
    description: str
    low: float = -math.inf
    high: float = math.inf
    choices: tuple[str, ...] = ()
    read_only: bool = False
    place: str = ""

    @property
    def values(self) -> str:
        """The choices or bounds, empty = none."""
        return ", ".join(self.choices) or (f"{self.low:g} to {self.high:g}" if math.isfinite(self.low) else "")

    @property
    def rule(self) -> str:
        """What a value must be."""
        if self.choices:
            return f"choose one of {self.values}"
        many = "a list with every entry " if isinstance(self.default, list) else ""
        return f"it must be {many}of type {_kind(self).__name__}{self.values and ', '}{self.values}"


# A parameter that is fixed after the start.
fixed = partial(Spec, read_only=True)


def given_parameters(node: Node) -> Mapping[str, Parameter]:
    """Return the parameters that the command line and its files set, whether the node declares them or not.

    rclpy shows them publicly only once they are declared, after which unknown ones would be in effect and listed.
    """
    given: Mapping[str, Parameter] = node._parameter_overrides
    return given


def checked(values: Mapping[str, Any], specs: Sequence[Spec]) -> dict[str, Any]:
    """Return the values as `checked_value` does, by default the usual ones; raises `InputError` for the first invalid
    one."""
    return {spec.name: checked_value(spec, values.get(spec.name, spec.default)) for spec in specs}


def checked_value(spec: Spec, value: Any) -> Any:
    """Return a value for one parameter, of its type and within its bounds, arrays as lists. Raises `InputError`.

    An integer is accepted for a real number, and so are texts of numbers: `ros2 param load` sends 1.0e-09 of a file as
    the text 1e-09, which is no number of YAML 1.1.
    """
    kind, many = _kind(spec), isinstance(spec.default, list)
    if many and kind is str and value in (None, [""]):
        value = []  # how rcl delivers the empty list of a file, and the usual way to write one, whose type is unknown
    if kind is float and isinstance(value, str):
        with suppress(ValueError):
            numbers = [float(word) for word in value.strip("[] ").split(",")]
            value = numbers if many or len(numbers) > 1 else numbers[0]
    listed = isinstance(value, list | array)
    items = [*value] if listed else [value]
    items = [float(item) if kind is float and type(item) is int else item for item in items]
    fits = many == listed and all(type(item) is kind for item in items)
    if fits and kind in (int, float):
        fits = all(math.isfinite(item) and spec.low <= item <= spec.high for item in items)
    if not fits or (spec.choices and value not in spec.choices):
        raise InputError("parameter", f"{spec.name} is {[*value] if listed else value!r}; {spec.rule}")
    return items if many else items[0]


def _kind(spec: Spec) -> type:
    """Return the type of a parameter's value, or of the entries of a list."""
    return type(next(iter(spec.default), "")) if isinstance(spec.default, list) else type(spec.default)


def _descriptor(spec: Spec) -> ParameterDescriptor:
    # Dynamic typing lets a YAML file write 240 for 240.0; `checked` checks the type.
    descriptor = ParameterDescriptor(description=spec.description, read_only=spec.read_only, dynamic_typing=True)
    if spec.choices:
        descriptor.additional_constraints = f"one of {spec.values}"
    elif isinstance(spec.default, list) and spec.values:  # ROS ranges apply to single numbers only
        descriptor.additional_constraints = f"each {spec.values}"
    elif spec.values and isinstance(spec.default, float):
        descriptor.floating_point_range = [FloatingPointRange(from_value=spec.low, to_value=spec.high)]
    elif spec.values:
        descriptor.integer_range = [IntegerRange(from_value=int(spec.low), to_value=int(spec.high), step=1)]
    return descriptor


# Part of rcl's message -> what would be right; the first that occurs counts.
_HINTS = {
    "Sequence should be of same type": (
        "every entry of a list must be of the same type, so write [0.0, 0.0, -9.81] and not [0, 0, -9.81]"
    ),
    "parameter override rule": (
        "write -p name:=value, where the value is a number, a text, true, false, or a list of one of these"
    ),
    "params": "--params-file needs the path of a YAML file: node name, then ros__parameters, then name: value",
    "": "try --help",
}


@contextmanager
def refused_arguments() -> Iterator[None]:
    """Raise `InputError` in place of rclpy's errors about arguments of ROS and about types of its own parameters."""
    try:
        yield
    except UnicodeEncodeError as error:
        raise InputError("arguments", f"an argument is no UTF-8: {error.object!a}") from None
    except rclpy_implementation.UnknownROSArgsError as error:
        raise InputError("arguments", f"unknown arguments of ROS: {error}; try --help") from None
    except rclpy_implementation.RCLInvalidROSArgsError as error:
        # Without the places in rcl's sources.
        text = re.sub(r"^Failed to parse ROS arguments: |(\. Error: error not set)?(, at \S+:\d+)+", "", str(error))
        raise InputError("arguments", f"{text}; {next(_HINTS[words] for words in _HINTS if words in text)}") from None
    except ParameterException as error:
        raise InputError("parameter", str(error)) from None


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

    Its topics take ``qos_overrides``. It declares the parameters of ``specs``, and warns about unknown ones that are
    set. ``values``: their checked values at the start. Raises `InputError` if a value is invalid, because a node must
    not start with settings other than those requested.
    """

    def __init__(self, name: str, specs: Sequence[Spec], **options: Any) -> None:
        self._specs = {spec.name: spec for spec in specs}
        self.values: dict[str, Any] = {}
        with refused_arguments():
            super().__init__(name, **options)
        require_overrides(self)
        for spec in specs:
            given = given_parameters(self).get(spec.name)
            value = spec.default if given is None else checked_value(spec, given.value)
            self.declare_parameter(spec.name, value, _descriptor(spec), ignore_override=True)
            self.values[spec.name] = value
        for stray in sorted(given_parameters(self)):
            if not self.has_parameter(stray) and not stray.startswith(QOS):
                hint = self._entries_of(stray) or suggestion(stray, self._specs)
                self.get_logger().warning(f"parameter {stray!r} is unknown and has no effect{hint}")

    def _entries_of(self, stray: str) -> str:
        """Return what would be right if an unknown parameter is a field of an entry in a list, "" if not."""
        name, _, field = stray.rpartition(".")
        is_list = field and name in self._specs and isinstance(self._specs[name].default, list)
        return f'; each entry of {name!r} is a text in quotes: "{{...}}"' if is_list else ""

    def set_parameters_atomically(self, parameter_list: list[Parameter]) -> SetParametersResult:
        """Set parameters like rclpy, each to a value of its type, with refusals that say what would be right."""
        try:
            checked_ones = [self._checked(one) for one in parameter_list]
            self.require_together({one.name: one.value for one in checked_ones})
        except InputError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return super().set_parameters_atomically(checked_ones)

    def require_together(self, new: Mapping[str, Any]) -> None:
        """Raise `InputError` if ``new`` values of parameters do not go with those of the others, in a node where this
        may be."""

    def _checked(self, given: Parameter) -> Parameter:
        """Return a parameter to set, with a value of its type. Raises `InputError`."""
        name, spec = given.name, self._specs.get(given.name)
        if not self.has_parameter(name):
            raise InputError("parameter", f"parameter {name!r} is unknown{suggestion(name, self._specs)}")
        if spec is None:  # of rclpy
            return given
        if spec.read_only:
            cure = f"restart the node with -p {name}:=..., or with a file that sets it"
            raise InputError("parameter", f"{name} is fixed after the start; {cure}")
        value = checked_value(spec, given.value)
        # rclpy knows no type of an empty list, and would delete a parameter without a value.
        return Parameter(name, Parameter.Type.STRING_ARRAY if value == [] else None, value)

    def create_publisher(self, msg_type: Any, topic: str, qos_profile: Any, **options: Any) -> Any:
        """Create a publisher like rclpy, with the QoS that parameters give it."""
        chosen = with_overrides(self, "publisher", topic, qos_profile)
        return super().create_publisher(msg_type, topic, **chosen, **options)

    def create_subscription(self, msg_type: Any, topic: str, callback: Any, qos_profile: Any, **options: Any) -> Any:
        chosen = with_overrides(self, "subscription", topic, qos_profile)
        return super().create_subscription(msg_type, topic, callback, **chosen, **options)
