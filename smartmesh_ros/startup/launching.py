"""What the launch files of this package share: arguments of the same names and defaults, and the nodes they start.

Files, packages and executables are looked up before any node starts. ROS launch finds them one by one, and where the
last is missing it would leave the nodes running that it started before.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from ament_index_python.packages import PackageNotFoundError, get_package_prefix, get_package_share_directory
from launch.actions import DeclareLaunchArgument, OpaqueFunction, SetEnvironmentVariable
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from launch import LaunchDescription
from smartmesh_ros.node.fleet import layout as fleet_layout

PACKAGE, NODE = "smartmesh_ros", "terrain_collider"
# Topics of the RViz view, which follow the node into its namespace.
SHOWN = ("patches",)
# As in `smartmesh_ros.startup.dds`, which cannot be imported without rclpy.
PROFILE, POLICY = "FASTRTPS_DEFAULT_PROFILES_FILE", "RMW_FASTRTPS_USE_QOS_FROM_XML"
# Files in config/ that are no parameter files of terrain_collider.
NO_PRESETS = ("diagnostic_aggregator",)

Values = Callable[[str], str]


def description(
    *more: Any,
    always: str = "",
    remap: Sequence[tuple[str, str]] = (),
    start: Callable[[Values], list[Any]] | None = None,
) -> LaunchDescription:
    """Return the collider with the arguments that all launch files have, and ``more`` arguments.

    ``always``: a preset that is read before that of the user. ``remap``: pairs of a topic and the argument that names
    another. ``start``: makes further actions from the values of the arguments, by `node`.
    """

    def act(context: Any) -> list[Any]:
        def value(name: str) -> str:
            return str(LaunchConfiguration(name).perform(context))

        further = [] if start is None else start(value)
        return [*_settings_of_dds(value), _collider(value, always, remap), *_rviz(value), *further]

    return LaunchDescription([*_arguments(), *more, OpaqueFunction(function=act)])


def fleet() -> LaunchDescription:
    """Collider that share one terrain and meet each other's bodies, their front, and a terrain to try them with."""

    def act(context: Any) -> list[Any]:
        def value(name: str) -> str:
            return str(LaunchConfiguration(name).perform(context))

        return [*_settings_of_dds(value), *_fleet_nodes(value), *_rviz(value, fleet_layout.FRONT)]

    arguments = [
        DeclareLaunchArgument(name, default_value=default, description=words)
        for name, default, words in (
            ("nodes", "4", "How many colliders share the terrain."),
            ("spread", "fewest", "Which node a new body goes to: fewest, or tiles."),
            ("respawn", "elsewhere", "Bodies of a node that dies are spawned again elsewhere, or on the same."),
            ("scene", "waves", "Scene of terrain_source; empty = the terrain is yours."),
        )
    ]
    return LaunchDescription([*_arguments(preset=fleet_layout.PRESET), *arguments, OpaqueFunction(function=act)])


def _fleet_nodes(value: Values) -> list[Any]:
    space, count = value("namespace"), int(value("nodes"))
    common: dict[str, Any] = {"output": "screen"}
    time = {"use_sim_time": is_true(value("use_sim_time"))}
    level = ["--ros-args", "--log-level", value("log_level")]
    files = parameter_files([value("preset")], value("config"))
    nodes = []
    for index in range(count):
        own = {name: v for name, v in fleet_layout.parameters_of(index, count, space).items() if v != []}
        nodes.append(
            node(
                **common, executable=NODE, namespace=fleet_layout.namespace_of(index, space),
                parameters=[*files, own, time], remappings=fleet_layout.remappings(space), arguments=level,
                respawn=True,
            )
        )  # fmt: skip
    front = {**fleet_layout.front_parameters(count, space), "spread": value("spread"), "respawn": value("respawn")}
    nodes.append(node(**common, executable="fleet_front", namespace=space, parameters=[front, time], arguments=level))
    if value("scene"):
        nodes.append(
            node(
                **common, executable="terrain_source", namespace=space, parameters=[{"scene": value("scene")}, time],
                remappings=fleet_layout.source_remappings(space),
            )
        )  # fmt: skip
    return nodes


def node(*, package: str = PACKAGE, executable: str, hint: str = "build and source the workspace", **more: Any) -> Any:
    """Return a node whose executable is there; arguments as of launch_ros.

    Raises `FileNotFoundError`, which ends the launch before anything starts, with ``hint``: what would be right.
    """
    try:
        there = (Path(get_package_prefix(package)) / "lib" / package / executable).is_file()
    except PackageNotFoundError:
        raise FileNotFoundError(f"package {package} is not installed: {hint}") from None
    if not there:
        raise FileNotFoundError(f"package {package} has no executable {executable}: {hint}")
    return Node(package=package, executable=executable, **more)


def is_true(text: str) -> bool:
    """Return a launch argument that is a truth value."""
    return text.strip().lower() in ("true", "1", "yes", "on")


def parameter_files(presets: Sequence[str], config: str) -> list[str]:
    """Files of presets' names and of a path, any of which may be empty; the later ones win.

    Raises `FileNotFoundError` with the path of one that is not there, which ends the launch.
    """
    folder = share() / "config"
    files = [folder / f"{preset}.yaml" for preset in presets if preset]
    files += [Path(config).expanduser()] if config else []
    for file in files:
        if not file.is_file():
            known = ", ".join(sorted({path.stem for path in folder.glob("*.yaml")}.difference(NO_PRESETS)))
            hint = f"; the presets are {known}" if file.parent == folder else ""
            raise FileNotFoundError(f"there is no parameter file {file}{hint}")
    return [str(file) for file in files]


def share() -> Path:
    """Return the installed files of this package."""
    return Path(get_package_share_directory(PACKAGE))


def _arguments(preset: str = "") -> list[Any]:
    profile = os.environ.get(PROFILE, str(share() / "config" / "fastdds.xml"))
    return [
        DeclareLaunchArgument(name, default_value=default, description=words)
        for name, default, words in (
            ("preset", preset, "Name of a parameter file in config/; empty = the node's own defaults."),
            ("config", "", "Path of a parameter file of yours, read after the preset."),
            ("namespace", "", "Namespace of the nodes."),
            ("use_sim_time", "false", "Whether the time is that of /clock."),
            ("log_level", "info", "debug, info, warn or error."),
            ("rviz", "false", "Whether to start RViz with a view of the patches."),
            ("dds", profile, "Fast DDS settings for large maps, an XML file; empty = none."),
        )
    ]


def _settings_of_dds(value: Values) -> list[Any]:
    if not value("dds"):
        return []
    if not Path(value("dds")).is_file():
        raise FileNotFoundError(f"there is no file {value('dds')} of Fast DDS settings; name one, or set dds:=''")
    return [SetEnvironmentVariable(PROFILE, value("dds")), SetEnvironmentVariable(POLICY, "1")]


def _collider(value: Values, always: str, remap: Sequence[tuple[str, str]]) -> Any:
    return node(
        executable=NODE,
        namespace=value("namespace"),
        output="screen",
        parameters=[
            *parameter_files([always, value("preset")], value("config")),
            {"use_sim_time": is_true(value("use_sim_time"))},
        ],
        remappings=[(topic, value(argument)) for topic, argument in remap],
        arguments=["--ros-args", "--log-level", value("log_level")],
    )


def _rviz(value: Values, shown: str = NODE) -> list[Any]:
    if not is_true(value("rviz")):
        return []
    namespace = value("namespace").strip("/")
    there = f"/{namespace}/{shown}" if namespace else f"/{shown}"
    return [
        node(
            package="rviz2",
            executable="rviz2",
            hint="apt install ros-jazzy-rviz2, or leave rviz:=true out",
            arguments=["-d", str(share() / "config" / "smartmesh.rviz")],
            parameters=[{"use_sim_time": is_true(value("use_sim_time"))}],
            remappings=[(f"/{NODE}/{topic}", f"{there}/{topic}") for topic in SHOWN],
        )
    ]
