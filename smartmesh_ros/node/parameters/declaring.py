"""Tables of parameters: declared with description and bounds, and checked by the same code at start and run time."""

from __future__ import annotations

import difflib
import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult
from rclpy.exceptions import ParameterException
from rclpy.node import Node
from rclpy.parameter import Parameter

from smartmesh_ros.errors import InputError
from smartmesh_ros.node.parameters.qos_overrides import PREFIX, require_override


class Spec(NamedTuple):
    """One parameter: name, default, effect, bounds or choices; ``read_only`` parameters are fixed after the start."""

    name: str
    default: Any
    description: str
    low: float | None = None
    high: float | None = None
    choices: tuple[str, ...] = ()
    read_only: bool = False


def declare(node: Node, specs: Sequence[Spec], removed: Mapping[str, str] = MappingProxyType({})) -> dict[str, Any]:
    """Declares every parameter on ``node``, warns about overrides of unknown ones, and returns the checked values.

    ``removed``: parameters of earlier versions, and what replaces them. Raises `InputError` if one of these is set or a
    value is invalid, because a node must not start with settings other than those requested.
    """
    for spec in specs:
        try:
            node.declare_parameter(spec.name, spec.default, _descriptor(spec))
        except ParameterException as error:
            bounds = f"; it must be {spec.low} to {spec.high}" if spec.low is not None else ""
            raise InputError("parameter", f"{error}{bounds}") from None
    for name, override in sorted(node._parameter_overrides.items()):
        if name.startswith(PREFIX):
            require_override(name, override.value)
        elif name in removed:
            raise InputError("parameter", f"{name} is gone: {removed[name]}")
        elif not node.has_parameter(name):
            node.get_logger().warning(f"parameter {name!r} is unknown and has no effect{_nearest(name, specs)}")
    return checked(current_values(node, specs), specs)


def objection(
    node: Node, changes: Sequence[Parameter], specs: Sequence[Spec], removed: Mapping[str, str]
) -> SetParametersResult | None:
    """Return the refusal of ``changes`` if one of them names an unknown, a ``removed`` or a read-only parameter, else
    None.

    rclpy refuses such changes too, but its reason does not name a valid alternative.
    """
    fixed = {spec.name for spec in specs if spec.read_only}
    for change in changes:
        if change.name in removed:
            reason = f"{change.name} is gone: {removed[change.name]}"
        elif not node.has_parameter(change.name):
            reason = f"parameter {change.name!r} is unknown{_nearest(change.name, specs)}"
        elif change.name in fixed:
            reason = (
                f"{change.name} is fixed after the start; restart the node with -p {change.name}:=..., or with a "
                "parameter file that sets it"
            )
        else:
            continue
        return SetParametersResult(successful=False, reason=reason)
    return None


def _nearest(name: str, specs: Sequence[Spec]) -> str:
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
    return {spec.name: _checked(spec, values[spec.name]) for spec in specs}


def plain_value(parameter: Parameter) -> Any:
    """Return a parameter's value, arrays as lists."""
    value = parameter.value
    return list(value) if hasattr(value, "tolist") or isinstance(value, list) else value


def _checked(spec: Spec, value: Any) -> Any:
    wanted = type(spec.default)
    if value is None and wanted is list:
        value = []  # rcl delivers an empty list of a parameter file as None
    if wanted is float and type(value) is int:
        value = float(value)
    if type(value) is not wanted:
        raise InputError("parameter", f"{spec.name} is {value!r}; it must be of type {wanted.__name__}")
    if isinstance(value, list):
        kind = float if spec.default and isinstance(spec.default[0], float) else str
        if kind is str and value == [""]:
            value = []  # the usual way to write an empty list, whose type ROS does not know
        value = [float(item) if kind is float and type(item) is int else item for item in value]
        if any(type(item) is not kind for item in value):
            raise InputError("parameter", f"{spec.name} is {value!r}; every entry must be of type {kind.__name__}")
    if spec.choices and value not in spec.choices:
        raise InputError("parameter", f"{spec.name} is {value!r}; choose one of {', '.join(spec.choices)}")
    if spec.low is not None and spec.high is not None:
        for item in value if isinstance(value, list) else [value]:
            if not (math.isfinite(item) and spec.low <= item <= spec.high):
                raise InputError("parameter", f"{spec.name} is {value}; it must be {spec.low} to {spec.high}")
    return value


def _descriptor(spec: Spec) -> ParameterDescriptor:
    # Dynamic typing lets a YAML file write 240 for 240.0; `checked` checks the type.
    descriptor = ParameterDescriptor(
        description=spec.description,
        read_only=spec.read_only,
        dynamic_typing=True,
        additional_constraints=f"one of {', '.join(spec.choices)}" if spec.choices else "",
    )
    if isinstance(spec.default, list) and spec.low is not None:  # ROS ranges apply to single numbers only
        descriptor.additional_constraints = f"each {spec.low} to {spec.high}"
    elif spec.low is not None and spec.high is not None:
        if isinstance(spec.default, float):
            descriptor.floating_point_range = [FloatingPointRange(from_value=spec.low, to_value=spec.high)]
        else:
            descriptor.integer_range = [IntegerRange(from_value=int(spec.low), to_value=int(spec.high), step=1)]
    return descriptor
