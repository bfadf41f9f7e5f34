"""Bodies as entities of simulation_interfaces: those that pass an EntityFilters message, and their Bounds."""

from __future__ import annotations

import re
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import product
from threading import current_thread, main_thread
from typing import Any

import numpy as np

from smartmesh_ros.errors import InputError
from smartmesh_ros.node.services.standard import tagged
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.world.bodies import Body
from smartmesh_ros.world.world import World

# The classes of characters in POSIX regular expressions, which Python's lack.
CLASSES = {
    "alnum": "a-zA-Z0-9", "alpha": "a-zA-Z", "blank": r" \t", "cntrl": r"\x00-\x1f\x7f", "digit": "0-9",
    "graph": r"\x21-\x7e", "lower": "a-z", "print": r"\x20-\x7e", "punct": r"!-/:-@\[-`{-~", "space": r"\s",
    "upper": "A-Z", "xdigit": "0-9a-fA-F",
}  # fmt: skip
# Longest search of all names [s]. Python takes forever to find that ^(\w+)+$ does not fit a long name with a hyphen.
LONGEST_SEARCH = 0.2


def select(world: World, filters: Any, info: Callable[[Body], Any]) -> list[str]:
    """Return the names of the bodies that pass all filters. ``info``: returns the EntityInfo message of a body.

    The name filter is a regular expression, which is found in names as Python does. The bounds filter uses the
    axis-aligned bounds of bodies. Raises `InputError`, also if the search takes longer than `LONGEST_SEARCH`.
    """
    try:
        pattern = re.compile(re.sub(r"\[:(\w+):\]", _class, filters.filter))
        with _limited(LONGEST_SEARCH):
            found = [body for body in world.bodies.values() if not body.owner and pattern.search(body.name)]
    except (re.error, OverflowError, RecursionError) as error:
        raise InputError("filter", f"{filters.filter[:200]!r} is not a regular expression: {error}") from None
    except TimeoutError:
        words = f"takes longer than {LONGEST_SEARCH:g} s to search the names; repeat no group that repeats itself"
        raise InputError("filter", f"{filters.filter[:200]!r} {words}") from None
    near = _bounds_filter(world, filters.bounds)
    categories = {wanted.category for wanted in filters.categories}
    names = []
    for body in found:
        known = info(body)
        fits = known.category.category in categories or not categories
        if fits and tagged(known.tags, filters.tags) and near(body):
            names.append(body.name)
    return names


@contextmanager
def _limited(seconds: float) -> Iterator[None]:
    """Raise `TimeoutError` in the block after so long [s]. Only the main thread can be interrupted."""
    if current_thread() is not main_thread():
        yield
        return

    def end(*_: object) -> None:
        raise TimeoutError

    before = signal.signal(signal.SIGALRM, end)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def _class(found: re.Match[str]) -> str:
    """Return the characters of a POSIX class; raises `re.error` if there is none of its name."""
    if found[1] not in CLASSES:
        raise re.error(f"there is no class {found[0]}; there are {', '.join(CLASSES)}")
    return CLASSES[found[1]]


def _bounds_filter(world: World, wanted: Any) -> Callable[[Body], bool]:
    """Return the test of the bounds of a body against a Bounds message. Raises `InputError`."""
    if wanted.type == wanted.TYPE_EMPTY:
        return lambda _: True
    points = np.array([(point.x, point.y, point.z) for point in wanted.points])
    if wanted.type not in (wanted.TYPE_BOX, wanted.TYPE_SPHERE):
        raise InputError("unsupported", f"bounds of type {wanted.type} are not supported; use a box or sphere")
    if len(points) != 2 or not np.isfinite(points).all():
        raise InputError("geometry", "bounds must have two finite points: corners, or a centre and a radius")
    box = wanted.type == wanted.TYPE_BOX
    if not box and points[1, 0] < 0.0:
        raise InputError("geometry", f"the radius of a sphere is {points[1, 0]:g} m; it must be zero or more")
    low, high, reach = (points.min(axis=0), points.max(axis=0), 0.0) if box else (points[0], points[0], points[1, 0])

    def near(body: Body) -> bool:
        body_low, body_high = _bounds_of(world.client, body)
        gaps = np.maximum(np.maximum(body_low - high, low - body_high), 0.0)
        return bool(np.linalg.norm(gaps) <= reach)

    return near


def own_bounds(body: Body) -> tuple[FloatArray, FloatArray]:
    """Return the lower and upper corner (3,) [m] of a body's box in its own frame; for a robot, all links at joint
    positions zero in the frame of the root link."""
    box = body.outline.body_shape
    half, centre = np.add(box.half, box.rounding), np.array(box.offset)
    own = centre + half * np.array(list(product((-1.0, 1.0), repeat=3)))
    corners = body.inertial.translation + own
    return np.min(corners, axis=0), np.max(corners, axis=0)


def _bounds_of(client: Any, body: Body) -> tuple[FloatArray, FloatArray]:
    """Return the lowest and highest corner (3,) [m] of the axis-aligned bounds of a body, of a robot with its links."""
    bounds = np.array([client.getAABB(body.uid, link) for link in body.links])
    return bounds[:, 0].min(axis=0), bounds[:, 1].max(axis=0)
