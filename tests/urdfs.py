"""Robot descriptions, put together from their parts."""

from __future__ import annotations

from pathlib import Path

import pybullet_data

ROVER = str(Path(__file__).parent / "data" / "rover.urdf")
HUSKY = str(Path(pybullet_data.getDataPath()) / "husky" / "husky.urdf")


def inertial(mass: float, moment: float = 0.02, centre: str = "0 0 0") -> str:
    """Mass [kg], moments of inertia [kg m^2] and centre of mass [m] of a link."""
    moments = f'<inertia ixx="{moment}" iyy="{moment}" izz="{moment}" ixy="0" ixz="0" iyz="0"/>'
    return f'<inertial><origin xyz="{centre}"/><mass value="{mass}"/>{moments}</inertial>'


def link(
    name: str, shape: str = '<sphere radius="0.1"/>', mass: float | None = 1.0, moment: float = 0.02, more: str = ""
) -> str:
    """A link of a shape, without a shape if that is empty; ``more``: further elements."""
    collision = f"<collision><geometry>{shape}</geometry></collision>" if shape else ""
    return f'<link name="{name}">{more}{inertial(mass, moment) if mass is not None else ""}{collision}</link>'


def joint(
    name: str, kind: str, parent: str, child: str, more: str = "", xyz: str = "0 0 0.3", axis: str = "0 1 0"
) -> str:
    """A joint at a place [m] of its parent; without a type if ``kind`` is empty."""
    typed = f'type="{kind}"' if kind else ""
    return (
        f'<joint name="{name}" {typed}><parent link="{parent}"/><child link="{child}"/><origin xyz="{xyz}"/>'
        f'<axis xyz="{axis}"/>{more}</joint>'
    )


def robot(*parts: str) -> str:
    return f'<robot name="r">{"".join(parts)}</robot>'
