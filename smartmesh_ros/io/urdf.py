"""Robot descriptions that somebody else sent: checked before PyBullet reads them.

PyBullet opens whatever file a description names. So a description, and every mesh and picture it names, must lie in one
of the folders allowed, symbolic links followed; and its numbers must be some that the engine can compute with.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from smartmesh_ros.errors import InputError
from smartmesh_ros.physics.limits import FARTHEST_BODY, MASSES, SIZES

# Schemes that a file name may carry; what follows is looked for beside the description and in the folders above it.
_SCHEMES = ("package://", "model://", "file://")
_SIZES = {"box": ("size",), "sphere": ("radius",), "cylinder": ("radius", "length"), "capsule": ("radius", "length")}
_NUMBER = re.compile(r"nan|inf|[-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?", re.IGNORECASE)
_LARGEST_INERTIA = 1e18  # [kg m^2]


@dataclass(frozen=True, kw_only=True)
class UrdfRules:
    """``folders``: where descriptions and meshes may lie. ``longest``: bytes of a description. ``most_links``: of one
    robot."""

    folders: tuple[Path, ...]
    longest: int = 10_000_000
    most_links: int = 1000


def checked_urdf(urdf: str, rules: UrdfRules) -> str:
    """The description as it may be loaded: the text itself, or the path of its file without symbolic links. Raises
    `InputError`."""
    if urdf.lstrip().startswith("<"):
        _require_length(len(urdf), rules)
        _check_text(urdf, None, rules)
        return urdf
    path = _resolved(Path(urdf))
    _require_inside(path, rules, f"URDF file {urdf!r}")
    if not path.is_file():
        raise InputError("urdf", f"there is no URDF file {urdf!r}")
    _require_length(path.stat().st_size, rules)
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError("urdf", f"URDF file {urdf!r} cannot be read: {error}") from None
    _check_text(text, path.parent, rules)
    return str(path)


def _check_text(text: str, folder: Path | None, rules: UrdfRules) -> None:
    if "<!" in text.replace("<!--", ""):
        raise InputError("urdf", "the URDF declares a document type or entities; a robot description needs none")
    if "\0" in text:
        raise InputError("urdf", "the URDF has a zero byte in it")
    try:
        root = ElementTree.fromstring(text.lstrip())
    except (ElementTree.ParseError, ValueError) as error:
        raise InputError("urdf", f"the URDF does not load ({error}); check it with check_urdf") from None
    links = sum(1 for _ in root.iter("link"))
    if links > rules.most_links:
        raise InputError("size", f"the URDF has {links} links; the most allowed is {rules.most_links}")
    for element in root.iter():
        _check_numbers(element)
        for key, name in element.attrib.items():
            if key in ("filename", "file", "uri", "url") and element.tag != "plugin":  # a simulator's, not PyBullet's
                _require_file(name, folder, rules, must_exist=element.tag == "mesh")
    children = {child.get("link") for child in root.iter("child")}
    for link in root.iter("link"):
        if link.get("name") not in children:
            _check_inertia(link)


def _check_numbers(element: ElementTree.Element) -> None:
    tag = element.tag
    for key in _SIZES.get(tag, ()):
        for value in _numbers(element, key):
            if not SIZES[0] <= value <= SIZES[1]:
                raise InputError("urdf", f"{key} of a {tag} is {value:g} m; it must be {SIZES[0]:g} to {SIZES[1]:g}")
    if tag == "mass":
        for value in _numbers(element, "value"):
            if value and not MASSES[0] <= value <= MASSES[1]:
                raise InputError("urdf", f"a mass is {value:g} kg; it must be 0, or {MASSES[0]:g} to {MASSES[1]:g}")
    if tag == "inertia":
        for key in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz"):
            if any(abs(value) > _LARGEST_INERTIA for value in _numbers(element, key)):
                raise InputError("urdf", f"{key} is more than {_LARGEST_INERTIA:g} kg m^2")
    if tag in ("origin", "axis"):
        for key in ("xyz", "rpy"):
            if any(abs(value) > FARTHEST_BODY for value in _numbers(element, key)):
                raise InputError("urdf", f"{key} of an {tag} is more than {FARTHEST_BODY:g}")
    if tag == "mesh" and any(not 1e-6 <= abs(value) <= 1e6 for value in _numbers(element, "scale")):
        raise InputError("urdf", "the scale of a mesh must be 1e-6 to 1e6")


def _check_inertia(root_link: ElementTree.Element) -> None:
    """PyBullet takes an inertia that no body can have for zero, with which the root of a robot may be nowhere after a
    step. Other links go on without one, and some robots have none on purpose: their links have it."""
    inertia, mass = root_link.find("inertial/inertia"), root_link.find("inertial/mass")
    if inertia is None or mass is None or not any(_numbers(mass, "value")):
        return
    values = {key: next(iter(_numbers(inertia, key)), 0.0) for key in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")}
    xx, yy, zz, xy, xz, yz = values.values()
    least, middle, most = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]).tolist()
    if least < 0.0 or most > least + middle:
        raise InputError(
            "urdf",
            f"no body has the principal moments of inertia {least:g}, {middle:g}, {most:g} kg m^2, as link "
            f"{root_link.get('name')!r} does: none may be negative, nor more than the other two together",
        )


def _numbers(element: ElementTree.Element, key: str) -> Sequence[float]:
    text = element.get(key, "")
    values = [float(number) for number in _NUMBER.findall(text)]  # whatever else stands there PyBullet takes for zero
    if not all(map(math.isfinite, values)):
        raise InputError("urdf", f"{key} of a {element.tag} is {text[:80]!r}; every number must be finite")
    return values


def _require_file(name: str, folder: Path | None, rules: UrdfRules, *, must_exist: bool) -> None:
    """Every file that PyBullet might take for ``name`` must be in the folders."""
    for scheme in _SCHEMES:
        name = name.removeprefix(scheme)
    if "\0" in name or not name:
        raise InputError("urdf", f"the URDF names a file {name!r}")
    found = [path for path in map(_resolved, _candidates(name, folder)) if path.is_file()]
    for path in found:
        _require_inside(path, rules, f"the URDF names the file {name!r}, which")
    if must_exist and not found:
        raise InputError("urdf", f"the URDF names a file {name!r} that is not there")


def _candidates(name: str, folder: Path | None) -> Iterable[Path]:
    if Path(name).is_absolute():
        return [Path(name)]
    above = [] if folder is None else [folder, *folder.parents]
    return [place / name for place in (*above, Path.cwd())]


def _resolved(path: Path) -> Path:
    try:
        return path.expanduser().resolve()
    except (OSError, RuntimeError, ValueError) as error:
        raise InputError("urdf", f"{str(path)[:200]!r} is no path: {error}") from None


def _require_inside(path: Path, rules: UrdfRules, what: str) -> None:
    if not any(path.is_relative_to(_resolved(folder)) for folder in rules.folders):
        folders = ", ".join(map(str, rules.folders)) or "none"
        raise InputError("folder", f"{what} is outside the folders allowed ({folders}); see bodies.urdf_folders")


def _require_length(length: int, rules: UrdfRules) -> None:
    if length > rules.longest:
        raise InputError("size", f"the URDF has {length} bytes; the most allowed is {rules.longest}")
