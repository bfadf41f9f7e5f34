"""What the core does for bodies refuses arrays that do not fit, and numbers that name what is not there."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from smartmesh_ros.core import _core, as_bytes
from smartmesh_ros.patches.shapes import SHAPE, ShapeKind, ball, box, compound, hull
from smartmesh_ros.patches.supports import SUPPORT, no_supports
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.motion import MotionConfig
from smartmesh_ros.terrain.trimesh import TriangleMesh
from tests.bodies import TETRAHEDRON, shapes_of, state_at
from tests.core import mesh_parts
from tests.core.test_bindings import REFUSED, SPOILT

BODIES, SIDE = 3, 5


def bodies() -> dict[str, Any]:
    states = np.zeros((BODIES, 13))
    states[:, 6] = 1.0
    shapes = shapes_of([box((0.2, 0.3, 0.4)), hull(TETRAHEDRON), compound([ball(0.1), hull(TETRAHEDRON)])])
    return {"shapes": shapes.core, "states": states, "slots": np.arange(BODIES)}


def heightmap() -> HeightMap:
    return HeightMap(np.ones((9, 9)), resolution=0.1, origin=(-0.4, -0.4), motion=MotionConfig(changes="correction"))


def supports() -> np.ndarray:
    table = no_supports(BODIES)
    table["tile"], table["rows"], table["columns"], table["stride"] = 0, SIDE, SIDE, 1
    return as_bytes(table)


def arguments_below() -> dict[str, Any]:
    return bodies() | {"tiles": [heightmap().core_reader], "time": 0.0}


def arguments_feet() -> dict[str, Any]:
    samples = np.ones((BODIES, SIDE, SIDE))
    return bodies() | {
        "grid": heightmap().core_reader, "heights": samples, "velocities": samples, "time": 0.0, "supports": supports()
    }  # fmt: skip


def arguments_mesh() -> dict[str, Any]:
    given = bodies() | {"points": np.eye(3), "triangles": np.array([[0, 1, 2], [2, 1, 0]], np.int32), "slot": 1}
    del given["slots"]
    return given | {"supports": supports()}


def arguments_corrections() -> dict[str, Any]:
    poses = np.zeros((2, 7))
    poses[:, 6] = 1.0
    return bodies() | {
        "tiles": [(0, heightmap().core_reader, 0.0)], "owners": np.array([0, 1, 1]), "supports": supports(),
        "time": 0.0, "poses": poses,
    }  # fmt: skip


def arguments_outside() -> dict[str, Any]:
    return {"kept": np.eye(3), "points": np.ones((4, 3)), "found": np.zeros(4)}


CALLS: dict[str, Any] = {
    "find_below": arguments_below,
    "find_feet": arguments_feet,
    "find_mesh_foot": arguments_mesh,
    "move_with_corrections": arguments_corrections,
    "distances_outside": arguments_outside,
}
ARRAYS = [(name, key) for name, make in CALLS.items() for key, value in make().items() if isinstance(value, np.ndarray)]
# Smaller arrays that are whole ones too.
FITTING = {
    ("find_below", "slots"), ("move_with_corrections", "poses"), ("find_mesh_foot", "states"),
    ("find_mesh_foot", "supports"), ("find_mesh_foot", "triangles"), ("distances_outside", "kept"),
}  # fmt: skip


@pytest.mark.parametrize("name", CALLS)
def test_what_fits_is_taken(name: str) -> None:
    getattr(_core, name)(**CALLS[name]())


@pytest.mark.parametrize("how", SPOILT)
@pytest.mark.parametrize(("name", "key"), ARRAYS)
def test_arrays_that_do_not_fit_are_refused(name: str, key: str, how: str) -> None:
    given = CALLS[name]()
    right = given[key]
    try:
        spoilt = SPOILT[how](right)
        getattr(_core, name)(**(given | {key: spoilt}))
    except REFUSED:
        return
    assert (spoilt.dtype, spoilt.flags.c_contiguous) == (right.dtype, True), "it must be refused"
    assert spoilt.shape == right.shape or (name, key) in FITTING or key == "slots"


@pytest.mark.parametrize("slot", (-1, BODIES, 2**62, -(2**63)))
@pytest.mark.parametrize("name", ("find_below", "find_feet", "find_mesh_foot", "move_with_corrections"))
def test_slots_that_nobody_has_are_refused(name: str, slot: int) -> None:
    given = CALLS[name]()
    if name == "find_mesh_foot":
        given["slot"] = slot
    else:
        given["slots"][1] = slot
    with pytest.raises(REFUSED):
        getattr(_core, name)(**given)


@pytest.mark.parametrize("owner", (-1, 2, 2**62, -(2**63)))
def test_owners_that_have_no_pose_are_refused(owner: int) -> None:
    given = arguments_corrections()
    given["owners"][2] = owner
    with pytest.raises(REFUSED):
        _core.move_with_corrections(**given)


@pytest.mark.parametrize("corner", (-1, 3, 2**31 - 1, -(2**31)))
def test_triangles_of_points_that_are_not_there_are_refused(corner: int) -> None:
    given = arguments_mesh()
    given["triangles"][0, 2] = corner
    with pytest.raises(REFUSED):
        _core.find_mesh_foot(**given)


@pytest.mark.parametrize(
    "first, rows", ((-1, 1), (0, 0), (0, -1), (0, 5), (4, 1), (2**62, 2**62), (-(2**63), 2**63 - 1))
)
@pytest.mark.parametrize("kind", (ShapeKind.HULL, ShapeKind.COMPOUND))
def test_shapes_that_name_what_is_not_there_are_refused(kind: ShapeKind, first: int, rows: int) -> None:
    table, parts = np.zeros(1, SHAPE), np.zeros(4, SHAPE)
    table["kind"], table["first"], table["rows"] = kind, first, rows
    given = arguments_below() | {"slots": np.zeros(1, np.int64)}
    with pytest.raises(REFUSED):
        _core.find_below(**(given | {"shapes": _core.Shapes(as_bytes(table), as_bytes(parts), np.zeros((4, 3)))}))


@pytest.mark.parametrize("kind", (-1, 0, max(ShapeKind) + 1, 2**62, ShapeKind.COMPOUND))
@pytest.mark.parametrize("is_part", (False, True))
def test_shapes_of_no_kind_and_compounds_of_compounds_are_refused(kind: int, *, is_part: bool) -> None:
    table, parts = np.zeros(1, SHAPE), np.zeros(1, SHAPE)
    table["kind"], table["rows"] = (ShapeKind.COMPOUND, 1) if is_part else (kind, 2)
    parts["kind"], parts["rows"] = kind, 1
    given = arguments_below() | {"slots": np.zeros(1, np.int64)}
    with pytest.raises(REFUSED):
        _core.find_below(**(given | {"shapes": _core.Shapes(as_bytes(table), as_bytes(parts), np.zeros((4, 3)))}))


@pytest.mark.parametrize("how", SPOILT)
@pytest.mark.parametrize("key", ("shapes", "parts", "vertices"))
def test_tables_of_shapes_that_do_not_fit_are_refused(key: str, how: str) -> None:
    given = {
        "shapes": as_bytes(np.zeros(2, SHAPE)), "parts": as_bytes(np.zeros(2, SHAPE)), "vertices": np.zeros((2, 3))
    }  # fmt: skip
    spoilt = SPOILT[how](given[key])
    if how in ("one row fewer", "empty"):
        _core.Shapes(**(given | {key: spoilt}))  # a smaller table is a table
        return
    with pytest.raises(REFUSED):
        _core.Shapes(**(given | {key: spoilt}))


@pytest.mark.parametrize("value", (np.nan, np.inf, -np.inf, 1e308, -1e308, 1e18))
@pytest.mark.parametrize("name", ("find_below", "find_feet", "find_mesh_foot", "move_with_corrections"))
def test_states_of_any_numbers_do_no_harm(name: str, value: float) -> None:
    for column in range(13):
        given = CALLS[name]()
        given["states"][:, column] = value
        getattr(_core, name)(**given)


@pytest.mark.parametrize("value", (np.nan, np.inf, -np.inf, 1e308))
@pytest.mark.parametrize("key", ("heights", "velocities"))
def test_samples_of_any_numbers_do_no_harm(key: str, value: float) -> None:
    given = arguments_feet()
    given[key] = np.full((BODIES, SIDE, SIDE), value)
    _core.find_feet(**given)
    state = given["supports"].view(SUPPORT)["state"].ravel()
    assert key == "velocities" or not state[0] or np.isfinite(value)


@pytest.mark.parametrize("value", (np.nan, np.inf))
@pytest.mark.parametrize("name", ("find_below", "find_feet", "move_with_corrections"))
def test_times_are_finite(name: str, value: float) -> None:
    with pytest.raises(REFUSED):
        getattr(_core, name)(**(CALLS[name]() | {"time": value}))


def test_arrays_that_are_written_must_be_writable() -> None:
    for name, key in (("find_feet", "supports"), ("find_mesh_foot", "supports"), ("distances_outside", "found"),
                      ("move_with_corrections", "poses")):  # fmt: skip
        given = CALLS[name]()
        given[key].setflags(write=False)
        with pytest.raises(REFUSED):
            getattr(_core, name)(**given)


@pytest.mark.parametrize("tiles", ([None], [1], [np.zeros(3)], None, [(0, None, 0.0)], [(0, 1)]))
@pytest.mark.parametrize("name", ("find_below", "move_with_corrections"))
def test_tiles_are_grids(name: str, tiles: Any) -> None:
    with pytest.raises((*REFUSED, RuntimeError)):
        getattr(_core, name)(**(CALLS[name]() | {"tiles": tiles}))


def test_a_body_below_the_ground_is_lifted_by_the_depth_of_its_lowest_point() -> None:
    found = _core.find_below(**arguments_below())
    assert [slot for slot, _, _ in found] == [0, 1, 2]
    assert found[0][1:] == pytest.approx((1.2, 0.0))
    assert found[1][1] == pytest.approx(1.4)


def test_ground_of_a_mesh_above_a_body_counts_only_where_there_is_none_below_it() -> None:
    floor, top = mesh_parts.sheet(4.0, 1), mesh_parts.box((-0.5, -0.5, 0.5), (0.5, 0.5, 0.6))
    tiles = [TriangleMesh(*mesh_parts.joined(floor, top)).core_reader]
    shapes, first = shapes_of([ball(0.1)]).core, np.zeros(1, np.int64)

    def lifts(x: float, z: float) -> list[float]:
        states = state_at(np.array([x, 0.2, z]), np.array([0.0, 0.0, 0.0, 1.0]))
        return [lift for _, lift, _ in _core.find_below(shapes, states, first, tiles, 0.0)]

    for z in (0.7, 0.55, 0.3):  # over the box, in it, and under it
        assert lifts(0.1, z) == []
    assert lifts(0.1, -0.2) == pytest.approx([0.6 + 0.3])
    assert lifts(1.0, -0.2) == pytest.approx([0.3])
    for nowhere in ((3.0, -0.2), (np.nan, -0.2), (np.inf, -0.2), (0.1, np.nan)):
        assert lifts(*nowhere) == []
