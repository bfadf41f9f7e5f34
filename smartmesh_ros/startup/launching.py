"""Shared parts of this package's launch files: common arguments with their defaults, and the nodes to start.

Files, packages and executables are checked before any node starts. ROS launch itself checks each one only when it
starts it, and if the last is missing, the nodes started before keep running.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from ament_index_python.packages import get_package_share_directory
from launch.actions import DeclareLaunchArgument, OpaqueFunction, SetEnvironmentVariable
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from launch import LaunchDescription
from smartmesh_ros.node.fleet import layout as fleet_layout
from smartmesh_ros.scenes import SCENES
from smartmesh_ros.startup.dds import POLICY_VARIABLE, VARIABLE
from smartmesh_ros.startup.executables import executable as installed

PACKAGE, NODE = "smartmesh_ros", "terrain_collider"
# Parameter files in config/ that are not for terrain_collider.
NO_PRESETS = ("diagnostic_aggregator",)
# Topics of the node that RViz shows.
SHOWN = ("patches", "scene", "robot_model")
TRUE, FALSE = ("true", "1", "yes", "on"), ("false", "0", "no", "off", "")
LOG_LEVELS = ("debug", "info", "warn", "error", "fatal")

Values = Callable[[str], str]


def description(
    *more: Any,
    always: str = "",
    remap: Sequence[tuple[str, str]] = (),
    settings: Callable[[Values], dict[str, Any]] | None = None,
    start: Callable[[Values], list[Any]] | None = None,
) -> LaunchDescription:
    """Return a launch description of the collider with the common arguments and ``more`` arguments.

    ``always``: a preset that is read before the user's preset. ``settings``: returns parameters of the collider for the
    values of the arguments, read before the user's preset too. ``remap``: pairs of a topic and the argument that holds
    its new name. ``start``: returns further actions for the values of the arguments; creates nodes with `own_node`.
    """

    def nodes(value: Values) -> list[Any]:
        own = [] if settings is None else [settings(value)]
        files = [*parameter_files([always], ""), *own, *parameter_files([value("preset")], value("config"))]
        topics = [(topic, value(argument)) for topic, argument in remap]
        collider = own_node(value, NODE, *files, remappings=topics)
        return [collider, *(() if start is None else start(value))]

    return _description([*_arguments(), *more], nodes)


def fleet() -> LaunchDescription:
    """Return a launch description of a fleet: colliders on one terrain, their front, and a terrain source."""
    spread = "Node of a new body: fewest (bodies), or tiles (by start position)."
    respawn = "Where bodies of a dead node are respawned: elsewhere, or on the same."
    arguments = [
        *_arguments(preset=fleet_layout.PRESET),
        argument("nodes", "4", "Number of colliders that share the terrain."),
        argument("spread", "fewest", spread, ("fewest", "tiles")),
        argument("respawn", "elsewhere", respawn, ("elsewhere", "same")),
        scene_argument("empty = no terrain_source, publish your own terrain", ""),
    ]
    return _description(arguments, _fleet_nodes, fleet_layout.FRONT)


def _description(arguments: list[Any], nodes: Callable[[Values], list[Any]], shown: str = NODE) -> LaunchDescription:
    """Return a launch description of ``nodes``, which are made for the values of the arguments, and of RViz."""

    def act(context: Any) -> list[Any]:
        def value(name: str) -> str:
            found = str(LaunchConfiguration(name).perform(context))
            return within(pushed, found) if name == "namespace" else found

        pushed = LaunchConfiguration("ros_namespace", default="").perform(context)

        return [*_settings_of_dds(value), *nodes(value), *_rviz(value, shown)]

    return LaunchDescription([*arguments, OpaqueFunction(function=act)])


def within(outer: str, namespace: str) -> str:
    """Return the namespace of nodes for the one that an outer launch file pushed, if any: full names are made of it."""
    if not outer.strip("/") or namespace.startswith("/"):
        return namespace
    return f"/{outer.strip('/')}/{namespace}".rstrip("/")


def _fleet_nodes(value: Values) -> list[Any]:
    given = value("nodes").strip()
    if not given.isdecimal() or not int(given):
        raise ValueError(f"nodes:={value('nodes')} is no number of 1 or more")
    space, count = value("namespace"), int(given)
    files, topics = parameter_files([value("preset")], value("config")), fleet_layout.remappings(space)
    nodes = []
    for index in range(count):
        own, its_space = fleet_layout.parameters_of(index, count, space), fleet_layout.namespace_of(index, space)
        nodes.append(own_node(value, NODE, *files, own, namespace=its_space, remappings=topics, respawn=True))
    front = {"nodes": fleet_layout.node_names(count, space), "spread": value("spread"), "respawn": value("respawn")}
    nodes.append(own_node(value, "fleet_front", front))
    if scene := value("scene"):
        topics = fleet_layout.source_remappings(space)
        nodes.append(own_node(value, "terrain_source", {"scene": scene}, remappings=topics))
    return nodes


def argument(name: str, default: str, words: str, choices: Sequence[str] | None = None) -> Any:
    """Return a launch argument with a default; ``words``: its meaning."""
    return DeclareLaunchArgument(name, default_value=default, description=words, choices=choices)


def scene_argument(words: str = "", *more: str) -> Any:
    """Return the launch argument ``scene`` of terrain_source, with ``more`` values and ``words`` about them."""
    named = f"Scene of terrain_source{'; ' * bool(words)}{words}."
    return argument("scene", SCENES[0], named, [*SCENES, *more])


def node(*, package: str = PACKAGE, executable: str, hint: str = "build and source the workspace", **more: Any) -> Any:
    """Return a launch_ros node after checking that its executable is installed; ``more`` is passed to launch_ros.

    Raises `FileNotFoundError`, which ends the launch before any node starts. The message ends with the remedy ``hint``.
    """
    installed(executable, package, hint)
    return Node(package=package, executable=executable, **more)


def own_node(value: Values, executable: str, *parameters: Any, **more: Any) -> Any:
    """Return a node of this package with ``parameters``, files and dictionaries, and what the common arguments say."""
    return node(
        executable=executable, output="screen", parameters=[*parameters, *time_of(value)],
        arguments=["--ros-args", "--log-level", value("log_level")], **{"namespace": value("namespace"), **more},
    )  # fmt: skip


def time_of(value: Values) -> list[dict[str, bool]]:
    """Return the parameter ``use_sim_time`` if the launch argument has a value. Without one it is left to
    `SetParameter` of an outer launch file, which a node's own parameters would override."""
    return [{"use_sim_time": is_true(value, "use_sim_time")}] if value("use_sim_time") else []


def is_true(value: Values, name: str) -> bool:
    """Return True if a launch argument means true. Raises `ValueError`, which ends the launch, if it means nothing."""
    text = value(name).strip().lower()
    if text not in (*TRUE, *FALSE):
        raise ValueError(f"{name}:={value(name)} is neither true nor false")
    return text in TRUE


def parameter_files(presets: Sequence[str], config: str) -> list[str]:
    """Return the parameter files of presets and of the path ``config``; empty names are skipped. Later files win.

    Raises `FileNotFoundError`, which ends the launch and names the file, if one is missing.
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
    """Return the share folder of this package."""
    return Path(get_package_share_directory(PACKAGE))


def _arguments(preset: str = "") -> list[Any]:
    profile = os.environ.get(VARIABLE, str(share() / "config" / "fastdds.xml"))
    return [
        argument("preset", preset, "Name of a parameter file in config/; empty = the node's own defaults."),
        argument("config", "", "Path of your own parameter file, read after the preset."),
        argument("namespace", "", "Namespace of the nodes."),
        argument("use_sim_time", "", "true = take the time from /clock; empty = as an outer launch file sets it."),
        argument("rviz", "false", "true = start RViz with a view of ground, bodies, robot and patches."),
        argument("dds", profile, "XML file of Fast DDS settings for large maps; empty = none."),
        argument("log_level", "info", "Least severe messages that are logged.", list(LOG_LEVELS)),
    ]


def _settings_of_dds(value: Values) -> list[Any]:
    if not value("dds"):
        return []
    file = Path(value("dds")).expanduser()
    if not file.is_file():
        raise FileNotFoundError(f"there is no file {file} of Fast DDS settings; name one, or set dds:=''")
    return [SetEnvironmentVariable(VARIABLE, str(file)), SetEnvironmentVariable(POLICY_VARIABLE, "1")]


def _rviz(value: Values, shown: str) -> list[Any]:
    if not is_true(value, "rviz"):
        return []
    namespace = value("namespace").strip("/")
    there = f"/{namespace}/{shown}" if namespace else f"/{shown}"
    return [
        node(
            package="rviz2", executable="rviz2", hint="apt install ros-jazzy-rviz2, or leave rviz:=true out",
            arguments=["-d", str(share() / "config" / "smartmesh.rviz")], parameters=time_of(value),
            remappings=[(f"/{NODE}/{topic}", f"{there}/{topic}") for topic in SHOWN],
        )
    ]  # fmt: skip
