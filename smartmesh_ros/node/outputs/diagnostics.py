"""``/diagnostics``: the node's state, once a second and whenever a publisher appears or disappears."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue

from smartmesh_ros.world.world import World

# A map older than this is stale [s].
STALE = 2.0
# Most inputs whose stamps are reported.
MOST_AGES = 32


@dataclass(frozen=True, kw_only=True)
class Health:
    """Input of the diagnostics beside the world.

    ``map_age``: age of the last map or update [s], None before the first. ``maps``: number of accepted maps and
    updates. ``map_sources``: number of publishers on the terrain topics. ``overtaken``: number of maps that arrived
    after a newer one, by topic. ``publishers``: number of connected publishers by topic. ``rival_clocks``: other
    publishers of ``/clock``. ``rival_maps``: publishers whose maps disagree. ``map_warning``: suspected misuse of the
    maps, empty = none. ``incompatible``: peers with incompatible QoS, by topic. ``clock_wait``: what of ``/clock`` the
    physics waits for, empty = nothing. ``unstamped``: number of transforms without stamp, by topic. ``jumps``: number
    of jumps of tracked bodies, by topic. ``stamp_ages``: steady age of the stamps of each input on arrival [s].
    ``peers``: state of each node whose bodies may be guests here; ``silent_peers``: peers named by parameters without
    messages.
    """

    map_age: float | None
    maps: int
    map_sources: int
    overtaken: Counter[str]
    publishers: dict[str, int]
    real_time_factor: float
    deadline_misses: int
    paused: bool
    clock_wait: str
    refusals: Counter[str]
    new_refusals: int
    jumps: Counter[str]
    unstamped: Counter[str]
    stamp_ages: dict[str, float | None]
    rival_clocks: list[str]
    rival_maps: list[str]
    map_warning: str
    incompatible: dict[str, str]
    peers: dict[str, str] = field(default_factory=dict)
    silent_peers: list[str] = field(default_factory=list)


def statuses(node_name: str, world: World, health: Health) -> list[DiagnosticStatus]:
    """Return one status per task of the node with a fully qualified name: terrain, bodies, physics, inputs,
    connections."""
    return [
        task_status(node_name, "terrain", *_terrain(world, health)),
        task_status(node_name, "bodies", *_bodies(world, health)),
        task_status(node_name, "physics", *_physics(health)),
        task_status(node_name, "inputs", *_inputs(health)),
        task_status(node_name, "connections", *_connections(health)),
    ]


def _terrain(world: World, health: Health) -> tuple[bytes, str, dict[str, Any]]:
    tiles = world.terrain.tiles
    values: dict[str, Any] = {"tiles": len(tiles), "samples": sum(tile.size for tile in tiles.values())}
    for name, tile in list(tiles.items())[:16]:
        values[f"size of {name!r}"] = tile.description
        values[f"updates of {name!r}"] = tile.version
    values["publishers"] = health.map_sources
    values["overtaken by a newer one"] = health.overtaken.total()
    values |= {f"overtaken on {topic}": count for topic, count in sorted(health.overtaken.items())}
    if health.map_age is None:
        return DiagnosticStatus.WARN, "no map yet", values
    values["age [s]"] = f"{health.map_age:.3f}"
    if health.map_age > STALE:
        text = f"the last map is {health.map_age:.1f} s old"
        # A single map may be static terrain; after several maps, more are expected.
        if not health.map_sources and health.maps > 1:
            return DiagnosticStatus.WARN, f"{text}, and nobody publishes maps any more", values
        return DiagnosticStatus.OK, text, values
    if health.rival_maps:
        names = ", ".join(health.rival_maps)
        return DiagnosticStatus.WARN, f"maps disagree; they come from {names}", values
    if health.map_warning:
        return DiagnosticStatus.WARN, health.map_warning, values
    return DiagnosticStatus.OK, "maps arrive", values


def _bodies(world: World, health: Health) -> tuple[bytes, str, dict[str, Any]]:
    below = world.below_ground()
    batches = world.shown_batches()
    kinds: Counter[str] = Counter()
    for batch in batches:
        kinds[batch.kind] += len(batch.bodies)
    patches, remote = kinds.total(), int(world.followers.table["remote"].sum())
    values: dict[str, Any] = {
        "simulated": sum(body.simulated for body in world.bodies.values()),
        "tracked": sum(body.tracked for body in world.bodies.values()),
        "asleep": sum(world.is_asleep(body.name) for body in world.bodies.values()),
        "patches": patches,
        "without ground": len(world.followers) - remote - patches,
        "below ground": len(below),
        "put back onto the ground": world.rescues,
        **{f"jumps on {topic}": count for topic, count in sorted(health.jumps.items())},
        **{f"patches, {kind}": count for kind, count in sorted(kinds.items())},
        "colliders replaced": world.ground.contacts.replacements,
        "colliders leaked": world.ground.contacts.leaked,
    }
    if health.peers:
        values["guests"] = remote
        values |= {f"peer {name}": words for name, words in health.peers.items()}
    if below:
        return DiagnosticStatus.ERROR, f"below the ground: {', '.join(below[:5])}", values
    if health.silent_peers:
        return DiagnosticStatus.WARN, f"not heard: {', '.join(health.silent_peers)}", values
    return DiagnosticStatus.OK, f"{patches} patches", values


def _physics(health: Health) -> tuple[bytes, str, dict[str, Any]]:
    values = {
        "real-time factor": f"{health.real_time_factor:.3f}",
        "deadline misses": health.deadline_misses,
        "paused": health.paused,
    }
    if health.paused:
        return DiagnosticStatus.OK, "paused", values
    if health.clock_wait:
        return DiagnosticStatus.WARN, health.clock_wait, values
    if health.real_time_factor < 0.95:
        return DiagnosticStatus.WARN, f"slower than real time ({health.real_time_factor:.2f})", values
    return DiagnosticStatus.OK, "in real time", values


def _inputs(health: Health) -> tuple[bytes, str, dict[str, Any]]:
    values = {f"refused, {reason}": count for reason, count in sorted(health.refusals.items())}
    if health.new_refusals:
        return DiagnosticStatus.WARN, f"{health.new_refusals} refused in the last second", values
    return DiagnosticStatus.OK, f"{health.refusals.total()} refused so far", values


def _connections(health: Health) -> tuple[bytes, str, dict[str, Any]]:
    values: dict[str, Any] = {f"publishers of {topic}": count for topic, count in health.publishers.items()}
    values |= {f"without stamp on {topic}": count for topic, count in sorted(health.unstamped.items())}
    ages = [(source, age) for source, age in health.stamp_ages.items() if age is not None]
    values |= {f"age of stamps on arrival, {source} [s]": f"{age:.3f}" for source, age in ages[:MOST_AGES]}
    values |= {f"incompatible QoS on {topic}": peers for topic, peers in health.incompatible.items()}
    if health.rival_clocks:
        values["/clock is also published by"] = ", ".join(health.rival_clocks)
        return DiagnosticStatus.ERROR, f"silent on /clock, which {health.rival_clocks[0]} publishes", values
    if health.incompatible:
        return DiagnosticStatus.WARN, f"incompatible QoS on {', '.join(health.incompatible)}", values
    return DiagnosticStatus.OK, "no incompatible QoS", values


def task_name(node_name: str, task: str) -> str:
    """Return the name of a status, which differs for nodes of the same name in different namespaces."""
    return f"{node_name.strip('/')}: {task}"


def task_status(node_name: str, task: str, level: bytes, text: str, values: dict[str, Any]) -> DiagnosticStatus:
    """Return a status of a node with its values by key."""
    pairs = [KeyValue(key=key, value=str(value)) for key, value in values.items()]
    name = task_name(node_name, task)
    return DiagnosticStatus(level=level, name=name, message=text, hardware_id=node_name, values=pairs)
