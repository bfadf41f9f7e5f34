"""Functions of the core that take tables of bodies, and soil."""

from typing import Any

import numpy as np

from smartmesh_ros import HeightMap, MotionConfig
from smartmesh_ros.core import CORE
from smartmesh_ros.core.body_shape import BodyShape
from smartmesh_ros.world.state_table import LIMITS
from tests.bodies import TETRAHEDRON
from tests.core.entries import COLUMNS, ROWS, Arguments, Entry, new_grid

BODIES = 3  # of tables of shapes
SLOTS = 8  # of other tables


def zeros(columns: int, rows: int = SLOTS) -> np.ndarray:
    return np.zeros((rows, columns))


def flags() -> np.ndarray:
    return np.ones(SLOTS, bool)


def bodies() -> Arguments:
    states = zeros(13, BODIES)
    states[:, 6] = 1.0
    hull = BodyShape.hull(TETRAHEDRON)
    shapes = [BodyShape.box((0.2, 0.3, 0.4)), hull, BodyShape.compound([BodyShape.ball(0.1), hull])]
    return {"shapes": shapes, "states": states, "slots": np.arange(BODIES)}


def lower_surface(poses: Any, up: Any, points: Any) -> Any:
    surface = CORE.LowerSurface(bodies()["shapes"])
    return surface.bounds(poses), surface.lowest(poses, up), surface.heights(poses, points)


def grid() -> Any:
    """A map 1 m above the bodies."""
    motion = MotionConfig(changes="correction")
    return HeightMap(np.ones((9, 9)), resolution=0.1, origin=(-0.4, -0.4), motion=motion).core_reader


def faults() -> Arguments:
    return {
        "states": zeros(13), "radii": np.ones(SLOTS), "kinds": np.ones(SLOTS, np.uint8), "dimensions": zeros(3),
        "centres": zeros(3), "masses": np.ones(SLOTS), "limits": LIMITS,
    }  # fmt: skip


def near_any(states: Any, radii: Any, margins: Any, places: Any, speeds: Any, others: Any, own: Any) -> Any:
    return CORE.near_any((states, radii, margins), 0.1, (places, speeds, others, own), 0.1)


def soil() -> Arguments:
    return {
        "grid": new_grid(), "kinds": np.zeros((ROWS, COLUMNS), np.uint8),
        "soils": np.array([[1e6, 0.0, 1.0, 0.0, 0.5, 0.01, 2e8, 3e4]]), "spacing": 0.5,
    }  # fmt: skip


def above_grid() -> Arguments:
    return {"shape": BodyShape.box((0.2, 0.2, 0.2)), "points": zeros(2, 5), "spacing": 0.1}


def patches() -> Any:
    """Of bodies below a map."""
    found, given = CORE.Patches(), bodies()
    found.set_tiles([grid()])
    found.search(
        given["shapes"], given["states"], given["slots"], np.ones(BODIES, bool), np.arange(BODIES), 0.0, 0.1, 1.0
    )
    found.collect(given["slots"], 0.0)
    return found


def search_patches(shapes: Any, states: Any, slots: Any, always: Any, owners: Any, time: float) -> Any:
    return patches().search(shapes, states, slots, always, owners, time, 0.1, 1.0)


def collect_patches(slots: Any, time: float) -> Any:
    found = patches()
    return found.collect(slots, time), found.describe(slots), found.geometry(slots), found.marker_revisions(slots)


def markers(slots: Any, ids: Any, gone: Any) -> Any:
    return patches().markers(slots, ids, gone, False, (0, 0), "map", "patches", (1.0, 1.0, 1.0, 1.0), 0.0)


OF_SLOTS = (("slots", BODIES),)
ENTRIES = {
    "search_patches": Entry(search_patches, lambda: bodies() | {
        "always": np.ones(BODIES, bool), "owners": np.arange(BODIES), "time": 0.0},
        rows=("slots",), within=OF_SLOTS, finite=("time",)),
    "collect_patches": Entry(collect_patches, lambda: {"slots": np.arange(BODIES), "time": 0.0},
        rows=("slots",), within=OF_SLOTS, finite=("time",)),
    "markers": Entry(markers, lambda: {"slots": np.arange(BODIES), "ids": np.arange(BODIES), "gone": np.arange(2)},
        rows=("gone",), within=OF_SLOTS),
    "distances_outside": Entry(
        CORE.distances_outside, lambda: {"kept": np.eye(3), "points": np.ones((4, 3))}, rows=("kept", "points"),
    ),
    "LowerSurface": Entry(
        lower_surface, lambda: {"poses": zeros(7, BODIES), "up": zeros(3, 4), "points": zeros(2, 5)},
        rows=("up", "points"),
    ),
    "BodyShape.hull": Entry(BodyShape.hull, lambda: {"points": TETRAHEDRON}, rows=("points",)),
    "first_fault": Entry(CORE.first_fault, faults),
    "extrapolated": Entry(CORE.extrapolated, lambda: {"states": zeros(13), "duration": 0.1}, rows=("states",)),
    "blended": Entry(CORE.blended, lambda: {"states": zeros(13), "targets": zeros(13), "share": 0.5}),
    "near_any": Entry(near_any, lambda: {
        "states": zeros(13, 4), "radii": np.ones(4), "margins": np.ones(4), "places": zeros(3), "speeds": zeros(3),
        "others": np.ones(SLOTS), "own": flags(),
    }),
    "may_touch": Entry(CORE.may_touch, lambda: {
        "positions": zeros(3), "moved": zeros(3), "radii": np.ones(SLOTS), "guests": flags(), "solid": flags(),
        "slack": 0.1,
    }),
    "may_meet": Entry(
        CORE.may_meet,
        lambda: {"origins": zeros(3), "ways": zeros(3) + 1.0, "ranges": np.ones(SLOTS), "boxes": zeros(6, 20)},
        rows=("boxes",),
    ),
    "split_bodies": Entry(
        CORE.split_bodies,
        lambda: {"content": np.ones(500, np.uint8), "at": 0, "rows": np.zeros((3, 140), np.uint8)},
        written=("rows",), any_shape=("content", "rows"),
    ),
    "Soil": Entry(CORE.Soil, soil, rows=("soils",)),
    "shape_above_grid": Entry(CORE.shape_above_grid, above_grid, rows=("points",)),
}  # fmt: skip
