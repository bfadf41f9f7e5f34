"""Links of a simulator as tracked bodies of ``terrain_collider``."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from geometry_msgs.msg import Point, Pose, Quaternion, Twist, Vector3
from smartmesh_msgs.msg import TrackedBody, TrackedBodyArray

Vector = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class TrackedLink:
    """A link that gets a patch, in the terrain's frame: ``position`` of its centre [m], ``radius`` of its bounding
    sphere [m], ``orientation`` (x, y, z, w), ``linear`` [m/s] and ``angular`` [rad/s] velocity. If all velocities of
    a link have been zero so far, the node estimates them from successive poses."""

    name: str
    position: Vector
    radius: float
    orientation: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0)
    linear: Vector = (0.0, 0.0, 0.0)
    angular: Vector = (0.0, 0.0, 0.0)


def tracked_bodies(links: Iterable[TrackedLink], frame_id: str, stamp: Any) -> TrackedBodyArray:
    """Return the message with the states of links at ``stamp``."""
    message = TrackedBodyArray(bodies=[_body(link) for link in links])
    message.header.frame_id, message.header.stamp = frame_id, stamp
    return message


def _body(link: TrackedLink) -> TrackedBody:
    pose = Pose(position=_of(Point, link.position), orientation=_orientation(link))
    twist = Twist(linear=_of(Vector3, link.linear), angular=_of(Vector3, link.angular))
    return TrackedBody(id=link.name, pose=pose, twist=twist, radius=float(link.radius))


def _of(kind: Any, values: Vector) -> Any:
    x, y, z = values
    return kind(x=float(x), y=float(y), z=float(z))


def _orientation(link: TrackedLink) -> Quaternion:
    x, y, z, w = link.orientation
    return Quaternion(x=float(x), y=float(y), z=float(z), w=float(w))
