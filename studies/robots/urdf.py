"""Robot descriptions as text: their parts, and a rover; and as files, for loaders that read no text."""

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from tempfile import NamedTemporaryFile


@contextmanager
def as_file(text: str) -> Iterator[str]:
    """Yield the path of a file with a description, which is there for the length of the block."""
    with NamedTemporaryFile("w", suffix=".urdf") as file:
        file.write(text)
        file.flush()
        yield file.name


def link_of(name: str, mass: float, inertia: tuple[float, float, float], collision: str = "") -> str:
    """Return a link of a robot description, with a ``mass`` [kg] and moments of ``inertia`` [kg m^2]."""
    x, y, z = inertia
    return (
        f'<link name="{name}"><inertial><mass value="{mass}"/><inertia ixx="{x}" iyy="{y}" izz="{z}" ixy="0" ixz="0" '
        f'iyz="0"/></inertial>{collision}</link>'
    )


def joint_of(name: str, parent: str, child: str, axis: str, more: str = "", kind: str = "continuous") -> str:
    """Return a joint of a robot description, with ``more`` elements."""
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/><axis xyz="{axis}"/>'
        f"{more}</joint>"
    )


def rover(wheels: Sequence[str]) -> str:
    """Return a rover from primitives: a box on four cylinders, whose joints are its ``wheels``, front left, front
    right, rear left and rear right. 14 kg; its wheels stand 0.12 m below their axles."""
    box = '<collision><origin xyz="0 0 0.06"/><geometry><box size="0.6 0.4 0.15"/></geometry></collision>'
    drum = '<geometry><cylinder radius="0.12" length="0.08"/></geometry>'
    turned = f'<collision><origin rpy="{0.5 * math.pi} 0 0"/>{drum}</collision>'
    links, joints = [link_of("chassis", 10.0, (0.152, 0.319, 0.433), box)], []
    for index, wheel in enumerate(wheels):
        place = f"{(0.22, -0.22)[index // 2]} {(0.25, -0.25)[index % 2]} 0"
        links.append(link_of(f"{wheel}_link", 1.0, (0.0041, 0.0072, 0.0041), turned))
        joints.append(joint_of(wheel, "chassis", f"{wheel}_link", "0 1 0", f'<origin xyz="{place}"/>'))
    return f'<robot name="rover">{"".join([*links, *joints])}</robot>'
