"""MuJoCo's ground from served patches: one small height field a wheel, written anew and moved to each new patch."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from smartmesh_ros.client import Patch, PatchClient
from smartmesh_ros.studies.consumer.cases import COLLIDER
from smartmesh_ros.studies.consumer.rover import CONTACT, RANGE, WHEELS, FieldSpec, Rover, yaw_quaternion

# Samples on a side of a wheel's field, at the most: nodes serve patches of tracked bodies with up to 9 or so.
MOST = 33
# Samples that a field is larger than its patch on each side, as high as the patch's rim: a wheel that gets there while
# the node stalls does not fall.
RIM = 6
# MuJoCo's contacts do not know that the ground moves: a wheel stays behind it by its speed times twice the time
# constant of the contact. So much further the patches are moved on [s].
LEAD = 2.0 * CONTACT


class ServedGround:
    """The rover's wheels are tracked bodies of a ``terrain_collider``; each stands on the patch it is served."""

    def __init__(self) -> None:
        self.client = PatchClient(COLLIDER)

    @staticmethod
    def fields() -> list[FieldSpec]:
        """One for each wheel, which alone collides with it."""
        return [
            FieldSpec(name=f"ground_{name}", rows=MOST, columns=MOST, wheels=(index,))
            for index, name in enumerate(WHEELS)
        ]

    def close(self) -> None:
        """Ends the client."""
        self.client.close()

    def now(self) -> float:
        """The clock that stamps are of [s]."""
        return self.client.now()

    @property
    def received(self) -> int:
        """Messages so far."""
        return self.client.received

    def ready(self, rover: Rover) -> bool:
        """Tells the node of the wheels; whether each has its patch."""
        self.client.track(rover.links())
        return self.client.patches().keys() >= set(WHEELS)

    def spin(self, timeout: float) -> None:
        """Takes what has arrived, waiting up to ``timeout`` [s]."""
        self.client.spin_once(timeout)

    def track(self, rover: Rover, now: float) -> None:
        """Tells the node where the wheels are at ``now`` [s]."""
        self.client.track(rover.links(), now)

    def update(self, rover: Rover, now: float) -> int:
        """Brings the wheels' fields to ``now`` [s]; returns how many wheels have no patch."""
        patches = self.client.patches(now + LEAD)
        for index, name in enumerate(WHEELS):
            patch = patches.get(name)
            if patch is not None:
                write_field(rover.model, rover.data, index, patch)
        return sum(name not in patches for name in WHEELS)

    def age(self, now: float) -> float:
        """Time since the stamp of the newest patches [s]."""
        return self.client.age(now)


def write_field(model: Any, data: Any, field: int, patch: Patch) -> None:
    """Makes MuJoCo's height field number ``field``, on mocap body of the same number, the surface of a patch.

    MuJoCo cuts each cell along the same diagonal as the node, so that the triangles are the patch's own. Holes are
    filled 1 m below the lowest vertex. Around the patch the field goes on as high as its rim.
    """
    if patch.shape is None or max(patch.shape) + 2 * RIM > MOST:
        raise ValueError(f"the patch of {patch.name!r} is no grid of at most {MOST - 2 * RIM} vertices a side")
    rows, columns = patch.shape
    first, last = patch.vertices_w[0], patch.vertices_w[-1]
    across = (patch.vertices_w[1] - first)[:2]
    down = (patch.vertices_w[columns] - first)[:2]
    heights = patch.vertices_w[:, 2]
    lowest = float(np.nanmin(heights))
    heights = np.where(np.isnan(heights), lowest - 1.0, heights)
    base = lowest - 0.5 * RANGE
    at, high, wide = model.hfield_adr[field], rows + 2 * RIM, columns + 2 * RIM
    shares = model.hfield_data[at : at + high * wide].reshape(high, wide)
    inner = shares[RIM:-RIM]
    inner[:, RIM:-RIM] = ((heights - base) / RANGE).reshape(rows, columns)
    inner[:, :RIM], inner[:, -RIM:] = inner[:, RIM, None], inner[:, -RIM - 1, None]
    shares[:RIM], shares[-RIM:] = shares[RIM], shares[-RIM - 1]
    model.hfield_nrow[field], model.hfield_ncol[field] = high, wide
    half_x, half_y = 0.5 * (wide - 1) * math.hypot(*across), 0.5 * (high - 1) * math.hypot(*down)
    model.hfield_size[field] = half_x, half_y, RANGE, 1.0
    data.mocap_pos[field] = 0.5 * (first[0] + last[0]), 0.5 * (first[1] + last[1]), base
    data.mocap_quat[field] = yaw_quaternion(math.atan2(across[1], across[0]))
