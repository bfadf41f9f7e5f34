"""The parameters of ``terrain_collider``.

Defaults live in the core's configurations and in `Settings`; this module reads them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import fields
from typing import TYPE_CHECKING, Any, TypeVar, get_args

from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter

from smartmesh_ros.errors import InputError
from smartmesh_ros.io.rasters import FirstRow, RasterConfig
from smartmesh_ros.node.fleet.peer_names import peer_names
from smartmesh_ros.node.inputs.body_sources import body_sources
from smartmesh_ros.node.parameters import declaring
from smartmesh_ros.node.parameters.declaring import Spec
from smartmesh_ros.node.parameters.settings import (
    Durability,
    PublishRates,
    Reliability,
    RobotConfig,
    Settings,
    TerrainChanges,
    TerrainInput,
)
from smartmesh_ros.node.running import ExecutorKind
from smartmesh_ros.node.timing.clock import require_one_clock
from smartmesh_ros.node.timing.pacing import DeadlinePolicy
from smartmesh_ros.patches.config import PatchConfig, PatchKind
from smartmesh_ros.patches.report.collect import CollectMethod
from smartmesh_ros.physics.config import PhysicsConfig
from smartmesh_ros.physics.guest_config import GuestConfig
from smartmesh_ros.physics.world import WorldConfig
from smartmesh_ros.search.methods import SearchMethod
from smartmesh_ros.terrain.motion import Changes, MotionConfig, MotionMode

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

ConfigT = TypeVar("ConfigT", bound="DataclassInstance")

_D = Settings()
_PHYSICS, _PATCH, _RASTER = _D.world.physics, _D.world.patch, _D.raster

SPECS = (
    Spec("physics.rate", _PHYSICS.rate, "Physics steps per second [Hz].", 1.0, 10_000.0),
    Spec("physics.gravity", list(_PHYSICS.gravity), "Gravity in the terrain's frame [m/s^2], three numbers.",
         -1000.0, 1000.0),
    Spec("physics.friction", _PHYSICS.friction, "Friction of simulated bodies spawned from now on.", 0.0, 10.0),
    Spec("physics.restitution", _PHYSICS.restitution, "Restitution of bodies spawned from now on.", 0.0, 1.0),
    Spec("physics.guard", _PHYSICS.guard, "Bodies found below the ground are put back onto it."),
    Spec("physics.landing", _PHYSICS.landing, "Bodies that would run into the ground in a step arrive at its surface."),
    Spec(
        "physics.solver_residual", _PHYSICS.solver_residual, "The solver's iterations end once none changes a "
        "contact's velocity by more than its root [m^2/s^2].", 0.0, 1.0,
    ),
    Spec("physics.contact_erp", _PHYSICS.contact_erp, "Share of a penetration corrected in a step.", 0.01, 1.0),
    Spec(
        "physics.deadline", _D.deadline, "What becomes of steps that are late: they are skipped, run as soon as "
        "possible, or slow simulated time down.", choices=get_args(DeadlinePolicy),
    ),
    Spec("search.method", _PATCH.search, "How the nearest vertex is found.", choices=get_args(SearchMethod)),
    Spec("collect.method", _PATCH.collect, "How the vertices of a patch are found.", choices=get_args(CollectMethod)),
    Spec(
        "patch.kind", _PATCH.kind, "Collider of a patch; auto: none, a plane or the smallest heightfield within "
        "patch.tolerance.", choices=get_args(PatchKind),
    ),
    Spec("patch.rings", _PATCH.rings, "Samples on each side of the nearest vertex; 0 = from the body's size.", 0, 4),
    Spec("patch.tolerance", _PATCH.tolerance, "How far a patch may lie from the terrain [m].", 1e-6, 10.0),
    Spec(
        "patch.rate", _PATCH.rate, "Patches follow bodies and ground so often, and as maps come up to twice as often "
        "[Hz]; 0 = at every step.", 0.0, 100_000.0,
    ),
    Spec("patch.edge_filter", _PATCH.edge_filter, "No ghost collisions at the inner edges of patches."),
    Spec("patch.carry_velocity", _PATCH.carry_velocity, "Patches carry the ground's velocity into contacts."),
    Spec("terrain.motion", _D.motion.mode, "What the ground does between maps.", choices=get_args(MotionMode)),
    Spec("terrain.max_interval", _D.motion.max_interval, "Maps further apart give no velocity [s].", 0.001, 60.0),
    Spec("terrain.max_velocity", _D.motion.max_velocity, "Faster ground has jumped, not moved [m/s].", 0.01, 1000.0),
    Spec("terrain.min_interval", _D.motion.min_interval, "Maps closer together are one map that came in parts [s].",
         0.0, 1.0),
    Spec(
        "terrain.changes", "auto", "What a change of height means: the ground moved, or stood still and is known "
        "better now. auto: correction, but motion where terrain.input is heightmap.", choices=get_args(TerrainChanges),
    ),
    Spec("terrain.settle", _D.motion.settle, "Corrections are spread over so long [s].", 0.001, 10.0),
    Spec("terrain.noise", _D.motion.noise, "Standard deviation of the heights of a map [m]; 0 = exact. Corrected "
         "heights are fused over time by it; velocities count as far as they stand out of it.", 0.0, 10.0),
    Spec("terrain.max_samples", _D.max_samples, "Samples of all maps together; more are refused.", 9, 2**31),
    Spec("terrain.max_tiles", _D.most_tiles, "Tiles there may be; more are refused.", 1, 1_000_000),
    Spec(
        "terrain.durability", _D.durability, "QoS durability of the map subscriptions; transient_local gets the last "
        "map of a latched publisher, and nothing from a volatile one.", choices=get_args(Durability), read_only=True,
    ),
    Spec(
        "terrain.reliability", _D.reliability, "QoS reliability of the map subscriptions; best_effort also takes maps "
        "from best-effort publishers, such as cameras, and may lose some.", choices=get_args(Reliability),
        read_only=True,
    ),
    Spec(
        "terrain.input", _D.input, "Topic that brings the terrain, ~/<input>, beside the heightmap topics, which are "
        "always there.", choices=get_args(TerrainInput), read_only=True,
    ),
    Spec("terrain.file", _D.file, "Terrain at start: a .npy, .png, .tif or .asc file; empty = none.", read_only=True),
    Spec("raster.layer", _RASTER.layer, "Layer of a grid map that holds the heights."),
    Spec("raster.variance_layer", _RASTER.variance_layer, "Layer of a grid map that holds the variances of the heights "
         "[m^2], to fuse them by; empty = none, terrain.noise says it."),
    Spec("raster.scale", _RASTER.scale, "Height = scale x value + offset [m per unit]. Values are pixels, metres or, "
         "of occupancy, 0 to 1.", -1e6, 1e6),
    Spec("raster.offset", _RASTER.offset, "Height of the value zero [m].", -1e6, 1e6),
    Spec("raster.resolution", _RASTER.resolution, "Distance between the samples of images and plain files [m].",
         1e-4, 1e4),
    Spec("raster.origin", list(_RASTER.origin), "Where the bottom left sample of images and plain files lies [m], "
         "three numbers.", -1e9, 1e9),
    Spec("raster.yaw", _RASTER.yaw, "Turn of images and plain files about z [rad].", -math.pi, math.pi),
    Spec("raster.first_row", _RASTER.first_row, "Whether the first row of images and plain files is at the top, where "
         "y is largest, or at the bottom.", choices=get_args(FirstRow)),
    Spec("raster.zero_is_hole", _RASTER.zero_is_hole, "In images and plain files zero means no ground."),
    Spec("terrain.map_depth", _D.map_depth, "Whole maps that may wait to be taken.", 1, 1000, read_only=True),
    Spec("terrain.update_depth", _D.update_depth, "Updates that may wait.", 1, 100_000, read_only=True),
    Spec("bodies.timeout", _D.body_timeout, "A tracked body not heard of for so long is gone; it stops "
         "after half a second [s].", 0.01, 3600.0),
    Spec("bodies.default_radius", _D.default_radius, "Radius of tracked bodies that give none [m].", 0.001, 100.0),
    Spec("bodies.spawn", list(_D.spawn), "Bodies spawned at start, each a YAML mapping; see config/.", read_only=True),
    Spec("bodies.most", _D.most_bodies, "Tracked and simulated bodies there may be; more are refused.", 1, 1_000_000),
    Spec("bodies.longest_name", _D.longest_name, "Characters of the name of a body, a tile or a frame.", 1, 65_535),
    Spec("bodies.longest_urdf", _D.longest_urdf, "Bytes of a robot description.", 1, 2**31),
    Spec(
        "bodies.urdf_folders", list(_D.urdf_folders), "Folders that robot descriptions and their meshes may come from, "
        "when a service names them; empty = pybullet_data and the share folders of the installed packages.",
        read_only=True,
    ),
    Spec("bodies.poses", [], "Topics of geometry_msgs/PoseStamped, each of one tracked body: 'name=topic', or a topic "
         "alone, which names it.", read_only=True),
    Spec("bodies.odometry", [], "Topics of nav_msgs/Odometry, each of one tracked body: 'name=topic', or a topic "
         "alone.", read_only=True),
    Spec("bodies.frames", [], "TF frames that are tracked bodies: 'name=frame', or a frame alone.", read_only=True),
    Spec("bodies.peers", [], "Other terrain_collider nodes, by full name, whose bodies meet those of this one; auto = "
         "all that are found on the same terrain frame.", read_only=True),
    Spec("bodies.peer_margin", _D.world.guests.margin, "Bodies of peers that come so near to an own one are simulated "
         "here as well, as guests [m]; fast ones sooner.", 0.01, 1000.0),
    Spec("robot.description", _D.robot.description, "URDF of a robot, or the path of a URDF file; empty = the robot "
         "that ~/robot_description brings, if any.", read_only=True),
    Spec("robot.name", _D.robot.name, "What that robot is called.", read_only=True),
    Spec("robot.xy", list(_D.robot.xy), "Where the centre of mass of its root link starts [m], two numbers.", -1e9, 1e9,
         read_only=True),
    Spec("robot.above", _D.robot.above, "How far above the ground it starts [m].", -1e4, 1e4, read_only=True),
    Spec("robot.yaw", _D.robot.yaw, "Turn about z that it starts with [rad].", -math.pi, math.pi, read_only=True),
    Spec("publish.patches", _D.publish.patches, "Rate of ~/patches [Hz]; 0 = never.", 0.0, 1000.0),
    Spec("publish.collider_patches", _D.publish.collider_patches, "Rate of ~/collider_patches [Hz].", 0.0, 1000.0),
    Spec("publish.body_states", _D.publish.body_states, "Rate of ~/body_states [Hz].", 0.0, 1000.0),
    Spec("publish.contacts", _D.publish.contacts, "Rate of ~/contacts [Hz].", 0.0, 1000.0),
    Spec("publish.timing", _D.publish.timing, "Rate of ~/timing [Hz].", 0.0, 1000.0),
    Spec("publish.incremental", _D.incremental, "~/patches and ~/collider_patches hold only the patches that changed, "
         "and all of them when a subscriber joins and every 5 s."),
    Spec("publish.marker_namespace", _D.marker_namespace, "The ns of the markers on ~/patches, where several nodes "
         "publish on one topic.", read_only=True),
    Spec("publish.clock", _D.publish.clock, "Rate of /clock, with simulated time [Hz]; 0 = never.", 0.0, 10_000.0),
    Spec(
        "publish.durability", _D.output_durability, "QoS durability of the outputs; transient_local keeps the last "
        "publish.depth messages for late joiners.", choices=get_args(Durability), read_only=True,
    ),
    Spec("publish.depth", _D.output_depth, "Messages of an output that are kept until they are delivered.", 1, 10_000,
         read_only=True),
    Spec("publish.joint_states", _D.publish.joint_states, "Rate of ~/joint_states [Hz].", 0.0, 1000.0),
    Spec("publish.odometry", _D.publish.odometry, "Rate of ~/odometry, of each robot [Hz].", 0.0, 1000.0),
    Spec("publish.contact_wrenches", _D.publish.contact_wrenches, "Rate of ~/contact_wrenches [Hz].", 0.0, 1000.0),
    Spec("simulation_interfaces", _D.simulation_interfaces, "Serve the standard services of simulation_interfaces.",
         read_only=True),
    Spec("frame_id", _D.frame_id, "Frame of the terrain; empty = that of the first map.", read_only=True),
    Spec("executor", _D.executor, "How rclpy waits for messages.", choices=get_args(ExecutorKind), read_only=True),
)  # fmt: skip
NAMES = frozenset(spec.name for spec in SPECS)


# Field of `Settings` -> the parameter that sets it, for the fields that one parameter sets as it is.
_SETTINGS = {
    "frame_id": "frame_id",
    "simulation_interfaces": "simulation_interfaces",
    "executor": "executor",
    "deadline": "physics.deadline",
    "durability": "terrain.durability",
    "reliability": "terrain.reliability",
    "input": "terrain.input",
    "file": "terrain.file",
    "max_samples": "terrain.max_samples",
    "most_tiles": "terrain.max_tiles",
    "map_depth": "terrain.map_depth",
    "update_depth": "terrain.update_depth",
    "most_bodies": "bodies.most",
    "longest_name": "bodies.longest_name",
    "longest_urdf": "bodies.longest_urdf",
    "urdf_folders": "bodies.urdf_folders",
    "body_timeout": "bodies.timeout",
    "default_radius": "bodies.default_radius",
    "spawn": "bodies.spawn",
    "output_durability": "publish.durability",
    "output_depth": "publish.depth",
    "incremental": "publish.incremental",
    "marker_namespace": "publish.marker_namespace",
}


def settings_from(values: Mapping[str, Any]) -> Settings:
    """Settings from the values of all parameters; raises `InputError` naming the first that cannot be."""
    v = declaring.checked(values, SPECS)
    v = {name: tuple(value) if isinstance(value, list) else value for name, value in v.items()}
    v["terrain.changes"] = _changes(v["terrain.changes"], v["terrain.input"])
    return Settings(
        world=WorldConfig(
            physics=_config(PhysicsConfig, "physics", v),
            patch=_config(PatchConfig, "patch", v, search="search.method", collect="collect.method"),
            guests=GuestConfig(margin=v["bodies.peer_margin"]),
        ),
        motion=_config(MotionConfig, "terrain", v, mode="terrain.motion"),
        publish=_config(PublishRates, "publish", v),
        raster=_config(RasterConfig, "raster", v),
        robot=_config(RobotConfig, "robot", v),
        **body_sources({name: v[f"bodies.{name}"] for name in ("poses", "odometry", "frames")}),
        peers=peer_names(v["bodies.peers"]),
        **{field: v[name] for field, name in _SETTINGS.items()},
    )


def _config(kind: type[ConfigT], group: str, values: Mapping[str, Any], **names: str) -> ConfigT:
    """Return a config whose fields are the values of the parameters ``<group>.<field>``, or ``names[field]``."""
    return kind(**{field.name: values[names.get(field.name, f"{group}.{field.name}")] for field in fields(kind)})


def _changes(said: str, terrain_input: str) -> Changes:
    """What changes of height mean; what sensors and mappers publish are corrections unless it is said otherwise."""
    if said == "auto":
        return "motion" if terrain_input == "heightmap" else "correction"
    return "motion" if said == "motion" else "correction"


def declare(node: Node) -> Settings:
    """Declares the node's parameters and returns its settings; raises `InputError` if they are impossible."""
    settings = settings_from(declaring.declare(node, SPECS))
    require_one_clock(settings.publish.clock, node.get_parameter("use_sim_time").value)
    return settings


def current_settings(node: Node) -> Settings:
    """Settings as the parameters are now."""
    return settings_from(declaring.current_values(node, SPECS))


def check_change(node: Node, changes: list[Parameter], check: Callable[[Settings], None]) -> SetParametersResult:
    """Whether a set of changes is possible as a whole; for the on-set callback, which changes nothing itself.

    ``check`` may object to the settings there would be by raising `InputError`.
    """
    try:
        known = {change.name: declaring.plain_value(change) for change in changes if change.name in NAMES}
        settings = settings_from({**declaring.current_values(node, SPECS), **known})
        sim_time = [change.value for change in changes if change.name == "use_sim_time"]
        require_one_clock(settings.publish.clock, (sim_time or [node.get_parameter("use_sim_time").value])[-1])
        check(settings)
    except InputError as error:
        return SetParametersResult(successful=False, reason=str(error))
    return SetParametersResult(successful=True)
