"""Robot descriptions as text or files, parsed, and checked as a tree of links and joints.

PyBullet's loader checks little: two roots, a name given twice or a link with two parents end the process. No parser is
among this package's dependencies (urdfdom has no Python interface in ROS 2, urdf_parser_py checks no tree). The check
here is complete: one root, and every other link is the child of exactly one joint and is reached from the root.
"""

from __future__ import annotations

import re
from collections import Counter, deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from urllib.parse import unquote
from xml.etree import ElementTree

from smartmesh_ros.errors import InputError, listed
from smartmesh_ros.world.paths import expanded, package_folder

# PyBullet also knows spherical joints, which URDF does not have.
JOINT_TYPES = ("revolute", "continuous", "prismatic", "fixed", "planar", "spherical")
# Longest name of a link or joint [bytes]; PyBullet copies names into fields of 1024 bytes.
LONGEST_NAME = 500
# What texts of editors on Windows may begin with.
BYTE_ORDER_MARK = "\ufeff"


@dataclass(frozen=True)
class Joint:
    """A joint between two links, by their names."""

    name: str
    kind: str
    parent: str
    child: str
    element: ElementTree.Element = field(repr=False, compare=False)


@dataclass(frozen=True)
class Description:
    """A robot whose links and joints form a tree. ``folder``: of its file, None for a text. ``links``: elements by
    name."""

    robot: ElementTree.Element
    folder: Path | None
    links: dict[str, ElementTree.Element]
    joints: tuple[Joint, ...]
    root: str

    def collisions(self, link: str) -> list[ElementTree.Element]:
        """Return the collision elements of a link."""
        return self.links[link].findall("collision")

    def fixed_to_root(self) -> Iterator[str]:
        """Yield the links that fixed joints hold to the root, nearest first."""
        waiting = deque([self.root])
        while waiting:
            link = waiting.popleft()
            children = [joint.child for joint in self.joints if joint.parent == link and joint.kind == "fixed"]
            yield from children
            waiting += children


def is_text(urdf: str) -> bool:
    """Return True if a description is given as text, False if by the path of its file."""
    return urdf.lstrip().startswith("<")


def located(urdf: str) -> str:
    """Return the path of a description's file, as of `expanded`; a text without its byte order mark. Raises
    `InputError`."""
    urdf = urdf.removeprefix(BYTE_ORDER_MARK)
    return urdf if is_text(urdf) else str(expanded(urdf))


def urdf_text(urdf: str) -> str:
    """Return the text of a URDF file; a text is returned as it is. Raises `InputError` if the file cannot be read."""
    if is_text(urdf):
        return urdf
    path = Path(urdf)
    try:
        if path.is_file():
            return path.read_text(encoding="utf-8")
    except (OSError, ValueError) as error:
        raise InputError("urdf", f"URDF file {urdf!r} cannot be read: {error}") from None
    raise InputError("urdf", f"there is no URDF file {str(Path(urdf[:200]).absolute())!r}")


def read_description(urdf: str) -> Description:
    """Parse a robot from its URDF text, or from the path of its file. Raises `InputError` if the file cannot be read,
    or the text is no robot whose links and joints form a tree."""
    robot = xml_of(urdf_text(urdf))
    _require_expanded(robot)
    links = _named(robot, "link")
    joints = tuple(_joint(element, name, links) for name, element in _named(robot, "joint").items())
    folder = None if is_text(urdf) else Path(urdf).parent
    return Description(robot, folder, links, joints, _root(links, joints))


def xml_of(text: str) -> ElementTree.Element:
    """Return the root element <robot> of a URDF text. Space before the XML declaration is skipped, as other parsers
    do. Raises `InputError`."""
    if re.search(r"<!(?!--|\[CDATA\[)", text):
        raise InputError("urdf", "the URDF declares a document type or entities; a robot description needs none")
    text = text.rstrip("\0").removeprefix(BYTE_ORDER_MARK).strip()  # some files end with a zero byte
    if "\0" in text:
        raise InputError("urdf", "the URDF has a zero byte in it")
    try:
        robot = ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError) as error:
        if "xacro:" in text:
            raise _not_expanded("xacro:") from None
        raise InputError("urdf", f"the URDF does not load, it is no XML ({error}); check it with check_urdf") from None
    if robot.tag != "robot":
        raise InputError("urdf_format", f"the robot is a <{robot.tag}>; it must be URDF, a <robot>")
    return robot


def _not_expanded(found: str) -> InputError:
    return InputError(
        "urdf", f"the robot is Xacro ({found[:80]!r}), not URDF; expand it first: xacro robot.urdf.xacro > robot.urdf"
    )


def _require_expanded(robot: ElementTree.Element) -> None:
    """Raise `InputError` if a Xacro element or expression is left in the robot."""
    for element in robot.iter():
        space, _, name = element.tag.rpartition("}")
        if "xacro" in space:
            raise _not_expanded(f"<xacro:{name}>")
    for element in (robot, *(e for tag in ("link", "joint") for child in robot.findall(tag) for e in child.iter())):
        for value in (*element.attrib.values(), element.text or ""):
            if "${" in value:
                raise _not_expanded(value.strip())


def _named(robot: ElementTree.Element, tag: str) -> dict[str, ElementTree.Element]:
    """Return the elements of a tag by their names, which must be distinct."""
    elements = robot.findall(tag)
    names = [element.get("name", "") for element in elements]
    for name, count in Counter(names).items():
        if not name:
            raise InputError("urdf", f"a {tag} of the URDF has no name")
        if len(name.encode()) > LONGEST_NAME:
            raise InputError("urdf", f"a {tag} has a name of {len(name)} characters; {LONGEST_NAME} are possible")
        if count > 1:
            raise InputError("urdf", f"{count} {tag}s are named {name!r}; each {tag} needs a name of its own")
    return dict(zip(names, elements, strict=True))


def _joint(element: ElementTree.Element, name: str, links: dict[str, ElementTree.Element]) -> Joint:
    kind = element.get("type")
    if kind == "floating":
        raise InputError(
            "urdf", f"joint {name!r} is floating, which is not possible; make its child a robot of its own"
        )
    if kind not in JOINT_TYPES:
        what = "no type" if kind is None else f"the type {kind[:80]!r}"
        raise InputError("urdf", f"joint {name!r} has {what}; it must be one of {', '.join(JOINT_TYPES)}")
    ends = []
    for end in ("parent", "child"):
        found = element.findall(end)
        link = found[0].get("link", "") if len(found) == 1 else None
        if link is None:
            raise InputError("urdf", f"joint {name!r} has {len(found)} elements <{end}>; it needs one")
        if link not in links:
            raise InputError("urdf", f"the {end} of joint {name!r} is link {link!r}, which does not exist")
        ends.append(link)
    return Joint(name, kind, ends[0], ends[1], element)


def _root(links: dict[str, ElementTree.Element], joints: tuple[Joint, ...]) -> str:
    """Return the name of the root. Raises `InputError` unless the links and joints form a tree."""
    if not links:
        raise InputError("urdf", "the URDF has no link")
    above: dict[str, Joint] = {}
    for joint in joints:
        if joint.child in above:
            raise InputError(
                "urdf", f"link {joint.child!r} is the child of joints {above[joint.child].name!r} and {joint.name!r}; "
                "a link has one parent, and closed loops are not possible"
            )  # fmt: skip
        above[joint.child] = joint
    roots = [link for link in links if link not in above]
    if len(roots) > 1:
        named = listed([*map(repr, roots)])
        raise InputError("urdf", f"{len(roots)} links have no parent: {named}; one is the root, joints hold the others")
    try:
        TopologicalSorter({joint.child: [joint.parent] for joint in joints}).prepare()
    except CycleError as error:
        raise InputError(
            "urdf", f"link {error.args[1][0]!r} is its own ancestor by the joints above it; links must form a tree"
        ) from None
    return roots[0]


# A file's URI may name this machine.
_SCHEME = re.compile(r"(package|model|file)://(?:(?<=file://)localhost(?=/))?")


def named_file(name: str, folder: Path | None) -> Path:
    """Return the file that a description in ``folder`` (None = a text) names; symbolic links are resolved.

    ``package://<package>/...`` is a file of an installed package, or else is searched as a relative path is: in the
    folder of the description, those above it, and the working directory. Of a URI, ``%20`` and the like may stand for
    characters. Raises `InputError` if there is no file.
    """
    if "\0" in name or not name.strip():
        raise InputError("urdf", f"the URDF names a file {name!r}")
    if "$(" in name:
        raise _not_expanded(name)
    scheme = _SCHEME.match(name)
    rest = name[scheme.end() :] if scheme else name
    package, _, inside = rest.partition("/")
    candidates = [Path(rest)] if rest.startswith("/") else []
    if scheme and scheme[1] == "package" and (share := package_folder(package)) is not None:
        candidates.append(share / inside)
    above = [] if folder is None else [folder, *folder.parents]
    candidates += [place / rest for place in (*above, Path.cwd())]
    if scheme:
        candidates += [Path(unquote(str(path))) for path in candidates]
    try:
        found = next((path for path in candidates if path.is_file()), None)
        if found is not None:
            return found.resolve()
    except (OSError, RuntimeError, ValueError) as error:
        raise InputError("urdf", f"{name[:200]!r} is not a path: {error}") from None
    if scheme and scheme[1] == "package" and package_folder(package) is None:
        words = f"package {package!r} is not installed, or not sourced"
        unnamed = f"{name[:200]!r} names no package; write package://<package>/<file>"
        raise InputError("urdf_package", words if package else unnamed)
    words = "; a text has no folder, so name meshes by their full paths or by package://, or give the path of the file"
    missing = f"the URDF names a file {name[:200]!r} that does not exist"
    raise InputError("no_asset", missing + (words if folder is None else ""))
