"""How large a body is."""

import math
from typing import Any

import numpy as np
import pybullet as pb


def bounding_radius(client: Any, body: int, link: int = -1) -> float:
    """Radius [m] of a sphere around the centre of mass that holds the collision shapes of a body or link; 0 = none."""
    try:
        shapes = client.getCollisionShapeData(body, link)
    except pb.error:  # PyBullet does not tell the shapes of bodies in maximal coordinates
        return _radius_of_bounds(client, body, link)
    reach = 0.0
    for shape in shapes:
        kind, size, position = shape[2], shape[3], shape[5]
        if kind == pb.GEOM_SPHERE:
            radius = size[0]
        elif kind == pb.GEOM_BOX:
            radius = 0.5 * math.hypot(*size)
        elif kind == pb.GEOM_CYLINDER:
            radius = math.hypot(0.5 * size[0], size[1])
        elif kind == pb.GEOM_CAPSULE:
            radius = 0.5 * size[0] + size[1]
        else:
            return _radius_of_bounds(client, body, link)
        reach = max(reach, radius + math.hypot(*position))
    return reach


def is_ball(client: Any, body: int, link: int = -1) -> bool:
    """Whether a body or link is a sphere and nothing else, as far as PyBullet tells."""
    try:
        shapes = client.getCollisionShapeData(body, link)
    except pb.error:
        return False
    return [shape[2] for shape in shapes] == [pb.GEOM_SPHERE]


def _radius_of_bounds(client: Any, body: int, link: int) -> float:
    """The same from the axis-aligned bounds, for shapes whose size PyBullet does not tell."""
    low, high = (np.array(corner) for corner in client.getAABB(body, link))
    pose = client.getBasePositionAndOrientation(body) if link < 0 else client.getLinkState(body, link)
    centre = np.array(pose[0])
    return float(np.linalg.norm(np.maximum(np.abs(low - centre), np.abs(high - centre))))
