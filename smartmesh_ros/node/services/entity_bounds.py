"""Bounds of bodies in their own frames, for the message Bounds of simulation_interfaces."""

from __future__ import annotations

from itertools import product

import numpy as np

from smartmesh_ros.ground.quaternions import rotate
from smartmesh_ros.ground.shapes import Sphere
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.world.bodies import Body


def own_bounds(body: Body) -> tuple[FloatArray, FloatArray]:
    """Return the lower and upper corner (3,) [m] of a body's box in its own frame; for a robot, all links at joint
    positions zero in the frame of the root link."""
    box = (body.hull or body.shape or Sphere(body.radius)).body_shape.record
    half, centre = box["half"] + box["rounding"], box["offset"]
    position, orientation = body.inertial
    corners = [np.array(position) + rotate(orientation, (x, y, z)) for x, y, z in _corners(half, centre)]
    return np.min(corners, axis=0), np.max(corners, axis=0)


def _corners(half: FloatArray, centre: FloatArray) -> FloatArray:
    corners: FloatArray = centre + half * np.array(list(product((-1.0, 1.0), repeat=3)))
    return corners
