"""PyBullet heightfields that are replaced in place."""

from __future__ import annotations

import math
from collections import defaultdict
from functools import lru_cache
from typing import Any

import numpy as np
import pybullet as pb

from smartmesh_ros.physics.pairs import Pairs
from smartmesh_ros.terrain.grid import FloatArray, IntArray

# Half the height of the bounds a heightfield is created with [m], at most. PyBullet never updates the bounds of a
# replaced heightfield (bullet3 issues 4200 and 4236): what rises above them is not collided with. Samples are clamped
# to them, and holes are this deep.
BOUND = 100.0
# Most patches keep within this slope from their middle and get lower bounds: those of a heightfield that is 200 m high
# and leans a little meet those of many bodies beside it, in every step. Besides, there is room for being lowered [m].
SLOPE, DEEPEST = 2.0, 0.1

# Where colliders wait that no body needs, far below and apart from one another [m].
_PARK_DEPTH = -1.0e5
_PARK_STEP = 1.0e3


class Heightfield:
    """One heightfield of ``size`` x ``size`` samples, ``spacing`` [m] apart and no further than ``bound`` [m] from its
    middle, on a fixed body of its own.

    The body is a multibody, because the contacts of a fixed rigid body do not see its velocity. It stands a quarter
    turn from its grid: PyBullet cuts cells along the other diagonal than the main mesh does, and the turn brings the
    two together (row r, column c of the patch is PyBullet's row size - 1 - c, column r).
    """

    def __init__(self, client: Any, size: int, spacing: float, bound: float, park_x: float, visual: int) -> None:
        bounds = [0.0] * (size * size)
        bounds[0], bounds[-1] = -bound, bound
        self.kind = (size, spacing, bound)
        self.park_position = [park_x, 0.0, _PARK_DEPTH]
        self.shape: int = client.createCollisionShape(
            pb.GEOM_HEIGHTFIELD,
            meshScale=[spacing, spacing, 1.0],
            heightfieldData=bounds,
            numHeightfieldRows=size,
            numHeightfieldColumns=size,
        )
        # With none given PyBullet makes a picture of the whole field, of some MiB each.
        self.body: int = client.createMultiBody(0.0, self.shape, visual, basePosition=self.park_position)
        # PyBullet multiplies the two coefficients of a contact: the body's alone decide.
        client.changeDynamics(self.body, -1, lateralFriction=1.0, restitution=1.0)


def room(sizes: IntArray, spacings: FloatArray, highest: FloatArray) -> FloatArray:
    """How far above or below their middle heightfields have room (n,) [m] for samples that go ``highest`` (n,) [m]."""
    low = 0.5 * SLOPE * (sizes - 1) * spacings
    return np.asarray(np.where(highest > low, BOUND - DEEPEST, np.minimum(low, BOUND - DEEPEST)))


@lru_cache
def collider_order(size: int) -> IntArray:
    """Indices of a patch's samples (row by row) in the order PyBullet wants them, (size * size,)."""
    samples = np.arange(size * size).reshape(size, size)
    return np.ascontiguousarray(np.rot90(samples).ravel())


def collider_yaw(yaw: float) -> tuple[float, float, float, float]:
    """Orientation (x, y, z, w) of a heightfield's body over a grid turned by ``yaw`` [rad]."""
    half = 0.5 * (yaw + 0.5 * math.pi)
    return (0.0, 0.0, math.sin(half), math.cos(half))


class HeightfieldPool:
    """Hands out heightfields and takes them back.

    PyBullet leaks when shapes are created and removed, so none ever is: a collider whose body left or whose size
    changed waits for the next body that needs its size.
    """

    def __init__(self, client: Any, pairs: Pairs) -> None:
        self._client = client
        self._client_id: int = getattr(client, "_client", 0)
        self._pairs = pairs
        self._visual: int = client.createVisualShape(pb.GEOM_BOX, halfExtents=[1e-3] * 3)
        self._free: dict[tuple[int, float, float], list[Heightfield]] = defaultdict(list)
        self.created = 0

    def take(self, size: int, spacing: float, bound: float, body: int, link: int) -> Heightfield:
        """A heightfield that collides with that body or link alone."""
        free = self._free[size, spacing, bound]
        if free:
            heightfield = free.pop()
        else:
            self.created += 1
            heightfield = Heightfield(self._client, size, spacing, bound, self.created * _PARK_STEP, self._visual)
            self._pairs.claim(heightfield.body)
        self._pairs.join(heightfield.body, body, link)
        return heightfield

    def forget_contacts(self, heightfield: Heightfield, body: int, link: int) -> None:
        """Has PyBullet look for the contacts of a heightfield and its body anew, as it does when told a pair's rule."""
        pb.setCollisionFilterPair(heightfield.body, body, -1, link, 1, self._client_id)

    def give_back(self, heightfield: Heightfield, body: int, link: int) -> None:
        """Parks a heightfield that ``body`` or its ``link`` no longer needs."""
        client = self._client
        self._pairs.part(heightfield.body, body, link)
        client.resetBasePositionAndOrientation(heightfield.body, heightfield.park_position, [0.0, 0.0, 0.0, 1.0])
        client.resetBaseVelocity(heightfield.body, [0.0, 0.0, 0.0], [0.0, 0.0, 0.0])
        self._free[heightfield.kind].append(heightfield)
