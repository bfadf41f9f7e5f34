"""Functions of the core, and what they take: maps and meshes, tables of bodies, and soil."""

from typing import Any

import numpy as np

from smartmesh_ros import HeightMap, MotionConfig
from smartmesh_ros.core import CORE
from smartmesh_ros.core.body_shape import BodyShape
from smartmesh_ros.terrain.motion import KEPT
from tests.bodies import TETRAHEDRON
from tests.core.entries import COLUMNS, ROWS, Arguments, Entry, clock_bytes, grid_of, new_grid

COUNT = 6  # of points, rays and scans
BODIES, SLOTS = 3, 8  # of tables of shapes, and of other tables


def mesh_arrays() -> Arguments:
    return {"vertices": np.arange(12.0).reshape(3, 4) ** 2, "triangles": np.array([[0, 1, 2], [1, 2, 3]])}


def new_mesh(**fields: float) -> Any:
    """Return a mesh of the core that moves, with these fields in its clock."""
    mesh = CORE.Mesh(**mesh_arrays())
    mesh.velocities[...] = 1.0
    mesh.clocks[...] = clock_bytes(1, **fields)
    mesh.set_motion(1, 25.0, 0.0)
    return mesh


def deck() -> Any:
    made = CORE.Deck()
    made.set_tiles([new_grid()])
    made.put(0.0, pose(), None)
    return made


def pose() -> np.ndarray:
    return np.array([0.1, 0.2, 0.3, 0.0, 0.0, 0.6, 0.8])


def moved() -> Arguments:
    return {"time": 1.0, "pose": pose(), "velocity": np.ones(6)}


def tiles() -> Any:
    return CORE.Tiles([new_grid(), new_mesh(known=KEPT, newest=1, lifetime=1.0), deck()])


def cast(tiles: Any, **rays: Any) -> Any:
    return CORE.RayCaster(tiles).cast(**rays)


def floats(*shape: int) -> np.ndarray:
    return np.zeros(shape, np.float32)


def contacts() -> Arguments:
    return {
        "shape": BodyShape.box((0.2, 0.2, 0.2)), "tiles": [grid_of(floats(8, 8))],
        "pose": np.vstack([np.eye(3), [0.5, 0.5, 0.1]]), "motion": np.zeros((2, 3)), "duration": 0.004, "margin": 0.01,
    }  # fmt: skip


def lattice() -> Any:
    return CORE.SampleLattice(ROWS, COLUMNS, 10)


def placed() -> Arguments:
    return {"heights": floats(ROWS, COLUMNS), "z": 0.0, "first": (5, -7), "least": 0.001}


def corrected(settle: float = 0.2, **clock: float) -> Any:
    """Return a map of the core that is corrected within ``settle`` [s], with these fields in its clocks."""
    grid = new_grid(**clock)
    grid.set_motion(3, 25.0, settle, 0.0, 0.0)
    return grid


def set_layer(samples: Any) -> None:
    new_grid().set_layer(0, samples, 1.0)


def recall(**memory: Any) -> None:
    """Give a soil what it knew."""
    kinds, soils = np.zeros((ROWS, COLUMNS), np.uint8), np.ones((1, 8))
    CORE.Soil(new_grid(), kinds, soils, 1.0).recall(**memory)


def zeros(columns: int, rows: int = SLOTS) -> np.ndarray:
    return np.zeros((rows, columns))


def bodies() -> Arguments:
    states = zeros(13, BODIES)
    states[:, 6] = 1.0
    shapes = [BodyShape.box((0.2, 0.3, 0.4)), BodyShape.ball(0.1), BodyShape.hull(TETRAHEDRON)]
    return {"shapes": shapes, "states": states, "slots": np.arange(BODIES)}


def lower_surface(poses: Any, up: Any, points: Any) -> Any:
    surface = CORE.LowerSurface(bodies()["shapes"])
    return surface.bounds(poses), surface.lowest(poses, up), surface.heights(poses, points)


def grid() -> Any:
    """A map 1 m above the bodies."""
    motion = MotionConfig(changes="correction")
    return HeightMap(np.ones((9, 9)), resolution=0.1, origin=(-0.4, -0.4), motion=motion).core_reader


def near_any(states: Any, radii: Any, margins: Any, attached: Any) -> Any:
    return CORE.near_any((states, radii, margins), 0.1, attached, 0.1)


def patches() -> Any:
    """Of bodies below a map."""
    found, given = CORE.Patches(CORE.Tiles([grid()])), bodies()
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
    "recall": Entry(recall, lambda: {
        "places": np.array([3, 700]), "samples": np.ones((2, 5)), "nodes": np.array([1, 2]), "heights": floats(2),
        "pressed": np.array([7, 2, 1]), "step": 3,
    }, rows=("pressed",), within=tuple((name, ROWS * COLUMNS) for name in ("places", "nodes", "pressed"))),
    "Mesh": Entry(CORE.Mesh, mesh_arrays, rows=("triangles",), within=(("triangles", 4),), finite=("vertices",)),
    "set_layer": Entry(set_layer, lambda: {"samples": floats(ROWS, COLUMNS) + 1.0}, optional=("samples",)),
    "find_contacts": Entry(CORE.find_contacts, contacts, finite=("pose", "motion", "duration", "margin")),
    "ground_heights": Entry(CORE.ground_heights, lambda: {
        "tiles": tiles(), "points": np.ones((COUNT, 2)), "time": 0.0,
    }, rows=("points",), finite=("time",)),
    "ground_samples": Entry(CORE.ground_samples, lambda: {
        "tiles": tiles(), "points": np.ones((COUNT, 3)), "time": 0.0,
    }, rows=("points",), finite=("time",)),
    "cast": Entry(cast, lambda: {
        "tiles": tiles(), "origins": np.ones((COUNT, 3)), "directions": np.tile([0.0, 0.0, -1.0], (COUNT, 1)),
        "range": 5.0, "time": 0.0,
    }, finite=("origins", "directions", "range", "time")),
    "scan_heights": Entry(CORE.scan_heights, lambda: {
        "tiles": tiles(), "poses": np.ones((COUNT, 3)), "pattern": np.ones((4, 2)), "time": 0.0,
        "heights": np.zeros((COUNT, 4)),
    }, written=("heights",), finite=("pattern", "time")),
    "Deck.move": Entry(lambda **given: deck().move(**given), moved, optional=("velocity",), finite=tuple(moved())),
    "Deck.put": Entry(lambda **given: deck().put(**given), moved, optional=("velocity",), finite=tuple(moved())),
    "Deck.recall": Entry(lambda **given: deck().recall(**given), lambda: {"memory": deck().memory()},
        finite=("memory",)),
    "Deck.carry": Entry(lambda **given: deck().carry(**given), lambda: {"body": 1, "link": -1, "place": pose()},
        finite=("place",)),
    "sample_grid": Entry(CORE.sample_grid, lambda: {
        "grid": new_grid(), "indices": np.arange(COUNT), "time": 0.0, "ahead": 0.1,
    }, rows=("indices",), finite=("time", "ahead")),
    "grid_window": Entry(CORE.grid_window, lambda: {
        "grid": new_grid(), "row": 0, "column": 0, "time": 0.0, "heights": np.zeros((COUNT, COUNT)),
    }, written=("heights",), any_shape=("heights",), finite=("time",)),
    "sample_mesh": Entry(
        CORE.sample_mesh, lambda: {
            "mesh": new_mesh(known=KEPT, newest=1, lifetime=1.0), "indices": np.arange(4), "time": 0.1, "ahead": 0.1,
        }, rows=("indices",), within=(("indices", 4),), finite=("time", "ahead"),
    ),
    "has_infinity": Entry(CORE.has_infinity, lambda: {"samples": floats(3, 4)}, any_shape=("samples",)),
    "take_rectangle": Entry(CORE.take_rectangle, lambda: {
        "grid": new_grid(), "first": (67, 126), "fresh": floats(3, 4), "given": floats(3, 4), "time": 0.1,
        "intervals": (0.004, 0.25),
    }, optional=("given",)),
    "take_corrected": Entry(CORE.take_corrected, lambda: {
        "grid": corrected(), "first": (67, 126), "known": floats(3, 4), "time": 0.1,
    }, any_shape=("known",)),
    "fuse": Entry(CORE.fuse, lambda: {
        "heights": floats(ROWS, COLUMNS), "variances": floats(ROWS, COLUMNS), "first": (67, 126),
        "measured": floats(3, 4), "noises": floats(3, 4), "grown": 0.0, "gate_squared": 25.0,
    }, written=("heights", "variances")),
    "move_vertices": Entry(CORE.move_vertices, lambda: {
        "mesh": new_mesh(known=KEPT, newest=1, lifetime=1.0), "chosen": np.array([0, 3]), "fresh": np.ones((3, 2)),
        "given": np.ones((3, 2)), "time": 0.1, "intervals": (0.004, 0.25),
    }, optional=("chosen", "given"), within=(("chosen", 4),), finite=("fresh",)),
    "compare": Entry(lambda **given: lattice().compare(**given), placed, any_shape=("heights",)),
    "moved_as_one": Entry(lambda **given: lattice().moved_as_one(**given), placed, any_shape=("heights",)),
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
    "BodyShape.hull": Entry(BodyShape.hull, lambda: {"points": TETRAHEDRON.copy()}, rows=("points",)),
    "extrapolated": Entry(CORE.extrapolated, lambda: {"states": zeros(13), "duration": 0.1}, rows=("states",)),
    "blended": Entry(CORE.blended, lambda: {"states": zeros(13), "targets": zeros(13), "share": 0.5}),
    "near_any": Entry(near_any, lambda: {
        "states": zeros(13, 4), "radii": np.ones(4), "margins": np.ones(4), "attached": np.ones((SLOTS, 10)),
    }, rows=("attached",)),
    "may_touch": Entry(
        CORE.may_touch, lambda: {"attached": np.ones((SLOTS, 10)), "duration": 0.1, "slack": 0.1}, rows=("attached",)
    ),
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
    "Soil": Entry(CORE.Soil, lambda: {
        "grid": new_grid(), "kinds": np.zeros((ROWS, COLUMNS), np.uint8),
        "soils": np.array([[1e6, 0.0, 1.0, 0.0, 0.5, 0.01, 2e8, 3e4]]), "spacing": 0.5,
    }, rows=("soils",)),
    "shape_above_grid": Entry(CORE.shape_above_grid, lambda: {
        "shape": BodyShape.box((0.2, 0.2, 0.2)), "points": zeros(2, 5), "spacing": 0.1,
    }, rows=("points",)),
}  # fmt: skip
