"""The settings of ``terrain_collider``, as its parameters give them. The core's configs hold the core's defaults.

Some parameters are lists of entries that name something: tracked bodies with their topics or frames, peer nodes, and
what `entries` parses.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

from rclpy.validate_full_topic_name import validate_full_topic_name

from smartmesh_ros.errors import InputError, naming
from smartmesh_ros.io.rasters import RasterConfig
from smartmesh_ros.node.parameters.entries import DeckEntry, OutputEntry, ShapeEntry, require_topic
from smartmesh_ros.node.timing.pacing import DeadlinePolicy
from smartmesh_ros.soil.config import soils_from
from smartmesh_ros.terrain.motion import MotionConfig
from smartmesh_ros.world.robots.description import expanded
from smartmesh_ros.world.world import WorldConfig

# Entry of ``bodies.peers`` that stands for all nodes that are discovered.
AUTO = "auto"

# A tracked body, and the topic or TF frame of its pose.
BodySource = tuple[str, str]


def body_sources(entries: Mapping[str, Sequence[str]]) -> dict[str, tuple[BodySource, ...]]:
    """Return the sources that the entries of each parameter name.

    An entry is ``name=source``, or a source alone, which names the body, with ``.`` for ``/``. Raises `InputError` if a
    name is empty, contains ``/`` or repeats.
    """
    seen: set[str] = set()
    found: dict[str, tuple[BodySource, ...]] = {}
    for parameter, texts in entries.items():
        found[parameter] = tuple(_source(parameter, text) for text in texts)
        for name, _ in found[parameter]:
            if name in seen:
                words = f"{parameter} names body {name!r} again; use name=source to give it another name"
                raise InputError("parameter", words)
            seen.add(name)
    return found


def _source(parameter: str, text: str) -> BodySource:
    name, equals, source = text.partition("=")
    if not equals:
        name, source = text.strip("~/").replace("/", "."), text
    with naming(f"{parameter} has entry {text!r}"):
        if not name or not source or "/" in name:
            raise InputError("parameter", "it must be name=source, with no '/' in the name")
        if parameter != "bodies.frames":
            require_topic(source)
    return name, source


def peer_names(entries: Sequence[str]) -> tuple[str, ...]:
    """Return the entries of ``bodies.peers`` without duplicates. Raises `InputError` if an entry is no full node name,
    or if ``auto`` is not the only entry."""
    if AUTO in entries:
        if set(entries) != {AUTO}:
            raise InputError("parameter", f"bodies.peers is {list(entries)}; it must be 'auto' alone, or names")
        return (AUTO,)
    return full_names("bodies.peers", entries)


def full_names(parameter: str, entries: Sequence[str]) -> tuple[str, ...]:
    """Return the entries of a parameter without duplicates. Raises `InputError` if an entry is no full node name."""
    names = tuple(dict.fromkeys(entries))
    for name in names:
        with naming(f"{parameter} has entry {name!r}"):
            if not name.startswith("/"):
                raise InputError("parameter", "a full name starts with '/'")
            require_topic(name, validate_full_topic_name)
    return names


# Longest name of a body, tile or frame [characters].
LONGEST_NAME = 256
# Most bodies, tracked and simulated.
MOST_BODIES = 100_000
# Outputs that show the ground.
GROUND_OUTPUTS = ("patches", "collider_patches", "pressed_ground", "scene")
Introspection = Literal["disabled", "metadata", "contents"]
# Meaning of a change of height between maps; *auto*: a correction if sensors or mappers provide the terrain.
TerrainChanges = Literal["auto", "motion", "correction"]


@dataclass(frozen=True, kw_only=True)
class PublishRates:
    """Rates of outputs while they have subscribers [Hz]; 0 = never. ``patches``: of what shows the ground.
    ``body_states``: of what bodies do. ``tf``, ``clock``: of these topics."""

    patches: float = 30.0
    body_states: float = 60.0
    clock: float = 0.0
    tf: float = 0.0

    def of(self, output: str) -> float:
        """Return the rate of an output [Hz]. ``~/timing`` and the whole map of ``~/sinkage`` come once a second."""
        if output in ("timing", "sinkage"):
            return min(self.patches, 1.0) if output == "sinkage" else 1.0
        return self.patches if output in GROUND_OUTPUTS else self.body_states


@dataclass(frozen=True, kw_only=True)
class Settings:
    """The values of all parameters, as the node uses them."""

    world: WorldConfig = field(default_factory=WorldConfig)
    motion: MotionConfig = field(default_factory=MotionConfig)
    publish: PublishRates = field(default_factory=PublishRates)
    frame_id: str = ""
    input: str = "heightmap"
    file: str = ""
    soil: tuple[str, ...] = ()
    slip_sinkage: bool = True
    command_timeout: float = 0.5
    urdf_folders: tuple[str, ...] = ()
    raster: RasterConfig = field(default_factory=RasterConfig)
    robot_description: str = ""
    # A list, because `ros2 param load` fails on texts that are mappings of YAML.
    robot_start: tuple[str, ...] = ("{id: robot, xy: [0.0, 0.0], above: 0.5}",)
    simulation_interfaces: bool = False
    service_introspection: Introspection = "disabled"
    poses: tuple[BodySource, ...] = ()
    odometry: tuple[BodySource, ...] = ()
    frames: tuple[BodySource, ...] = ()
    peers: tuple[str, ...] = ()
    shapes: tuple[ShapeEntry, ...] = ()
    height_scans: tuple[OutputEntry, ...] = ()
    ground_maps: tuple[OutputEntry, ...] = ()
    imus: tuple[OutputEntry, ...] = ()
    bases: tuple[OutputEntry, ...] = ()
    decks: tuple[DeckEntry, ...] = ()
    incremental: bool = False
    robot_prefix: bool = False
    body_timeout: float = 1.0
    default_radius: float = 0.25
    max_velocity: float = 10.0
    spawn: tuple[str, ...] = ()
    deadline: DeadlinePolicy = "catch_up"

    def __post_init__(self) -> None:
        if not all(folder.strip() for folder in self.urdf_folders):
            words = "an entry is empty, which would be the folder that the node was started in; give that folder's path"
            raise InputError("parameter", f"{words}, or leave the entry out")
        for folder in self.urdf_folders:
            expanded(folder)
        if not self.soil:
            return
        soils_from(self.soil)
        if self.motion.corrects:
            raise InputError("parameter", "soil.type needs maps that are exact: set terrain.changes to motion")
