"""The parameters of ``terrain_collider``, the `Settings` that they give, and log lines about them."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cache, partial, reduce
from types import MappingProxyType
from typing import Any, Literal, TypeVar, get_args, get_origin, get_type_hints

from rclpy.node import Node

from smartmesh_ros.errors import InputError, listed, naming
from smartmesh_ros.node.inputs.adapters import ADAPTERS
from smartmesh_ros.node.inputs.optional_messages import class_of
from smartmesh_ros.node.parameters import declaring
from smartmesh_ros.node.parameters.declaring import ParameterNode, Spec
from smartmesh_ros.node.parameters.entries import deck_entries, output_entries, shape_entries
from smartmesh_ros.node.parameters.helping import files_of, mismatch, set_one_by_one, source_of
from smartmesh_ros.node.parameters.settings import Settings, TerrainChanges, body_sources, peer_names
from smartmesh_ros.terrain.motion import MOST_SMOOTHING
from smartmesh_ros.world.paths import expanded

ConfigT = TypeVar("ConfigT")

DEFAULTS = Settings()
_types: Callable[[Any], dict[str, Any]] = cache(get_type_hints)  # of a config's fields


# Places in the settings of groups of parameters with other names; that of the others is their name.
PLACES = {"physics": "world.physics.", "terrain": "motion.", "bodies": "", "robot": "robot_"}


def _param(
    name: str, about: str, low: float = -math.inf, high: float = math.inf, *, place: str = "", fixed: bool = False
) -> Spec:
    """Return the parameter for a field of the settings, from which it has its default and choices. ``place``: of the
    field, if its group and name do not tell."""
    group, dot, field = name.rpartition(".")
    place = place or PLACES.get(group, group + dot) + field
    *owners, field = place.split(".")
    owner: Any = reduce(getattr, owners, DEFAULTS)
    default, kind = getattr(owner, field), _types(type(owner))[field]
    choices = get_args(kind) if get_origin(kind) is Literal else ()
    return Spec(name, list(default) if isinstance(default, tuple) else default, about, low, high, choices, fixed, place)


_fixed = partial(_param, fixed=True)


# Of each parameter the name, the meaning, and the bounds.
SPECS = (
    _param("physics.rate", "Physics steps per second [Hz].", 1.0, 10_000.0),
    _param("physics.gravity", "Gravity in the terrain's frame [m/s^2], three numbers.", -1000.0, 1000.0),
    _param("physics.friction", "Coulomb friction coefficient of simulated bodies, and of links of robots without "
        "<contact>, spawned after the change.", 0.0, 10.0),
    _param("physics.restitution", "Coefficient of restitution of simulated bodies, and of links of robots without "
        "<contact>, spawned after the change.", 0.0, 1.0),
    _param("physics.sleep", "Bodies at rest on ground at rest sleep, until anything touches or moves them or the "
        "ground changes."),
    _param("physics.solver_residual", "The solver stops iterating once the squared change of every contact's velocity "
        "is below this [m^2/s^2]; higher is faster and less accurate.", 0.0, 1.0),
    _param("physics.deadline", "What happens to late steps. skip: leave them out; catch_up: run them as soon as "
        "possible; slow_down: delay all later steps, so that simulated time runs slower than real time.",
        place="deadline"),
    _param("terrain.motion", "Motion of the ground between maps. hold: stay at the last map; extrapolate: continue "
        "with the estimated velocity and acceleration; interpolate: follow the maps one map interval late, on smooth "
        "curves.",
        place="motion.mode"),
    _param("terrain.smoothing", "Time in which extrapolated ground goes over to the motion of a new map [map "
        "intervals]; 0 = at once, with a jump. Higher makes forces on bodies smoother, and places less exact.",
        0.0, MOST_SMOOTHING, place="motion.smoothing"),
    _param("terrain.max_interval", "Longest time between two maps from which velocity is estimated, and longest delay "
        "of maps over which the ground is extrapolated [s].", 0.001, 60.0),
    _param("terrain.max_velocity", "Highest estimated velocity [m/s]; a faster change of height counts as a jump, "
        "without velocity.", 0.01, 1000.0),
    Spec("terrain.changes", "auto",
        "Meaning of a change of height between maps. motion: the ground moved; correction: the ground stood still and "
        "the new map is more accurate. auto: motion if "
        "terrain.input is heightmap, else correction.", choices=get_args(TerrainChanges), place="motion.changes"),
    _param("terrain.settle", "Time over which a correction is applied [s].", 0.001, 10.0),
    _param("terrain.noise", "Standard deviation of a map's heights [m]; 0 = exact. Weights the fusion of corrected "
        "heights over time, and reduces estimated velocities by the share that noise explains.", 0.0, 10.0),
    Spec("terrain.input", DEFAULTS.input,
        "Additional terrain topic, ~/<input>; the node always subscribes to the heightmap and mesh topics.",
        choices=("heightmap", *ADAPTERS), read_only=True, place="input"),
    _fixed("terrain.file", "Terrain at start: a .npy, .png, .tif or .asc file; empty = none.", place="file"),
    _param("soil.type", "Soils that bodies stand on where the first tile is a height map, by their names in "
        "docs/soil.md; empty = none. The field soil of a map says which one each sample is; by default the first.",
        place="soil"),
    _param("soil.slip_sinkage", "Wheels that slip dig themselves in. false: for robots that turn by the slip of their "
        "wheels, which dig in until they turn no more.", place="slip_sinkage"),
    _param("raster.layer", "Layer of a grid map that holds the heights."),
    _param("raster.variance_layer", "Layer of a grid map that holds the variances of the heights [m^2], which weight "
        "their fusion; empty = none, use terrain.noise."),
    _param("raster.material_layers", "Layers of a grid map that hold the material of the ground, docs/materials.md: "
        "friction, stiffness, damping, restitution, rolling, soil. friction=slip: the friction in the layer slip; "
        "friction: in the layer of this name. Empty = none."),
    _param("raster.scale", "Height = scale x value [m per unit]. Values are pixel values, metres, or occupancies from "
        "0 to 1.", -1_000_000.0, 1_000_000.0),
    _param("raster.resolution", "Distance between the samples of images and plain files [m].", 0.0001, 10_000.0),
    _param("raster.origin", "Position of the bottom left sample of images and plain files [m], three numbers.",
        -1e9, 1e9),
    _param("raster.first_row", "Side of the first row of images and plain files: the top, where y is largest, or the "
        "bottom."),
    _param("raster.zero_is_hole", "Treat zero in images and plain files as a hole."),
    _param("bodies.timeout", "Remove a tracked body after this long without a pose [s]; it stops after half a second "
        "without one.", 0.01, 3600.0, place="body_timeout"),
    _param("bodies.max_velocity", "Highest velocity of a tracked body that is estimated from successive poses [m/s]; a "
        "faster change counts as a jump, without velocity, and is reported.", 0.01, 1000.0),
    _param("bodies.default_radius", "Radius of tracked bodies whose messages give none [m].", 0.001, 100.0),
    _fixed("bodies.spawn", "Bodies spawned at start, each a YAML mapping; see config/."),
    _param("bodies.command_timeout", "Joints and tracks that velocities drive stop after this long without a command, "
        "in simulated time [s]; 0 = never. Positions and efforts stay in force.", 0.0, 3600.0),
    _param("bodies.urdf_folders", "Folders from which services may load robot descriptions, their meshes, and worlds; "
        "empty = pybullet_data and the share folders of the installed packages."),
    _fixed("bodies.poses", "Topics of geometry_msgs/PoseStamped, each for one tracked body: 'name=topic', or a topic "
        "alone, which also names the body."),
    _fixed("bodies.odometry",
        "Topics of nav_msgs/Odometry, each for one tracked body: 'name=topic', or a topic alone."),
    _fixed("bodies.frames", "TF frames to follow as tracked bodies: 'name=frame', or a frame alone."),
    _fixed("bodies.shapes", "What tracked bodies are in place of spheres, each a YAML mapping such as {body: crate, "
        "shape: box, size: [1, 1, 0.5]} or {body: rover, urdf: /path/rover.urdf}."),
    _fixed("bodies.peers", "Other terrain_collider nodes, by fully qualified name, whose bodies collide with those of "
        "this node; auto = all discovered nodes with the same terrain frame."),
    _param("bodies.peer_margin", "Distance between a peer's body and a body of this node below which this node also "
        "simulates the peer's body, as a guest [m]; fast bodies earlier.", 0.01, 1000.0, place="world.guests.margin"),
    _fixed("robot.description", "URDF of a robot, or the path of a URDF file; empty = the robot on "
        "~/robot_description, if any."),
    _fixed("robot.start", "Name of that robot and where it starts, one YAML mapping as of bodies.spawn with xy, "
        "yaw, and above or clearance and align."),
    _param("publish.patches", "Rate of ~/patches, ~/collider_patches, ~/scene and ~/pressed_ground, and of ~/sinkage "
        "up to 1 Hz [Hz]; 0 = never.", 0.0, 1000.0),
    _param("publish.body_states", "Rate of ~/body_states, ~/contacts, ~/contact_wrenches, ~/joint_states and "
        "~/odometry [Hz]; 0 = never.", 0.0, 1000.0),
    _param("publish.incremental", "Publish only changed patches on ~/patches and ~/collider_patches, and all patches "
        "when a subscriber joins and every 5 s.", place="incremental"),
    _param("publish.clock", "Rate of /clock, which carries simulated time [Hz]; 0 = never.", 0.0, 10_000.0),
    _fixed("publish.robot_prefix", "Joints and frames of every robot are named <robot>/<name>. false: a robot has the "
        "names of its URDF, as robot_state_publisher expects, unless another has one of them already. Names do not "
        "change while their robot is there.", place="robot_prefix"),
    _param("publish.tf", "Rate of the frames of simulated bodies and robots on /tf [Hz]; 0 = never. Frames that other "
        "nodes publish are left out.", 0.0, 1000.0),
    _fixed("simulation_interfaces", "Serve the standard services of simulation_interfaces."),
    _fixed("service_introspection", "What the node publishes of each call of its services, on "
        "<service>/_service_event; with contents a bag holds the calls, and a replay repeats them."),
    _fixed("height_scans", "Height scans on ~/height_scan/<body>, each a YAML mapping such as {body: robot, layout: "
        "isaac_lab, rate: 50, noise: 0.01}; see docs/height_scan.md."),
    _fixed("ground_maps", "Grid maps of the true ground on ~/ground_map/<body>, each a YAML mapping such as {body: "
        "robot, size: [10, 10], spacing: 0.1, rate: 10}; see docs/elevation_mapping.md."),
    _fixed("imus", "IMUs on ~/imu/<body> or ~/imu/<body>/<link>, each a YAML mapping such as {body: robot, link: "
        "imu_link, rate: 100}; see docs/driving.md."),
    _fixed("bases", "Bases that drive by ~/cmd_vel/<body>, each a YAML mapping such as {body: robot, wheels: [left, "
        "right]}; see docs/driving.md."),
    _fixed("decks", "Ground that rides on a TF frame, an odometry topic or a body, each a YAML mapping such as {deck: "
        "ferry, frame: ferry/deck, thickness: 0.5}; its maps come with its name as tile; see docs/decks.md."),
    _fixed("frame_id", "Frame of the terrain; empty = the frame of the first map."),
)  # fmt: skip
# The places of the parameters in the settings.
FIELDS = {spec.name: spec.place for spec in SPECS}
NAMES = FIELDS.keys()


def settings_from(values: Mapping[str, Any]) -> Settings:
    """Return the settings for values of parameters, others at their defaults; raises `InputError` for the first invalid
    value."""
    v = declaring.checked(values, SPECS)
    if v["publish.tf"]:
        class_of("tf2_msgs/msg/TFMessage", "publish.tf")
    v["frame_id"] = v["frame_id"].strip("/")
    if v["terrain.changes"] == "auto":  # maps of sensors and mappers are corrections
        v["terrain.changes"] = "motion" if v["terrain.input"] == "heightmap" else "correction"
    v |= body_sources({name: v[name] for name in ("bodies.poses", "bodies.odometry", "bodies.frames")})
    v["bodies.peers"] = peer_names(v["bodies.peers"])
    v |= {name: output_entries(name, v[name]) for name in ("height_scans", "ground_maps", "imus", "bases")}
    v |= {name: parse(name, v[name]) for name, parse in (("decks", deck_entries), ("bodies.shapes", shape_entries))}
    try:
        return _placed(DEFAULTS, v)
    except InputError:
        for name, value in v.items():
            with naming(name):
                _placed(DEFAULTS, {name: value})
        raise


def with_values(settings: Settings, values: Mapping[str, Any]) -> Settings:
    """Return settings with other values of some parameters. Raises `InputError` if one is invalid."""
    return _placed(settings, declaring.checked(values, [spec for spec in SPECS if spec.name in values]))


def _placed(settings: Settings, values: Mapping[str, Any]) -> Settings:
    """Return settings with the values of some parameters in their places."""
    tree: dict[str, Any] = {}
    for name, value in values.items():
        *owners, field = FIELDS[name].split(".")
        branch = tree
        for owner in owners:
            branch = branch.setdefault(owner, {})
        branch[field] = tuple(value) if isinstance(value, list) else value
    return _with(settings, tree)


def _with(config: ConfigT, tree: Mapping[str, Any]) -> ConfigT:
    """Return a config with other values of fields, of which those that are configs have a tree of their own."""
    changes = {name: _with(getattr(config, name), v) if isinstance(v, dict) else v for name, v in tree.items()}
    return replace(config, **changes)  # type: ignore[type-var]


def current_settings(node: ParameterNode, new: Mapping[str, Any] = MappingProxyType({})) -> Settings:
    """Return the settings for the current values of the parameters and ``new`` ones of some; raises `InputError` if
    these are invalid together."""
    settings = settings_from({**node.values, **new})
    if settings.publish.clock > 0.0 and new.get("use_sim_time", node.get_parameter("use_sim_time").value):
        words = "publish.clock makes this node the source of /clock, use_sim_time makes it follow another"
        raise InputError("parameter", f"{words}; set one of them")
    return settings


def announce(node: Node, settings: Settings) -> None:
    """Logs the node's settings in one line; warns of parameter files for other nodes."""
    name, physics = node.get_fully_qualified_name(), settings.world.physics
    _note_absent(node, settings.urdf_folders)
    strays = {file: mismatch(file, name) for file in files_of(sys.argv)}
    for reason in filter(None, strays.values()):
        node.get_logger().warning(reason)
    sources = [source_of(file) for file, reason in strays.items() if reason is None]
    taken = listed([*dict.fromkeys(sources), *(f"-p {one}" for one in set_one_by_one(sys.argv))], 10) or "defaults"
    terrain = f"~/{settings.input}" + (f" and {settings.file}" if settings.file else "")
    words = f"terrain from {terrain}; physics {physics.rate:g} Hz; parameters: {taken}"
    node.get_logger().info(f"{name}: {words}")


def _note_absent(node: Node, folders: Sequence[str]) -> None:
    """Logs a warning for each folder of ``bodies.urdf_folders`` that does not exist; it may be made later."""
    for folder in folders:
        path = expanded(folder)
        if not path.is_dir():
            words = f"bodies.urdf_folders has {folder!r}, but there is no folder {path.absolute()}"
            node.get_logger().warning(f"{words}; give the path of a folder on the machine of this node")


def announce_changes(node: Node, before: Mapping[str, Any], after: Mapping[str, Any]) -> None:
    """Logs a line for each parameter whose value changed."""
    for name, value in after.items():
        if value != before[name]:
            node.get_logger().info(f"parameter {name} is now {value!r}; it was {before[name]!r}")
            if name == "bodies.urdf_folders":
                _note_absent(node, value)
