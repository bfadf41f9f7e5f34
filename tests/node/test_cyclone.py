"""Talking with Eclipse Cyclone DDS, an implementation that shares no code with the middleware underneath ROS here."""

from functools import cache
from importlib import import_module
from typing import Any

import numpy as np
import pytest
from rosidl_parser.definition import AbstractSequence, AbstractString, Array, BasicType
from smartmesh_msgs.msg import Heightmap, TrackedBody, TrackedBodyArray
from visualization_msgs.msg import Marker, MarkerArray

from smartmesh_ros.tools.testing import Probe, assert_on_map, heightmap_message, points_of, pose_message
from tests.node.shared import spawn

pytest.importorskip("cyclonedds", reason="cyclonedds is not installed; pip install -r requirements/interop.txt")

from cyclonedds.core import Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import make_idl_struct, types
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

LOCALHOST = """<CycloneDDS><Domain><General><Interfaces><NetworkInterface address="127.0.0.1"/></Interfaces>
<AllowMulticast>false</AllowMulticast></General><Discovery><ParticipantIndex>auto</ParticipantIndex>
<MaxAutoParticipantIndex>30</MaxAutoParticipantIndex><Peers><Peer address="127.0.0.1"/></Peers></Discovery></Domain>
</CycloneDDS>"""
QOS = Qos(
    Policy.Reliability.Reliable(1_000_000_000),
    Policy.History.KeepLast(10),
    Policy.DataRepresentation(use_cdrv0_representation=True, use_xcdrv2_representation=False),
)
# Basic types that Cyclone calls otherwise.
RENAMED = {
    "boolean": bool, "octet": types.byte, "char": types.uint8, "float": types.float32, "double": types.float64,
}  # fmt: skip


@cache
def cyclone_type(kind: Any) -> Any:
    """Cyclone's type of a ROS message, with the name that ROS gives it on the wire."""
    package = kind.__module__.partition(".")[0]
    name = f"{package}::msg::dds_::{kind.__name__}_"
    names = kind.get_fields_and_field_types()
    fields = {field: annotation(slot) for field, slot in zip(names, kind.SLOT_TYPES, strict=True)}
    return make_idl_struct(kind.__name__, name, fields)


def annotation(slot: Any) -> Any:
    if isinstance(slot, BasicType):
        return RENAMED.get(slot.typename) or getattr(types, slot.typename)
    if isinstance(slot, AbstractString):
        return str
    if isinstance(slot, AbstractSequence):
        return types.sequence[annotation(slot.value_type)]
    if isinstance(slot, Array):
        return types.array[annotation(slot.value_type), slot.size]
    return cyclone_type(getattr(import_module(".".join(slot.namespaces)), slot.name))


def to_cyclone(message: Any) -> Any:
    """A ROS message as Cyclone's."""
    if hasattr(message, "SLOT_TYPES"):
        names = message.get_fields_and_field_types()
        return cyclone_type(type(message))(**{name: to_cyclone(getattr(message, name)) for name in names})
    if hasattr(message, "tolist"):
        return message.tolist()
    return [to_cyclone(item) for item in message] if isinstance(message, list) else message


def test_cyclone_publishes_a_map_and_receives_patches_that_lie_on_it(
    domain: int, probe: Probe, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its requests that are none, of a peer with another idea of the type, do no harm: the middleware drops them, or
    the node's loop refuses them."""
    heights = np.random.default_rng(3).normal(size=(40, 30)) * 0.2
    map_message, bodies = heightmap_message(heights, resolution=0.1), TrackedBodyArray()
    bodies.header.frame_id = "map"
    places = {"rover": (1.0, 1.5, 0.3), "walker": (2.0, 2.5, 0.3)}
    bodies.bodies = [TrackedBody(id=name, pose=pose_message(place), radius=0.2) for name, place in places.items()]
    other = make_idl_struct(
        "SpawnBody_Request", "smartmesh_msgs::srv::dds_::SpawnBody_Request_", {"values": types.array[types.uint32, 6]}
    )
    monkeypatch.setenv("CYCLONEDDS_URI", LOCALHOST)
    peer = DomainParticipant(domain)
    maps, poses, patches, requests = (
        way(peer, Topic(peer, name, kind, qos=QOS), qos=QOS)
        for way, name, kind in (
            (DataWriter, "rt/terrain_collider/heightmap", cyclone_type(Heightmap)),
            (DataWriter, "rt/terrain_collider/tracked_bodies", cyclone_type(TrackedBodyArray)),
            (DataReader, "rt/terrain_collider/patches", cyclone_type(MarkerArray)),
            (DataWriter, "rq/terrain_collider/spawn_bodyRequest", other),
        )
    )
    with probe.running(parameters={"terrain.motion": "hold"}) as process:

        def shown() -> list[Any]:
            maps.write(to_cyclone(map_message))
            poses.write(to_cyclone(bodies))
            found = [[m for m in sample.markers if m.action == Marker.ADD] for sample in patches.take(N=50)]
            return next((markers for markers in found if len(markers) == 2), [])

        for marker in probe.wait_for(shown, watch=process):
            points = points_of(marker)
            assert len(points) >= 6 and marker.header.frame_id == "map"
            assert_on_map(points, map_message)
        assert "refused" not in process.output
        probe.wait_for(requests.get_matched_subscriptions, watch=process)
        for number, value in enumerate((0, 7, 2**31, 2**32 - 1)):
            requests.write(other(values=[value] * 6))
            spawn(probe, f"ball_{number}")
        assert process.process.poll() is None
        probe.wait_for(lambda: len(probe.latest("body_states").bodies) == 4)
