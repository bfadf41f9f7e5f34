"""Names, parameters and remappings of a fleet: nodes that share one terrain, and a front that speaks for all of them.

Read by the launch file and by ``smartmesh-fleet`` alike; imports nothing of ROS.
"""

from __future__ import annotations

from typing import Any

COLLIDER, FRONT, PRESET = "terrain_collider", "fleet", "fleet"
# Topics that all nodes take, or publish on, under the front's name.
SHARED = ("heightmap", "heightmap_update", "terrain_mesh", "terrain_mesh_update", "patches")
# More often than any physics: the states of bodies go out with every step, which is what peers need.
EVERY_STEP = 1000.0
# Terrain to try a fleet on: waves that bodies ride on, on maps as a lidar brings them.
WAVES = {"scene": "waves", "rate": 20.0, "wave.amplitude": 0.1, "wave.number": 0.5, "wave.frequency": 2.0}


def front_of(namespace: str = "") -> str:
    """Full name of the front."""
    inner = namespace.strip("/")
    return f"/{inner}/{FRONT}" if inner else f"/{FRONT}"


def namespace_of(index: int, namespace: str = "") -> str:
    """Namespace of a node; ROS allows no name that starts with a digit."""
    return f"{front_of(namespace)}/node_{index}"


def node_names(count: int, namespace: str = "") -> list[str]:
    """Full names of the nodes."""
    return [f"{namespace_of(index, namespace)}/{COLLIDER}" for index in range(count)]


def parameters_of(index: int, count: int, namespace: str = "") -> dict[str, Any]:
    """What a node is told beside its preset: its peers, and where its markers belong."""
    peers = [name for other, name in enumerate(node_names(count, namespace)) if other != index]
    alone = {} if peers else {"bodies.peers": ["auto"]}
    return {
        "bodies.peers": peers,
        "publish.body_states": EVERY_STEP,
        "publish.marker_namespace": marker_namespace(node_names(count, namespace)[index]),
        **alone,
    }


def marker_namespace(node: str) -> str:
    """Return the ``ns`` of a node's markers on the topic that all of them share."""
    return node.strip("/").removesuffix(f"/{COLLIDER}")


def remappings(namespace: str = "") -> list[tuple[str, str]]:
    """Of each node: the topics that all share."""
    return [(f"~/{topic}", f"{front_of(namespace)}/{topic}") for topic in SHARED]


def source_remappings(namespace: str = "") -> list[tuple[str, str]]:
    """Of the source of terrain."""
    return [(f"{COLLIDER}/{topic}", f"{front_of(namespace)}/{topic}") for topic in ("heightmap", "heightmap_update")]


def front_parameters(count: int, namespace: str = "") -> dict[str, Any]:
    """What the front is told."""
    return {"nodes": node_names(count, namespace)}
