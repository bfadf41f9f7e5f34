"""Validation of untrusted robot descriptions before PyBullet loads them.

PyBullet opens every file that a description names. So the description and all meshes and images it names must lie in an
allowed folder, after symbolic links are resolved. All numbers must be in the range that the engine can handle.
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

# Schemes of file names. The rest of the name is searched in the folder of the description and the folders above it.
_SCHEMES = ("package://", "model://", "file://")
_SIZES = {"box": ("size",), "sphere": ("radius",), "cylinder": ("radius", "length"), "capsule": ("radius", "length")}
_NUMBER = re.compile(r"nan|inf|[-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?", re.IGNORECASE)
_LEAST_MASS = 1e-9  # of a link [kg]; robots in use have frames of 1e-7 kg
_LARGEST_INERTIA = 1e18  # [kg m^2]


@dataclass(frozen=True, kw_only=True)
class UrdfRules:
    """``folders``: allowed for descriptions and meshes. ``longest``: maximum length of a description [bytes].
    ``most_links``: maximum number of links of a robot."""

    folders: tuple[Path, ...]
    longest: int = 10_000_000
    most_links: int = 1000


def checked_urdf(urdf: str, rules: UrdfRules) -> str:
    """Return a description that is safe to load: the text itself, or the resolved path of its file.

    Raises `InputError`.
    """
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
        raise InputError("size", f"the URDF has {links} links; the maximum is {rules.most_links}")
    seen = {element for visual in root.iter("visual") for element in visual.iter()}
    for element in root.iter():
        if element not in seen:  # a shape that is only seen may have any size
            _check_sizes(element)
        _check_numbers(element)
        for key, name in element.attrib.items():
            if key in ("filename", "file", "uri", "url") and element.tag != "plugin":  # PyBullet ignores plugins
                _require_file(name, folder, rules, must_exist=element.tag == "mesh")
    children = {child.get("link") for child in root.iter("child")}
    for link in root.iter("link"):
        if link.get("name") not in children:
            _check_inertia(link)


def _check_sizes(element: ElementTree.Element) -> None:
    for key in _SIZES.get(element.tag, ()):
        for value in _numbers(element, key):
            if not SIZES[0] <= value <= SIZES[1]:
                raise InputError(
                    "urdf", f"{key} of a {element.tag} is {value:g} m; it must be {SIZES[0]:g} to {SIZES[1]:g}"
                )


def _check_numbers(element: ElementTree.Element) -> None:
    tag = element.tag
    if tag == "mass":
        for value in _numbers(element, "value"):
            if value and not _LEAST_MASS <= value <= MASSES[1]:
                raise InputError("urdf", f"a mass is {value:g} kg; it must be 0, or {_LEAST_MASS:g} to {MASSES[1]:g}")
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
    """Raise `InputError` if no body can have the inertia of a robot's root link.

    PyBullet replaces an impossible inertia by zero, and the position of a root without inertia may become NaN after a
    step. Other links work with zero inertia, and some robots use that on purpose.
    """
    inertia, mass = root_link.find("inertial/inertia"), root_link.find("inertial/mass")
    if inertia is None or mass is None or not any(_numbers(mass, "value")):
        return
    values = {key: next(iter(_numbers(inertia, key)), 0.0) for key in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")}
    xx, yy, zz, xy, xz, yz = values.values()
    least, middle, most = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]).tolist()
    if least < 0.0 or most > least + middle:
        raise InputError(
            "urdf",
            f"link {root_link.get('name')!r} has impossible principal moments of inertia {least:g}, {middle:g}, "
            f"{most:g} kg m^2: none may be negative or greater than the sum of the other two",
        )


def _numbers(element: ElementTree.Element, key: str) -> Sequence[float]:
    text = element.get(key, "")
    values = [float(number) for number in _NUMBER.findall(text)]  # PyBullet reads other text as zero
    if not all(map(math.isfinite, values)):
        raise InputError("urdf", f"{key} of a {element.tag} is {text[:80]!r}; every number must be finite")
    return values


def _require_file(name: str, folder: Path | None, rules: UrdfRules, *, must_exist: bool) -> None:
    """Raise `InputError` unless every file that PyBullet might open for ``name`` is in an allowed folder."""
    for scheme in _SCHEMES:
        name = name.removeprefix(scheme)
    if "\0" in name or not name:
        raise InputError("urdf", f"the URDF names a file {name!r}")
    found = [path for path in map(_resolved, _candidates(name, folder)) if path.is_file()]
    for path in found:
        _require_inside(path, rules, f"the URDF names the file {name!r}, which")
    if must_exist and not found:
        raise InputError("urdf", f"the URDF names a file {name!r} that does not exist")


def _candidates(name: str, folder: Path | None) -> Iterable[Path]:
    if Path(name).is_absolute():
        return [Path(name)]
    above = [] if folder is None else [folder, *folder.parents]
    return [place / name for place in (*above, Path.cwd())]


def _resolved(path: Path) -> Path:
    try:
        return path.expanduser().resolve()
    except (OSError, RuntimeError, ValueError) as error:
        raise InputError("urdf", f"{str(path)[:200]!r} is not a path: {error}") from None


def _require_inside(path: Path, rules: UrdfRules, what: str) -> None:
    if not any(path.is_relative_to(_resolved(folder)) for folder in rules.folders):
        folders = ", ".join(map(str, rules.folders)) or "none"
        raise InputError("folder", f"{what} is outside the allowed folders ({folders}); see bodies.urdf_folders")


def _require_length(length: int, rules: UrdfRules) -> None:
    if length > rules.longest:
        raise InputError("size", f"the URDF has {length} bytes; the maximum is {rules.longest}")
