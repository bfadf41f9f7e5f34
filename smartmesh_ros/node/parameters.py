"""The parameters of ``terrain_collider``.

Defaults live in the core's configurations; this module reads them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, get_args

from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter

from smartmesh_ros.errors import InputError
from smartmesh_ros.node import declaring
from smartmesh_ros.node.declaring import Spec
from smartmesh_ros.node.running import ExecutorKind
from smartmesh_ros.patches.collect import CollectMethod
from smartmesh_ros.patches.config import PatchConfig, PatchKind
from smartmesh_ros.physics.config import PhysicsConfig
from smartmesh_ros.physics.world import WorldConfig
from smartmesh_ros.search.methods import SearchMethod
from smartmesh_ros.terrain.motion import MotionConfig, MotionMode

Durability = Literal["volatile", "transient_local"]


@dataclass(frozen=True, kw_only=True)
class PublishRates:
    """How often each output is published while somebody subscribes to it [Hz]; 0 = never."""

    patches: float = 30.0
    collider_patches: float = 30.0
    body_states: float = 60.0
    contacts: float = 30.0
    timing: float = 1.0


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Everything the parameters say."""

    world: WorldConfig = field(default_factory=WorldConfig)
    motion: MotionConfig = field(default_factory=MotionConfig)
    publish: PublishRates = field(default_factory=PublishRates)
    frame_id: str = ""
    max_samples: int = 64_000_000
    durability: Durability = "volatile"
    body_timeout: float = 1.0
    default_radius: float = 0.25
    spawn: tuple[str, ...] = ()
    executor: ExecutorKind = "events"


_D = Settings()
_PHYSICS, _PATCH = _D.world.physics, _D.world.patch

SPECS = (
    Spec("physics.rate", _PHYSICS.rate, "Physics steps per second [Hz].", 1.0, 10_000.0),
    Spec("physics.gravity", list(_PHYSICS.gravity), "Gravity in the terrain's frame [m/s^2], three numbers."),
    Spec("physics.friction", _PHYSICS.friction, "Friction of simulated bodies spawned from now on.", 0.0, 10.0),
    Spec("physics.restitution", _PHYSICS.restitution, "Restitution of bodies spawned from now on.", 0.0, 1.0),
    Spec("physics.contact_erp", _PHYSICS.contact_erp, "Share of a penetration corrected in a step.", 0.01, 1.0),
    Spec("search.method", _PATCH.search, "How the nearest vertex is found.", choices=get_args(SearchMethod)),
    Spec("collect.method", _PATCH.collect, "How the vertices of a patch are found.", choices=get_args(CollectMethod)),
    Spec(
        "patch.kind", _PATCH.kind, "Collider of a patch; auto: none, a plane or the smallest heightfield within "
        "patch.tolerance.", choices=get_args(PatchKind),
    ),
    Spec("patch.rings", _PATCH.rings, "Samples on each side of the nearest vertex; 0 = from the body's size.", 0, 4),
    Spec("patch.tolerance", _PATCH.tolerance, "How far a patch may lie from the terrain [m].", 1e-6, 10.0),
    Spec("patch.edge_filter", _PATCH.edge_filter, "No ghost collisions at the inner edges of patches."),
    Spec("patch.carry_velocity", _PATCH.carry_velocity, "Patches carry the ground's velocity into contacts."),
    Spec("terrain.motion", _D.motion.mode, "What the ground does between maps.", choices=get_args(MotionMode)),
    Spec("terrain.max_interval", _D.motion.max_interval, "Maps further apart give no velocity [s].", 0.001, 60.0),
    Spec("terrain.max_velocity", _D.motion.max_velocity, "Faster ground has jumped, not moved [m/s].", 0.01, 1000.0),
    Spec("terrain.max_samples", _D.max_samples, "Larger maps are refused [samples].", 9, 2**31),
    Spec(
        "terrain.durability", _D.durability, "QoS durability of the map subscriptions; transient_local gets the last "
        "map of a latched publisher, and nothing from a volatile one.", choices=get_args(Durability), read_only=True,
    ),
    Spec("bodies.timeout", _D.body_timeout, "A tracked body not heard of for so long is gone [s].", 0.01, 3600.0),
    Spec("bodies.default_radius", _D.default_radius, "Radius of tracked bodies that give none [m].", 0.001, 100.0),
    Spec("bodies.spawn", list(_D.spawn), "Bodies spawned at start, each a YAML mapping; see config/.", read_only=True),
    Spec("publish.patches", _D.publish.patches, "Rate of ~/patches [Hz]; 0 = never.", 0.0, 1000.0),
    Spec("publish.collider_patches", _D.publish.collider_patches, "Rate of ~/collider_patches [Hz].", 0.0, 1000.0),
    Spec("publish.body_states", _D.publish.body_states, "Rate of ~/body_states [Hz].", 0.0, 1000.0),
    Spec("publish.contacts", _D.publish.contacts, "Rate of ~/contacts [Hz].", 0.0, 1000.0),
    Spec("publish.timing", _D.publish.timing, "Rate of ~/timing [Hz].", 0.0, 1000.0),
    Spec("frame_id", _D.frame_id, "Frame of the terrain; empty = that of the first map.", read_only=True),
    Spec("executor", _D.executor, "How rclpy waits for messages.", choices=get_args(ExecutorKind), read_only=True),
)  # fmt: skip
NAMES = frozenset(spec.name for spec in SPECS)


def settings_from(values: Mapping[str, Any]) -> Settings:
    """Settings from the values of all parameters; raises `InputError` naming the first that cannot be."""
    v = declaring.checked(values, SPECS)
    physics = PhysicsConfig(
        rate=v["physics.rate"],
        gravity=tuple(v["physics.gravity"]),
        friction=v["physics.friction"],
        restitution=v["physics.restitution"],
        contact_erp=v["physics.contact_erp"],
    )
    patch = PatchConfig(
        search=v["search.method"],
        collect=v["collect.method"],
        kind=v["patch.kind"],
        rings=v["patch.rings"],
        tolerance=v["patch.tolerance"],
        edge_filter=v["patch.edge_filter"],
        carry_velocity=v["patch.carry_velocity"],
    )
    return Settings(
        world=WorldConfig(physics=physics, patch=patch),
        motion=MotionConfig(
            mode=v["terrain.motion"], max_interval=v["terrain.max_interval"], max_velocity=v["terrain.max_velocity"]
        ),
        publish=PublishRates(
            **{name.partition(".")[2]: value for name, value in v.items() if name.startswith("publish.")}
        ),
        frame_id=v["frame_id"],
        max_samples=v["terrain.max_samples"],
        durability=v["terrain.durability"],
        body_timeout=v["bodies.timeout"],
        default_radius=v["bodies.default_radius"],
        spawn=tuple(v["bodies.spawn"]),
        executor=v["executor"],
    )


def declare(node: Node) -> Settings:
    """Declares the node's parameters and returns its settings; raises `InputError` if they are impossible."""
    return settings_from(declaring.declare(node, SPECS))


def current_settings(node: Node) -> Settings:
    """Settings as the parameters are now."""
    return settings_from(declaring.current_values(node, SPECS))


def check_change(node: Node, changes: list[Parameter], check: Callable[[Settings], None]) -> SetParametersResult:
    """Whether a set of changes is possible as a whole; for the on-set callback, which changes nothing itself.

    ``check`` may object to the settings there would be by raising `InputError`.
    """
    try:
        known = {change.name: declaring.plain_value(change) for change in changes if change.name in NAMES}
        check(settings_from({**declaring.current_values(node, SPECS), **known}))
    except InputError as error:
        return SetParametersResult(successful=False, reason=str(error))
    return SetParametersResult(successful=True)
