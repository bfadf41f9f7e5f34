"""Robot descriptions, put together from their parts."""

from pathlib import Path

import pybullet_data

ROVER = str(Path(__file__).parent / "data" / "rover.urdf")
HUSKY = str(Path(pybullet_data.getDataPath()) / "husky" / "husky.urdf")
Edges = tuple[float, float, float]  # of a box [m]


def box(edges: Edges) -> str:
    return '<box size="{} {} {}"/>'.format(*edges)


def mesh(file: str | Path, more: str = "") -> str:
    return f'<mesh filename="{file}" {more}/>'


def inertial(mass: float, moment: float | Edges = 0.02, centre: str = "0 0 0") -> str:
    """Mass [kg] and centre of mass [m] of a link, and its moments of inertia: three equal ones [kg m^2], or those of a
    box of these edges."""
    moments: tuple[float, ...] = (moment,) * 3 if isinstance(moment, float) else box_moments(mass, moment)
    inertia = '<inertia ixx="{}" iyy="{}" izz="{}" ixy="0" ixz="0" iyz="0"/>'.format(*moments)
    return f'<inertial><origin xyz="{centre}"/><mass value="{mass}"/>{inertia}</inertial>'


def box_moments(mass: float, edges: Edges) -> tuple[float, float, float]:
    x, y, z = (edge * edge for edge in edges)
    return mass * (y + z) / 12, mass * (x + z) / 12, mass * (x + y) / 12


def link(
    name: str, shape: str = '<sphere radius="0.1"/>', mass: float | None = 1.0, moment: float | Edges = 0.02,
    more: str = "", at: str = "0 0 0", rpy: str = "0 0 0",
) -> str:  # fmt: skip
    """A link of a shape, without a shape if that is empty. ``at`` [m]: where its centre of mass and its shape are;
    ``rpy`` [rad]: the turn of the shape. ``more``: further elements."""
    origin = f'<origin xyz="{at}" rpy="{rpy}"/>'
    collision = f"<collision>{origin}<geometry>{shape}</geometry></collision>" if shape else ""
    return f'<link name="{name}">{more}{inertial(mass, moment, at) if mass is not None else ""}{collision}</link>'


def joint(
    name: str, kind: str, parent: str, child: str, more: str = "",
    xyz: str = "0 0 0.3", axis: str = "0 1 0", rpy: str = "0 0 0",
) -> str:  # fmt: skip
    """A joint at a place [m] of its parent; without a type if ``kind`` is empty."""
    typed = f'type="{kind}"' if kind else ""
    return (
        f'<joint name="{name}" {typed}><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="{axis}"/>{more}</joint>'
    )


def robot(*parts: str) -> str:
    return f'<robot name="r">{"".join(parts)}</robot>'
