"""The shown state of bodies, patches and contacts, as plain values."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.tools.client.patch import Patch

Vector = tuple[float, float, float]
# (w, x, y, z), the order of viser.
Quaternion = tuple[float, float, float, float]


class Pose(NamedTuple):
    """Position [m] and orientation (w, x, y, z) in the terrain's frame."""

    position: Vector
    wxyz: Quaternion


@dataclass(frozen=True)
class Appearance:
    """Shape of a body: the ``kind`` and ``dimensions`` [m] of BodyDescription, or a URDF and its file."""

    kind: int
    dimensions: tuple[float, ...] = ()
    tracked: bool = False
    urdf: str = ""
    urdf_file: str = ""


class Contacts(NamedTuple):
    """Contacts (n): ``positions`` and ``normals`` (n, 3) [m], ``forces`` (n,) [N]."""

    positions: NDArray[np.float64]
    normals: NDArray[np.float64]
    forces: NDArray[np.float64]


NO_CONTACTS = Contacts(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0))


@dataclass
class Sight:
    """The newest state of everything but the terrain. ``poses`` and ``appearances`` by body; ``asleep``: simulated
    bodies without any velocity; ``bases``: poses of robots' base links by frame as in ~/odometry; ``joints``: positions
    [rad, m] by name as in ~/joint_states."""

    poses: dict[str, Pose] = field(default_factory=dict)
    appearances: dict[str, Appearance] = field(default_factory=dict)
    asleep: frozenset[str] = frozenset()
    bases: dict[str, Pose] = field(default_factory=dict)
    joints: dict[str, float] = field(default_factory=dict)
    patches: list[Patch] = field(default_factory=list)
    contacts: Contacts = NO_CONTACTS
