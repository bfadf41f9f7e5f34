"""Prepared robots into PyBullet."""

from __future__ import annotations

import hashlib
import tempfile
from collections.abc import Iterable
from functools import cache
from pathlib import Path
from typing import Any

import pybullet as pb

from smartmesh_ros.errors import InputError
from smartmesh_ros.world.robots.meaning import Mimic
from smartmesh_ros.world.robots.prepared import PreparedRobot

# Largest effort of a mimic joint's gear [Nm, N], beyond that of any robot's drive.
STRONGEST_GEAR = 1e5
# Ratio of a gear instead of zero, which PyBullet ignores.
TINY_RATIO = 1e-12
# Share of a gear's error that each step corrects.
GEAR_ERP = 0.2


def load_robot(client: Any, robot: PreparedRobot, flags: int) -> int:
    """Load a robot at the origin by ``loadURDF``, and return its PyBullet body. Raises `InputError`."""
    try:
        folder = Path(_folder().name)
        folder.mkdir(exist_ok=True)  # a cleaner of temporary files may have removed it
        # PyBullet remembers OBJ files by name; these names differ with the content.
        for name, data in robot.files.items():
            if not (folder / name).exists():
                unfinished = folder / f"{name}.part"  # a file that could not be written whole is not taken for one
                unfinished.write_bytes(data)
                unfinished.rename(folder / name)
        file = folder / f"{hashlib.sha256(robot.text.encode()).hexdigest()[:32]}.urdf"
        file.write_text(robot.text, encoding="utf-8")
        return int(client.loadURDF(str(file), flags=flags))
    except (pb.error, OSError) as error:
        raise InputError("urdf", f"the URDF does not load ({error}); check it with check_urdf") from None


def couple_joints(client: Any, uid: int, joints: dict[str, int], mimics: Iterable[Mimic]) -> None:
    """Couple joints that mimic others by gears, which PyBullet removes with the body."""
    for mimic in mimics:
        gear = client.createConstraint(
            uid, joints[mimic.joint], uid, joints[mimic.leader], pb.JOINT_GEAR, (0, 0, 1), (0, 0, 0), (0, 0, 0)
        )
        client.changeConstraint(
            gear, gearRatio=-mimic.multiplier or -TINY_RATIO, relativePositionTarget=mimic.offset, erp=GEAR_ERP,
            maxForce=STRONGEST_GEAR,
        )  # fmt: skip


@cache
def _folder() -> tempfile.TemporaryDirectory[str]:
    """Return the folder of this process's robots, which is removed at its end."""
    return tempfile.TemporaryDirectory(prefix="smartmesh_robots_")
