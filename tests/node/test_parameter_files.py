"""What `ros2 param dump` writes of a node, loaded into it and given to the next one."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml
from rcl_interfaces.srv import GetParameters, ListParameters
from rclpy.parameter import parameter_dict_from_yaml_file, parameter_value_to_python
from rclpy.parameter_client import AsyncParameterClient

from smartmesh_ros.node.parameters.specifications import SPECS
from smartmesh_ros.tools.testing import COLLIDER, Probe

# The last is of rclpy.
FIXED = {*(spec.name for spec in SPECS if spec.read_only), "start_type_description_service"}


def dumped(probe: Probe, file: Path) -> dict[str, Any]:
    """The values of all parameters, which are written to a file, as `ros2 param dump` does."""
    names = list(probe.call("list_parameters", ListParameters).result.names)
    found = probe.call("get_parameters", GetParameters, names=names).values
    values = {name: parameter_value_to_python(value) for name, value in zip(names, found, strict=True)}
    plain = {name: list(value) if hasattr(value, "tolist") else value for name, value in values.items()}
    file.write_text(yaml.safe_dump({COLLIDER: {"ros__parameters": plain}}))
    return plain


def test_a_dump_can_be_loaded_and_started_from_again_and_again(probe: Probe, tmp_path: Path) -> None:
    file, arguments, dumps = tmp_path / "dump.yaml", ["--ros-args", "-p", "physics.rate:=120", "--"], []
    for _ in range(3):
        with probe.running(arguments=arguments):
            dumps.append(dumped(probe, file))
            client = AsyncParameterClient(probe.node, COLLIDER)
            probe.wait_for(client.services_are_ready)
            answer = client.load_parameter_file(str(file))  # as `ros2 param load` does
            probe.wait_for(answer.done)
            loaded = zip(parameter_dict_from_yaml_file(str(file)), answer.result().results, strict=True)
            assert {name for name, result in loaded if not result.successful} == FIXED
            assert dumped(probe, file) == dumps[0]
        arguments = ["--ros-args", "--params-file", str(file), "--"]
    assert dumps[0] == dumps[1] == dumps[2]
