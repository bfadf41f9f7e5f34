"""A node whose parameters are a table."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter

from smartmesh_ros.node.parameters.declaring import Spec, objection
from smartmesh_ros.node.parameters.refused_arguments import refused_arguments


class ParameterNode(Node):
    """A node that refuses invalid arguments with `InputError`, and changes of parameters with what would be right."""

    def __init__(self, name: str, specs: Sequence[Spec], **options: Any) -> None:
        self._specs = specs
        with refused_arguments():
            super().__init__(name, **options)

    def set_parameters_atomically(self, parameter_list: list[Parameter]) -> SetParametersResult:
        """Set parameters like rclpy, with refusals that say what would be right."""
        return objection(self, parameter_list, self._specs) or super().set_parameters_atomically(parameter_list)
