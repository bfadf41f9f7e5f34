"""Elements of a description that would change motion elsewhere and have no effect here."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator

from smartmesh_ros.world.robots.description import Description
from smartmesh_ros.world.robots.quantities import LIMITED, limits_of, number_of

# Elements of Gazebo, by the lower-case name, that change how its robot moves.
_OF_GAZEBO = frozenset(
    (
        "dampingfactor", "gravity", "implicitspringdamper", "kd", "kp", "maxvel", "mindepth", "mu", "mu1", "mu2",
        "selfcollide", "springreference", "springstiffness", "static", "turngravityoff",
    )
)  # fmt: skip
# What they say where they change nothing.
_USUAL = {
    "gravity": "true", "implicitspringdamper": "false", "selfcollide": "false", "static": "false",
    "turngravityoff": "false",
}  # fmt: skip
# Children of <contact> without effect on contacts with the ground.
_OF_CONTACTS = ("contact_cfm", "contact_erp")


def ignored_in(robot: Description) -> str:
    """Return a note about the elements of a robot that have no effect here; empty if there are none."""
    places: dict[str, dict[str, None]] = defaultdict(dict)  # by what they say
    for what, where in (*_in_gazebo(robot), *_in_links(robot), *_in_joints(robot)):
        places[what][where] = None
    said: dict[str, list[str]] = defaultdict(list)  # by where it is said
    for what, where_all in places.items():
        said[", ".join(where_all)].append(what)
    told = [f"{', '.join(words)} of {where}" for where, words in said.items()]
    return f"without effect: {'; '.join(told)}" if told else ""


def _in_gazebo(robot: Description) -> Iterator[tuple[str, str]]:
    for block in robot.robot.findall("gazebo"):
        for child in block:
            name, value = str(child.tag).lower(), (child.text or "").strip().lower()
            if name in _OF_GAZEBO and value != _USUAL.get(name):
                yield f"<gazebo> {child.tag}", block.get("reference", "the robot")


def _in_links(robot: Description) -> Iterator[tuple[str, str]]:
    for name, link in robot.links.items():
        if next(link.iter("contact_coefficients"), None) is not None:
            yield "<contact_coefficients>", name
        for key in _OF_CONTACTS:
            if link.find(f"contact/{key}") is not None:
                yield f"<contact> {key}", name


def _in_joints(robot: Description) -> Iterator[tuple[str, str]]:
    for joint in robot.joints:
        if joint.element.find("safety_controller") is not None:
            yield "<safety_controller>", joint.name
        limit, dynamics = joint.element.find("limit"), joint.element.find("dynamics")
        if joint.kind in LIMITED and limit is not None:
            low, high = limits_of(limit)
            if low > high:
                words = "lower above upper" if limit.get("lower") and limit.get("upper") else "no lower and upper"
                yield f"<limit> ({words})", joint.name
        if joint.kind == "planar" and dynamics is not None and number_of(dynamics, "friction", 0.0):
            yield "<dynamics> friction", joint.name
