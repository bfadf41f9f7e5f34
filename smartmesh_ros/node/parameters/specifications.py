"""The parameters of ``terrain_collider``.

The defaults are those of the core's configs and of `Settings`.
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
from smartmesh_ros.ground.config import PhysicsConfig
from smartmesh_ros.io.rasters import FirstRow, RasterConfig
from smartmesh_ros.node.fleet.peer_names import peer_names
from smartmesh_ros.node.inputs.body_sources import body_sources
from smartmesh_ros.node.outputs.scan_entries import scan_entries
from smartmesh_ros.node.parameters import declaring
from smartmesh_ros.node.parameters.declaring import Spec
from smartmesh_ros.node.parameters.settings import (
    LONGEST_NAME,
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
from smartmesh_ros.patches.config import CollectMethod, PatchConfig, PatchKind, SearchMethod
from smartmesh_ros.terrain.motion import Changes, MotionConfig, MotionMode
from smartmesh_ros.world.guest_config import GuestConfig
from smartmesh_ros.world.world import WorldConfig

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

ConfigT = TypeVar("ConfigT", bound="DataclassInstance")

_D = Settings()
_PHYSICS, _PATCH, _RASTER = _D.world.physics, _D.world.patch, _D.raster

SPECS = (
    Spec("physics.rate", _PHYSICS.rate, "Physics steps per second [Hz].", 1.0, 10_000.0),
    Spec(
        "physics.gravity", list(_PHYSICS.gravity),
        "Gravity in the terrain's frame [m/s^2], three numbers.",
        -1000.0, 1000.0,
    ),
    Spec(
        "physics.friction", _PHYSICS.friction,
        "Coulomb friction coefficient of simulated bodies, and of links of robots without <contact>, spawned after the "
        "change.",
        0.0, 10.0,
    ),
    Spec(
        "physics.restitution", _PHYSICS.restitution,
        "Coefficient of restitution of simulated bodies, and of links of robots without <contact>, spawned after the "
        "change.",
        0.0, 1.0,
    ),
    Spec("physics.guard", _PHYSICS.guard, "Put bodies that are below the ground back onto it."),
    Spec(
        "physics.sleep", _PHYSICS.sleep,
        "Bodies at rest on ground at rest sleep, without a collider, until anything comes near or the ground changes.",
    ),
    Spec(
        "physics.solver_residual", _PHYSICS.solver_residual,
        "The solver stops iterating once the squared change of every contact's velocity is below this [m^2/s^2]; "
        "higher is faster and less accurate.",
        0.0, 1.0,
    ),
    Spec(
        "physics.contact_erp", _PHYSICS.contact_erp,
        "Fraction of a penetration that the solver corrects in one step.",
        0.01, 1.0,
    ),
    Spec(
        "physics.deadline", _D.deadline,
        "What happens to late steps. skip: leave them out; catch_up: run them as soon as possible; slow_down: delay "
        "all later steps, so that simulated time runs slower than real time.",
        choices=get_args(DeadlinePolicy),
    ),
    Spec(
        "search.method", _PATCH.search,
        "Search for the vertex nearest to a body, of patches that are shown or are colliders.",
        choices=get_args(SearchMethod),
    ),
    Spec(
        "collect.method", _PATCH.collect,
        "Collection of the vertices of a patch that is shown or is a collider.",
        choices=get_args(CollectMethod),
    ),
    Spec(
        "patch.kind", _PATCH.kind,
        "What bodies collide with; auto: the map itself. The other kinds are colliders of PyBullet's own, for "
        "comparisons.",
        choices=get_args(PatchKind),
    ),
    Spec(
        "patch.rings", _PATCH.rings,
        "Samples of a patch on each side of the nearest vertex; 0 = as many as the body and its motion need.",
        0, 4,
    ),
    Spec(
        "patch.rate", _PATCH.rate,
        "Refresh rate of the patches [Hz]; new maps raise it up to twofold. 0 = refresh in every step.",
        0.0, 100_000.0,
    ),
    Spec(
        "patch.carry_velocity", _PATCH.carry_velocity,
        "Pass the ground's velocity to the contacts, so that moving ground carries bodies along.",
    ),
    Spec(
        "terrain.motion", _D.motion.mode,
        "Motion of the ground between maps. hold: stay at the last map; extrapolate: continue with the estimated "
        "velocity; interpolate: follow the maps one map late.",
        choices=get_args(MotionMode),
    ),
    Spec(
        "terrain.max_interval", _D.motion.max_interval,
        "Longest time between two maps from which velocity is estimated, and longest delay of maps over which the "
        "ground is extrapolated [s].",
        0.001, 60.0,
    ),
    Spec(
        "terrain.max_velocity", _D.motion.max_velocity,
        "Highest estimated velocity [m/s]; a faster change of height counts as a jump, without velocity.",
        0.01, 1000.0,
    ),
    Spec(
        "terrain.min_interval", _D.motion.min_interval,
        "Maps that follow each other sooner are treated as parts of one map, without velocity of their own [s].",
        0.0, 1.0,
    ),
    Spec(
        "terrain.changes", "auto",
        "Meaning of a change of height between maps. motion: the ground moved; correction: the ground stood still "
        "and the new map is more accurate. auto: motion if terrain.input is heightmap, else correction.",
        choices=get_args(TerrainChanges),
    ),
    Spec("terrain.settle", _D.motion.settle, "Time over which a correction is applied [s].", 0.001, 10.0),
    Spec(
        "terrain.noise", _D.motion.noise,
        "Standard deviation of a map's heights [m]; 0 = exact. Weights the fusion of corrected heights over time, "
        "and reduces estimated velocities by the share that noise explains.",
        0.0, 10.0,
    ),
    Spec(
        "terrain.max_samples", _D.max_samples,
        "Most samples in all maps together; maps that exceed them are refused.",
        9, 2**31,
    ),
    Spec("terrain.max_tiles", _D.most_tiles, "Most tiles; more are refused.", 1, 1_000_000),
    Spec(
        "terrain.durability", _D.durability,
        "QoS durability of the map subscriptions; transient_local receives the last map of a latched publisher, but "
        "nothing from a volatile publisher.",
        choices=get_args(Durability), read_only=True,
    ),
    Spec(
        "terrain.reliability", _D.reliability,
        "QoS reliability of the map subscriptions; best_effort also receives maps of best-effort publishers, such as "
        "cameras, but may lose messages.",
        choices=get_args(Reliability), read_only=True,
    ),
    Spec(
        "terrain.input", _D.input,
        "Additional terrain topic, ~/<input>; the node always subscribes to the heightmap and mesh topics.",
        choices=get_args(TerrainInput), read_only=True,
    ),
    Spec("terrain.file", _D.file, "Terrain at start: a .npy, .png, .tif or .asc file; empty = none.", read_only=True),
    Spec("raster.layer", _RASTER.layer, "Layer of a grid map that holds the heights."),
    Spec(
        "raster.variance_layer", _RASTER.variance_layer,
        "Layer of a grid map that holds the variances of the heights [m^2], which weight their fusion; empty = none, "
        "use terrain.noise.",
    ),
    Spec(
        "raster.scale", _RASTER.scale,
        "Height = scale x value + offset [m per unit]. Values are pixel values, metres, or occupancies from 0 to 1.",
        -1e6, 1e6,
    ),
    Spec("raster.offset", _RASTER.offset, "Height at value zero [m].", -1e6, 1e6),
    Spec(
        "raster.resolution", _RASTER.resolution,
        "Distance between the samples of images and plain files [m].",
        1e-4, 1e4,
    ),
    Spec(
        "raster.origin", list(_RASTER.origin),
        "Position of the bottom left sample of images and plain files [m], three numbers.",
        -1e9, 1e9,
    ),
    Spec("raster.yaw", _RASTER.yaw, "Rotation of images and plain files about z [rad].", -math.pi, math.pi),
    Spec(
        "raster.first_row", _RASTER.first_row,
        "Side of the first row of images and plain files: the top, where y is largest, or the bottom.",
        choices=get_args(FirstRow),
    ),
    Spec("raster.zero_is_hole", _RASTER.zero_is_hole, "Treat zero in images and plain files as a hole."),
    Spec("terrain.map_depth", _D.map_depth, "Queue depth of the subscriptions to whole maps.", 1, 1000, read_only=True),
    Spec(
        "terrain.update_depth", _D.update_depth,
        "Queue depth of the subscriptions to map updates.",
        1, 100_000, read_only=True,
    ),
    Spec(
        "bodies.timeout", _D.body_timeout,
        "Remove a tracked body after this long without a pose [s]; it stops after half a second without one.",
        0.01, 3600.0,
    ),
    Spec(
        "bodies.max_velocity", _D.max_velocity,
        "Highest velocity of a tracked body that is estimated from successive poses [m/s]; a faster change counts as a "
        "jump, without velocity, and is reported.",
        0.01, 1000.0,
    ),
    Spec(
        "bodies.default_radius", _D.default_radius,
        "Radius of tracked bodies whose messages give none [m].",
        0.001, 100.0,
    ),
    Spec("bodies.spawn", list(_D.spawn), "Bodies spawned at start, each a YAML mapping; see config/.", read_only=True),
    Spec("bodies.most", _D.most_bodies, "Most bodies, tracked and simulated; more are refused.", 1, 1_000_000),
    Spec("bodies.longest_urdf", _D.longest_urdf, "Longest robot description [bytes].", 1, 2**31),
    Spec(
        "bodies.urdf_folders", list(_D.urdf_folders),
        "Folders from which services may load robot descriptions and their meshes; empty = pybullet_data and the "
        "share folders of the installed packages.",
        read_only=True,
    ),
    Spec(
        "bodies.poses", [],
        "Topics of geometry_msgs/PoseStamped, each for one tracked body: 'name=topic', or a topic alone, which also "
        "names the body.",
        read_only=True,
    ),
    Spec(
        "bodies.odometry", [],
        "Topics of nav_msgs/Odometry, each for one tracked body: 'name=topic', or a topic alone.",
        read_only=True,
    ),
    Spec("bodies.frames", [], "TF frames to follow as tracked bodies: 'name=frame', or a frame alone.", read_only=True),
    Spec(
        "bodies.peers", [],
        "Other terrain_collider nodes, by fully qualified name, whose bodies collide with those of this node; auto = "
        "all discovered nodes with the same terrain frame.",
        read_only=True,
    ),
    Spec(
        "bodies.peer_margin", _D.world.guests.margin,
        "Distance between a peer's body and a body of this node below which this node also simulates the peer's "
        "body, as a guest [m]; fast bodies earlier.",
        0.01, 1000.0,
    ),
    Spec(
        "robot.description", _D.robot.description,
        "URDF of a robot, or the path of a URDF file; empty = the robot on ~/robot_description, if any.",
        read_only=True,
    ),
    Spec("robot.name", _D.robot.name, "Name of that robot.", read_only=True),
    Spec(
        "robot.xy", list(_D.robot.xy),
        "Start position of the root link's centre of mass [m], two numbers.",
        -1e9, 1e9, read_only=True,
    ),
    Spec(
        "robot.above", _D.robot.above,
        "Start height of that centre of mass above the ground [m].",
        -1e4, 1e4, read_only=True,
    ),
    Spec("robot.yaw", _D.robot.yaw, "Start rotation about z [rad].", -math.pi, math.pi, read_only=True),
    Spec("publish.patches", _D.publish.patches, "Rate of ~/patches [Hz]; 0 = never.", 0.0, 1000.0),
    Spec("publish.collider_patches", _D.publish.collider_patches, "Rate of ~/collider_patches [Hz].", 0.0, 1000.0),
    Spec("publish.body_states", _D.publish.body_states, "Rate of ~/body_states [Hz].", 0.0, 1000.0),
    Spec("publish.contacts", _D.publish.contacts, "Rate of ~/contacts [Hz].", 0.0, 1000.0),
    Spec("publish.timing", _D.publish.timing, "Rate of ~/timing [Hz].", 0.0, 1000.0),
    Spec(
        "publish.incremental", _D.incremental,
        "Publish only changed patches on ~/patches and ~/collider_patches, and all patches when a subscriber joins "
        "and every 5 s.",
    ),
    Spec(
        "publish.marker_namespace", _D.marker_namespace,
        "Field ns of the markers on ~/patches, to distinguish several nodes on one topic.",
        read_only=True,
    ),
    Spec(
        "publish.clock", _D.publish.clock,
        "Rate of /clock, which carries simulated time [Hz]; 0 = never.",
        0.0, 10_000.0,
    ),
    Spec(
        "publish.durability", _D.output_durability,
        "QoS durability of the outputs; transient_local sends the last publish.depth messages to late subscribers.",
        choices=get_args(Durability), read_only=True,
    ),
    Spec("publish.depth", _D.output_depth, "Queue depth of each output.", 1, 10_000, read_only=True),
    Spec("publish.joint_states", _D.publish.joint_states, "Rate of ~/joint_states [Hz].", 0.0, 1000.0),
    Spec(
        "publish.robot_prefix", _D.robot_prefix,
        "Joints and frames of every robot are named <robot>/<name>. false: those of the first robot have the names of "
        "its URDF, as robot_state_publisher expects. Names do not change while their robot is there.",
        read_only=True,
    ),
    Spec(
        "publish.tf", _D.publish.tf,
        "Rate of the frames of simulated bodies and robots on /tf [Hz]; 0 = never. Frames that other nodes publish are "
        "left out.",
        0.0, 1000.0,
    ),
    Spec("publish.odometry", _D.publish.odometry, "Rate of ~/odometry for each robot [Hz].", 0.0, 1000.0),
    Spec("publish.contact_wrenches", _D.publish.contact_wrenches, "Rate of ~/contact_wrenches [Hz].", 0.0, 1000.0),
    Spec(
        "simulation_interfaces", _D.simulation_interfaces,
        "Serve the standard services of simulation_interfaces.",
        read_only=True,
    ),
    Spec(
        "height_scans", [],
        "Height scans on ~/height_scan/<body>, each a YAML mapping such as {body: robot, layout: isaac_lab, rate: 50, "
        "noise: 0.01}; see docs/height_scan.md.",
        read_only=True,
    ),
    Spec("frame_id", _D.frame_id, "Frame of the terrain; empty = the frame of the first map.", read_only=True),
    Spec(
        "executor", _D.executor,
        "The rclpy executor that waits for messages.",
        choices=get_args(ExecutorKind), read_only=True,
    ),
)  # fmt: skip
NAMES = frozenset(spec.name for spec in SPECS)


# Field of `Settings` -> the parameter whose value it takes unchanged.
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
    "longest_urdf": "bodies.longest_urdf",
    "urdf_folders": "bodies.urdf_folders",
    "body_timeout": "bodies.timeout",
    "max_velocity": "bodies.max_velocity",
    "default_radius": "bodies.default_radius",
    "spawn": "bodies.spawn",
    "output_durability": "publish.durability",
    "output_depth": "publish.depth",
    "incremental": "publish.incremental",
    "marker_namespace": "publish.marker_namespace",
    "robot_prefix": "publish.robot_prefix",
}


# Parameters of earlier versions, and what replaces them.
REMOVED = {
    "bodies.longest_name": f"names have at most {LONGEST_NAME} characters; leave it out",
    "patch.edge_filter": "contacts from the map have no inner edges; leave it out",
    "patch.tolerance": "contacts from the map are exact; leave it out",
    "physics.landing": "contacts from the map stop bodies at the surface; leave it out",
}


def settings_from(values: Mapping[str, Any]) -> Settings:
    """Return the settings for the values of all parameters; raises `InputError` for the first invalid value."""
    v = declaring.checked(values, SPECS)
    v = {name: tuple(value) if isinstance(value, list) else value for name, value in v.items()}
    v["terrain.changes"] = _changes(v["terrain.changes"], v["terrain.input"])
    own: dict[str, Any] = {field: v[name] for field, name in _SETTINGS.items()}
    own |= body_sources({name: v[f"bodies.{name}"] for name in ("poses", "odometry", "frames")})
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
        peers=peer_names(v["bodies.peers"]),
        height_scans=scan_entries(v["height_scans"]),
        **own,
    )


def _config(kind: type[ConfigT], group: str, values: Mapping[str, Any], **names: str) -> ConfigT:
    """Return a config whose fields are the values of the parameters ``<group>.<field>``, or ``names[field]``."""
    return kind(**{field.name: values[names.get(field.name, f"{group}.{field.name}")] for field in fields(kind)})


def _changes(value: str, terrain_input: str) -> Changes:
    """Return the meaning of a change of height; for *auto*, maps of sensors and mappers are corrections."""
    if value == "auto":
        return "motion" if terrain_input == "heightmap" else "correction"
    return "motion" if value == "motion" else "correction"


def declare(node: Node) -> Settings:
    """Declares the node's parameters and returns its settings; raises `InputError` if they are invalid."""
    settings = settings_from(declaring.declare(node, SPECS, REMOVED))
    require_one_clock(settings.publish.clock, node.get_parameter("use_sim_time").value)
    return settings


def current_settings(node: Node) -> Settings:
    """Return the settings for the current values of the parameters."""
    return settings_from(declaring.current_values(node, SPECS))


def check_change(node: Node, changes: list[Parameter], check: Callable[[Settings], None]) -> SetParametersResult:
    """Return whether all ``changes`` together are valid; for the on-set callback, which changes nothing itself.

    ``check`` raises `InputError` if it rejects the resulting settings.
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
