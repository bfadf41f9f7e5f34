"""The numbers of a robot description: all that PyBullet uses are there, and in a range that it can compute with.

Sizes, masses and moments of inertia must be numbers. In poses and limits PyBullet takes other text as zero, and some
robots in use have such text there.
"""

from __future__ import annotations

import math
import re
from xml.etree import ElementTree

from smartmesh_ros.errors import InputError, require
from smartmesh_ros.ground.limits import FARTHEST_BODY, MASSES, SIZES
from smartmesh_ros.world.robots.description import Description

_NUMBER_IN_TEXT = re.compile(r"[-+]?(?:nan|inf|(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?)", re.IGNORECASE)
_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?", re.IGNORECASE)
# Attributes of the shapes that collide, with the count of their numbers.
SHAPES = {
    "box": {"size": 3}, "sphere": {"radius": 1}, "cylinder": {"radius": 1, "length": 1},
    "capsule": {"radius": 1, "length": 1}, "mesh": {}, "plane": {},
}  # fmt: skip
_LARGEST_INERTIA = 1e18  # [kg m^2]
# Of links [kg]; robots in use have frames of 4e-15 kg.
_MASSES = (1e-15, MASSES[1])
_SCALES = (1e-6, 1e6)
# Kinds of joints that move along or about one axis, and those of them that have limits of their position.
MOVABLE = ("revolute", "continuous", "prismatic")
LIMITED = ("revolute", "prismatic")


def check_quantities(robot: Description) -> None:
    """Raise `InputError` unless all numbers of a robot's inertias, collision shapes and joints can be simulated."""
    for name, link in robot.links.items():
        for inertial in link.findall("inertial"):
            _check_inertial(inertial, f"link {name!r}")
        for collision in robot.collisions(name):
            _check_pose(collision, f"a collision of link {name!r}")
            _check_shape(collision, f"link {name!r}")
    for joint in robot.joints:
        what = f"joint {joint.name!r}"
        _check_pose(joint.element, what)
        if joint.kind in LIMITED and joint.element.find("limit") is None:
            raise InputError("urdf", f"{what} is {joint.kind} and has no <limit>; give it one, or make it continuous")
        for axis in joint.element.findall("axis"):
            _require_vector(axis, "xyz", what)
            if joint.kind in MOVABLE and not any(vector_of(axis, "xyz", 1.0)):
                raise InputError("urdf", f"the axis of {what} is zero")
        for tag, keys in (("limit", ("lower", "upper", "effort", "velocity")), ("dynamics", ("damping", "friction")),
                          ("mimic", ("multiplier", "offset"))):  # fmt: skip
            for element in joint.element.findall(tag):
                for key in keys:
                    _require_finite(element, key, what)
                    if tag == "dynamics" and number_of(element, key, 0.0) < 0.0:
                        raise InputError("urdf", f"the {key} of {what} is negative; it must be zero or more")


def numbers(element: ElementTree.Element, key: str, what: str, count: int) -> list[float]:
    """Return the numbers of an attribute. Raises `InputError` unless there are ``count`` and nothing else."""
    values = _require_finite(element, key, what)
    words = element.get(key, "").split()
    good, wanted = len(words) == count and all(map(_NUMBER.fullmatch, words)), f"{count} numbers"
    what = f"{key} of a {element.tag} of {what}"
    require(good, "urdf", what, element.get(key, "")[:80], "a number" if count == 1 else wanted)
    return values


def number_of(element: ElementTree.Element, key: str, default: float) -> float:
    """Return an attribute as a number, as PyBullet reads it: other text is zero."""
    return _leading(element.get(key, str(default)))


def vector_of(element: ElementTree.Element, key: str, default: float = 0.0) -> tuple[float, float, float]:
    """Return an attribute as three numbers, as PyBullet reads it."""
    words = element.get(key, "").split()
    if len(words) < 3:
        return default, default, default
    return _leading(words[0]), _leading(words[1]), _leading(words[2])


def scale_of(mesh: ElementTree.Element) -> tuple[float, float, float]:
    """Return the scale of a mesh along its axes; one number is for all."""
    words = mesh.get("scale", "").split()
    return vector_of(mesh, "scale") if len(words) > 2 else (_leading(words[0]) if words else 1.0,) * 3


def _leading(text: str) -> float:
    found = _NUMBER.match(text.strip())
    return float(found[0]) if found else 0.0


def _require_finite(element: ElementTree.Element, key: str, what: str) -> list[float]:
    """Return the numbers in an attribute. Raises `InputError` unless all are finite."""
    text = element.get(key, "")
    values = [float(number) for number in _NUMBER_IN_TEXT.findall(text)]
    if not all(map(math.isfinite, values)):
        raise InputError("urdf", f"{key} of the {element.tag} of {what} is {text[:80]!r}; every number must be finite")
    return values


def _require_vector(element: ElementTree.Element, key: str, what: str) -> list[float]:
    """Return the numbers in an attribute. Raises `InputError` unless all are finite, and for fewer than three words, of
    which PyBullet reads none."""
    values, text = _require_finite(element, key, what), element.get(key, "")
    if 0 < len(text.split()) < 3:
        raise InputError(
            "urdf", f"{key} of the {element.tag} of {what} is {text[:80]!r}; it must be 3 numbers with spaces between"
        )
    return values


def limits_of(limit: ElementTree.Element) -> tuple[float, float]:
    """Return the lowest and the highest position of a joint [rad, m], as PyBullet reads them; crossed = none."""
    return number_of(limit, "lower", 0.0), number_of(limit, "upper", -1.0)


def mass_of(link: ElementTree.Element) -> float | None:
    """Return the mass of a link [kg], None if the link has no <inertial>."""
    mass = link.find("inertial/mass")
    return None if mass is None else number_of(mass, "value", 0.0)


def _check_pose(element: ElementTree.Element, what: str) -> None:
    for origin in element.findall("origin"):
        for key in ("xyz", "rpy"):
            if any(abs(value) > FARTHEST_BODY for value in _require_vector(origin, key, what)):
                raise InputError("urdf", f"{key} of the origin of {what} is more than {FARTHEST_BODY:g}")


def _check_inertial(inertial: ElementTree.Element, what: str) -> None:
    _check_pose(inertial, what)
    mass, inertia = inertial.find("mass"), inertial.find("inertia")
    for element in inertial.findall("inertia"):
        for key in ("ixx", "iyy", "izz"):
            numbers(element, key, what, 1)
        for key in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz"):
            if any(abs(value) > _LARGEST_INERTIA for value in _require_finite(element, key, what)):
                raise InputError("urdf", f"{key} of {what} is more than {_LARGEST_INERTIA:g} kg m^2")
    if mass is None or inertia is None:
        raise InputError("urdf", f"the <inertial> of {what} needs <mass value=.../> and <inertia .../>")
    [value] = numbers(mass, "value", what, 1)
    low, high = _MASSES
    require(not value or low <= value <= high, "urdf", f"the mass of {what}", value, f"0, or {low:g} to {high:g} kg")


def _check_shape(collision: ElementTree.Element, what: str) -> None:
    geometry = collision.findall("geometry")
    shapes = [shape for shape in geometry[0] if isinstance(shape.tag, str)] if len(geometry) == 1 else []
    if len(shapes) != 1 or shapes[0].tag not in SHAPES:
        found = ", ".join(f"<{shape.tag}>" for shape in shapes) or "nothing"
        raise InputError(
            "urdf", f"the geometry of a collision of {what} is {found}; it must be one of {', '.join(SHAPES)}"
        )
    [shape] = shapes
    for key, count in SHAPES[shape.tag].items():
        for value in numbers(shape, key, what, count):
            low, high = SIZES
            require(low <= value <= high, "urdf", f"{key} of a {shape.tag} of {what}", value, f"{low:g} to {high:g} m")
    if shape.tag == "mesh":
        if not shape.get("filename"):
            raise InputError("urdf", f"a mesh of {what} has no filename")
        _require_finite(shape, "scale", what)
        if any(not _SCALES[0] <= abs(value) <= _SCALES[1] for value in scale_of(shape)):
            raise InputError("urdf", f"the scale of a mesh of {what} must be {_SCALES[0]:g} to {_SCALES[1]:g}")
