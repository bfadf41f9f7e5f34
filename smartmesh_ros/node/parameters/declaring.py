"""Tables of parameters: declared with description and bounds, and checked by the same code at start and run time."""

from __future__ import annotations

import difflib
import math
from collections.abc import Mapping, Sequence
from functools import partial
from types import MappingProxyType
from typing import Any, NamedTuple

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.exceptions import ParameterException
from rclpy.node import Node
from rclpy.parameter import Parameter

from smartmesh_ros.errors import InputError

NONE: Mapping[str, str] = MappingProxyType({})
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


def declare(node: Node, specs: Sequence[Spec], removed: Mapping[str, str] = NONE) -> dict[str, Any]:
    """Declares every parameter on ``node``, warns about overrides of unknown ones, and returns the checked values.

    ``removed``: parameters of earlier versions, and what replaces them. Raises `InputError` if one of these is set or a
    value is invalid, because a node must not start with settings other than those requested.
    """
    for spec in specs:
        try:
            node.declare_parameter(spec.name, spec.default, _descriptor(spec))
        except ParameterException as error:
            raise InputError("parameter", f"{error}; {spec.rule}") from None
    for name in sorted(given_parameters(node)):
        if name in removed:
            raise InputError("parameter", f"{name} is gone: {removed[name]}")
        if not node.has_parameter(name) and not name.startswith(QOS):
            node.get_logger().warning(f"parameter {name!r} is unknown and has no effect{nearest(name, specs)}")
    return checked(current_values(node, specs), specs)


def nearest(name: str, specs: Sequence[Spec]) -> str:
    """Return a hint that suggests the most similar known name; empty if no name is similar."""
    names = difflib.get_close_matches(name, [spec.name for spec in specs], n=1)
    return f"; did you mean {names[0]!r}?" if names else ""


def current_values(node: Node, specs: Sequence[Spec]) -> dict[str, Any]:
    """Return the current value of each parameter on the node."""
    return {spec.name: plain_value(node.get_parameter(spec.name)) for spec in specs}


def checked(values: Mapping[str, Any], specs: Sequence[Spec]) -> dict[str, Any]:
    """Return the values, checked for type and bounds; raises `InputError` for the first invalid one.

    An integer is accepted for a float parameter.
    """
    return {spec.name: checked_value(spec, values[spec.name]) for spec in specs}


def plain_value(parameter: Parameter) -> Any:
    """Return a parameter's value, arrays as lists."""
    value = parameter.value
    return list(value) if hasattr(value, "tolist") or isinstance(value, list) else value


def checked_value(spec: Spec, value: Any) -> Any:
    """Return a value for one parameter, checked as by `checked`."""
    kind, many = _kind(spec), isinstance(spec.default, list)
    if many and kind is str and value in (None, [""]):
        value = []  # how rcl delivers the empty list of a file, and the usual way to write one, whose type is unknown
    items = value if many and isinstance(value, list) else [value]
    items = [float(item) if kind is float and type(item) is int else item for item in items]
    fits = many == isinstance(value, list) and all(type(item) is kind for item in items)
    if fits and kind in (int, float):
        fits = all(math.isfinite(item) and spec.low <= item <= spec.high for item in items)
    if not fits or (spec.choices and value not in spec.choices):
        raise InputError("parameter", f"{spec.name} is {value!r}; {spec.rule}")
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
