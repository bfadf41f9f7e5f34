"""What bodies stand on is exactly what they can touch until the next update, against brute force over time."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from smartmesh_ros.patches.config import SELECTION, PatchConfig
from smartmesh_ros.patches.contact_candidates import Window, candidate_facets
from smartmesh_ros.patches.facets import Facet, Point
from smartmesh_ros.patches.gaps import gap_to
from smartmesh_ros.patches.selection import (
    acceleration_by_turning,
    in_window,
    local_body,
    swing_of,
    travel_of,
    window_memory,
    window_place,
)
from smartmesh_ros.patches.selector import rules_for
from smartmesh_ros.patches.shapes import BODY_COLUMNS, BodyShape, Shapes, ball, box, capsule, cylinder, solid_of
from smartmesh_ros.patches.solids import ShapeKind
from smartmesh_ros.patches.supports import Support
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.moving_grid import read_window
from smartmesh_ros.terrain.terrain import Terrain
from tests.bodies import FORMS, Form, random_turn, rotation, shapes_of, turn_about
from tests.examples import examples
from tests.patches.selecting import Selecting

SIZE = 32
GRAVITY = np.array([0.0, 0.0, -9.81])
GROUNDS = ("flat", "slope", "steps", "noise", "waves", "holes", "spikes", "pits")
INSTANTS = 7
# Barycentric coordinates of points all over a facet, on its edges and corners too.
SHARES = np.array([(i, j, 8 - i - j) for i in range(9) for j in range(9 - i)]) / 8.0

seeds = st.integers(0, 10**9)


def ground_of(kind: str, rng: np.random.Generator) -> np.ndarray:
    """Heights in units of the resolution."""
    rows, columns = np.indices((SIZE, SIZE)).astype(float)
    if kind == "flat":
        return np.zeros((SIZE, SIZE))
    if kind == "slope":
        return 0.5 * rows - 0.8 * columns
    if kind == "steps":
        return 1.5 * np.floor(rows / 7.0) + 0.02 * columns
    if kind == "noise":
        return np.asarray(rng.normal(scale=rng.choice([0.002, 0.2, 1.0]), size=(SIZE, SIZE)))
    waves = 4.0 * np.sin(rng.uniform(0.02, 0.4) * rows + 1.0) * np.cos(rng.uniform(0.02, 0.4) * columns)
    if kind == "waves":
        return np.asarray(waves)
    few = rng.random((SIZE, SIZE)) < 0.05
    if kind == "holes":
        return np.asarray(np.where(few, np.nan, waves + 6.0 * (rng.random((SIZE, SIZE)) < 0.05)))
    return np.asarray(0.1 * waves + (5.0 if kind == "spikes" else -5.0) * few)


class Case(NamedTuple):
    """Bodies (N,) over a ground, for a duration [s] from a time [s] on. ``moving``: the ground may move meanwhile."""

    heightmap: HeightMap
    forms: list[Form]
    bodies: np.ndarray
    time: float
    duration: float
    moving: bool = False

    @property
    def shapes(self) -> Shapes:
        return shapes_of(form.shape for form in self.forms)


def form_of(shape: BodyShape) -> Form:
    """A form whose insides no test asks for."""
    form = Form("box", 1.0, np.random.default_rng(0))
    form.shape, form.radius = shape, shape.radius
    return form


def case_of(
    kind: str,
    seed: int,
    *,
    moving: bool = False,
    yaw: float | None = None,
    count: int = 10,
    calm: float = 0.2,
    spin: float = 0.0,
) -> Case:
    """Bodies of every shape, turned anyhow, of which many are about to touch the ground, or to leave it."""
    rng = np.random.default_rng(seed)
    resolution, duration = float(rng.choice([0.05, 0.25])), float(rng.choice([1 / 240, 1 / 60, 1 / 20]))
    shape = resolution * ground_of(kind, rng)
    turned = float(rng.uniform(-3.1, 3.1)) if yaw is None else yaw
    heightmap = HeightMap(shape, resolution=resolution, origin=(3.0, -2.0, 0.5), yaw=turned, time=0.0)
    time = 0.0
    if moving:
        rise = rng.normal(scale=0.5, size=3)
        rows, columns = np.indices(shape.shape)
        for step in (1, 2, 3):
            time = 0.05 * step
            wave = np.sin(0.3 * rows + 0.2 * columns + rng.choice([0.0, 4.0]) * time)
            heightmap.replace(shape + (rise[0] * time + rise[1] * time**2 + 0.2 * rise[2] * wave * time), time=time)
        heightmap.slide((float(rng.normal()), float(rng.normal())), 0.05, spin)
        time += float(rng.choice([0.0, 0.01, 0.09]))  # the last: maps are late
    forms = [Form(FORMS[index % len(FORMS)], resolution * rng.choice([0.3, 1.0, 3.0]), rng) for index in range(count)]
    bodies = np.zeros((count, BODY_COLUMNS))
    for body, form in zip(bodies, forms, strict=True):
        row, column = rng.uniform(-0.5, SIZE - 0.5, 2)
        body[:2] = heightmap.geometry.to_world(row, column)
        body[3:7] = random_turn(rng)
        body[7:10] = rng.normal(size=3) * rng.choice([0.0, 0.3, 3.0, 20.0])
        body[10:] = rng.normal(size=3) * rng.choice([0.0, 1.0, 30.0])
        fastest = 0.99 * SELECTION.fastest - 1.5 * abs(spin) * SIZE * resolution  # as the ground sees it
        body[7:10] *= min(1.0, max(fastest, 0.0) / max(float(np.linalg.norm(body[7:10])), 1e-9))
        if rng.random() < calm:
            body[7:] = 0.0
        # Its lowest point near the ground under it, as near as it goes in the time.
        ground = float(np.nan_to_num(heightmap.at([body[:2]], time).heights[0], nan=0.5))
        low = float((form.surface(rng, 60) @ rotation(body[3:7]).T)[:, 2].min())
        way = float(np.linalg.norm(body[7:10])) * duration
        body[2] = ground - low + rng.choice([-0.3 * form.radius, 0.0, 1e-3, way, 2.0 * form.radius])
        body[2] += rng.normal(scale=0.02) * resolution
    return Case(heightmap, forms, bodies, time, duration, moving)


def path_of(body: np.ndarray, duration: float) -> list[tuple[float, np.ndarray, np.ndarray]]:
    """Where a body that flies freely is, and how it is turned, at some instants."""
    start = rotation(body[3:7])
    return [
        (t, body[:3] + body[7:10] * t + 0.5 * GRAVITY * t * t, turn_about(body[10:] * t) @ start)
        for t in np.linspace(0.0, duration, INSTANTS).tolist()
    ]


def cells_under(case: Case, index: int) -> tuple[np.ndarray, np.ndarray]:
    """Rows and columns of the cells over which a body can be, with some to spare."""
    geometry, body = case.heightmap.geometry, case.bodies[index]
    far = case.forms[index].radius + (np.linalg.norm(body[7:9]) + 3.0) * case.duration
    row, column = geometry.to_grid(body[:2])
    reach = far / geometry.resolution + 1.0
    rows = np.arange(max(math.floor(row - reach), 0), min(math.ceil(row + reach), SIZE - 1))
    columns = np.arange(max(math.floor(column - reach), 0), min(math.ceil(column + reach), SIZE - 1))
    r, c = np.meshgrid(rows, columns, indexing="ij")
    return r.ravel(), c.ravel()


def facet_corners(case: Case, rows: np.ndarray, columns: np.ndarray, time: float) -> np.ndarray:
    """Corners (cells, 2, 3, 3) of the facets of cells at a time, those below their diagonals first."""
    placed = case.heightmap.placed_at(time)
    corners = []
    for dr, dc in ((0, 0), (0, 1), (1, 1), (1, 0)):
        r, c = rows + dr, columns + dc
        xy = placed.to_world(r, c)
        z = case.heightmap.sample(r * SIZE + c, time).heights
        corners.append(np.column_stack([xy, z]))
    first, right, opposite, up = corners
    return np.stack([np.stack([first, right, opposite], 1), np.stack([first, opposite, up], 1)], 1)


def touched_by_brute_force(case: Case, index: int) -> set[tuple[int, int, int]]:
    """Facets (row, column, upper) of which the body meets a point at one of some instants."""
    rows, columns = cells_under(case, index)
    form, found = case.forms[index], np.zeros((len(rows), 2), bool)
    corners = facet_corners(case, rows, columns, case.time)
    for t, position, turn in path_of(case.bodies[index], case.duration):
        if case.moving:
            corners = facet_corners(case, rows, columns, case.time + t)
        beyond = np.maximum(corners.min(axis=2) - position, position - corners.max(axis=2)).clip(0.0)
        near = (beyond**2).sum(axis=-1) <= form.radius**2  # no point of the others is inside
        found[near] |= form.inside(SHARES @ corners[near], position, turn).any(axis=1)
    cells, upper = np.nonzero(found)
    return {(int(rows[k]), int(columns[k]), int(u)) for k, u in zip(cells, upper, strict=True)}


def touched_by_the_selection(case: Case, index: int) -> set[tuple[int, int, int]]:
    """Facets (row, column, upper) that the compiled pass takes to be touchable."""
    grid, local = case.heightmap.moved_to(case.time), np.empty(BODY_COLUMNS)
    rules = rules_for(PatchConfig(), SELECTION, 9.81, across=False)
    local_body(grid, case.bodies[index], local)
    solid = solid_of(case.shapes, index, local)
    bend = acceleration_by_turning(grid, case.bodies[index])
    travel = travel_of(local, solid, case.duration, rules, bend)
    place = window_place(grid.resolution, solid, travel, rules)
    assert place.stride == 1
    heights, rises, touched = (part[: place.high, : place.wide] for part in window_memory(140))
    read_window(grid, place.row, place.column, 1, case.time, case.duration, heights, rises)
    own = in_window(grid, place, solid)
    touch = candidate_facets(Window(heights, rises, grid.resolution), own, travel, touched)
    if touch.facets == 0:
        return set()
    marks = touched[: place.high - 1, : place.wide - 1]
    found = {
        (place.row + int(a), place.column + int(b), upper)
        for upper in range(2)
        for a, b in np.argwhere(marks & (1 + upper))
    }
    assert len(found) == touch.facets
    assert min(a for a, _, _ in found) == place.row + touch.top
    assert max(a for a, _, _ in found) == place.row + touch.bottom
    assert min(b for _, b, _ in found) == place.column + touch.left
    assert max(b for _, b, _ in found) == place.column + touch.right
    return found


def selector_of(case: Case, config: PatchConfig | None = None) -> Selecting:
    return Selecting(Terrain(case.heightmap), config or PatchConfig(), case.shapes)


def chosen_for(case: Case, config: PatchConfig | None = None) -> Any:
    selector = selector_of(case, config)
    selector.update(case.bodies, case.time, case.duration)
    return selector.supports


@examples(120)
@given(seeds, st.sampled_from(GROUNDS), st.booleans(), st.sampled_from([0.0, 0.5, -2.0]))
def test_every_facet_that_a_body_can_reach_is_found(seed: int, kind: str, moving: bool, spin: float) -> None:
    case = case_of(kind, seed, moving=moving, spin=spin)
    for index in range(len(case.forms)):
        missing = touched_by_brute_force(case, index) - touched_by_the_selection(case, index)
        assert not missing, f"body {index}, a {FORMS[index % len(FORMS)]}, reaches facets {sorted(missing)[:5]}"


@given(seeds, st.sampled_from(FORMS), st.floats(0.0, 0.1))
def test_the_swing_bounds_how_far_a_spin_moves_a_surface(seed: int, name: str, duration: float) -> None:
    """Distances of the turned surface from the solid before, which are zero for a wheel that spins about its axis."""
    rng = np.random.default_rng(seed)
    form = Form(name, 0.3, rng)
    body = np.zeros(BODY_COLUMNS)
    body[3:7], body[10:] = random_turn(rng), rng.normal(size=3) * rng.choice([0.3, 3.0, 30.0])
    before = rotation(body[3:7])
    solid = solid_of(shapes_of([form.shape]), 0, body)
    turned = form.surface(rng, 200) @ (turn_about(body[10:] * duration) @ before).T
    moved = max(gap_to(Facet(p, p, p), solid).distance for p in (Point(*point) for point in turned.tolist()))
    assert moved <= swing_of(body, solid, duration) + 1e-6


@pytest.mark.parametrize("shape", [cylinder(0.2, 0.1), capsule(0.1, 0.4), ball(0.2)])
def test_a_wheel_that_spins_about_its_axis_sweeps_nothing(shape: BodyShape) -> None:
    body = np.zeros(BODY_COLUMNS)
    body[6], body[12] = 1.0, 30.0
    spinning = solid_of(shapes_of([shape]), 0, body)
    assert swing_of(body, spinning, 1 / 60) == 0.0
    body[10] = 1.0
    tilting = swing_of(body, spinning, 1 / 60)
    assert tilting == pytest.approx(0.0 if shape.kind == ShapeKind.BALL else shape.radius / 60, rel=1e-6)


@examples(40)
@given(seeds, st.sampled_from(GROUNDS))
def test_nothing_is_found_that_is_far_from_the_way_of_a_ball(seed: int, kind: str) -> None:
    """What counts as touchable is no farther from the straight way than its bounds say."""
    case = case_of(kind, seed)
    for index, form in enumerate(case.forms):
        if not form.ball:
            continue
        body = case.bodies[index]
        way = np.linalg.norm(body[7:10]) * case.duration
        turn = min(np.linalg.norm(body[10:]) * case.duration, 2.0) * np.linalg.norm(form.offset)
        reach = form.half[0] + way + turn + 0.5 * 9.81 * case.duration**2
        centre = body[:3] + rotation(body[3:7]) @ form.offset
        for row, column, upper in touched_by_the_selection(case, index):
            points = SHARES @ facet_corners(case, np.array([row]), np.array([column]), case.time)[0, upper]
            # A point of the facet is within STEP of its closest one.
            step = np.linalg.norm(points[1] - points[0]) + np.linalg.norm(points[-1] - points[-2])
            assert np.linalg.norm(points - centre, axis=1).min() <= reach + step


def plane_heights(support: Any, xy: np.ndarray, age: float) -> np.ndarray:
    """Heights of a PLANE at points (n, 2), some time after the update, as its collider moves on."""
    away = xy - (support.foot_x, support.foot_y) - age * np.array([support.slide_x, support.slide_y])
    still = support.foot_z - (away[:, 0] * support.facet_x + away[:, 1] * support.facet_y) / support.facet_z
    return np.asarray(still + age * (support.rise + support.turn_x * away[:, 1] - support.turn_y * away[:, 0]))


def field_heights(case: Case, support: Any, xy: np.ndarray) -> np.ndarray:
    """Heights of a FIELD at points (n, 2) as of the update, NaN beyond it."""
    geometry, stride = case.heightmap.geometry, int(support.stride)
    rows = support.row + stride * np.arange(support.rows)
    columns = support.column + stride * np.arange(support.columns)
    r, c = np.meshgrid(rows, columns, indexing="ij")
    inside = (r >= 0) & (c >= 0) & (r < SIZE) & (c < SIZE)
    z = case.heightmap.sample(np.where(inside, r * SIZE + c, 0), case.time).heights
    shift = np.subtract(case.heightmap.moved_to(case.time)[3:5], geometry.origin[:2])
    first = geometry.to_world(rows[0], columns[0]) + shift
    if min(z.shape) < 3:  # a map has at least three; the last triangles go on
        z = np.pad(z, [(0, max(0, 3 - n)) for n in z.shape], constant_values=np.nan)
        inside = np.pad(inside, [(0, max(0, 3 - n)) for n in inside.shape])
    field = HeightMap(
        np.where(inside, z, np.nan), resolution=geometry.resolution * stride, origin=tuple(first), yaw=geometry.yaw
    )
    return field.at(xy, 0.0).heights


def points_under(case: Case, index: int, rng: np.random.Generator) -> np.ndarray:
    """Points (n, 2) over which the body is at one time or another."""
    form, body = case.forms[index], case.bodies[index]
    spread = rng.uniform(-1.0, 1.0, (250, 2)) * form.radius
    places = body[:2] + body[7:9] * rng.uniform(0.0, case.duration, 250)[:, None]
    return np.asarray(places + spread)


def ground_heights(case: Case, xy: np.ndarray, time: float) -> np.ndarray:
    """Of points (n, 2) of the ground, where it has slid to; NaN where there is none."""
    grid, geometry = case.heightmap.moved_to(time), case.heightmap.geometry
    place = geometry.to_grid(xy - np.subtract(grid[3:5], geometry.origin[:2]))
    outside = ((place < 0.0) | (place > geometry.last)).any(axis=1)
    return np.where(outside, np.nan, case.heightmap.at_edge(xy, time).heights)


def inside_at(form: Form, xy: np.ndarray, z: np.ndarray, position: np.ndarray, turn: np.ndarray) -> np.ndarray:
    with np.errstate(invalid="ignore"):
        return form.inside(np.column_stack([xy, z]), position, turn)


def stands_on_what_is_over_its_middle(case: Case, index: int, support: Any) -> bool:
    """Whether a body whose middle is below the ground is on the plane of the facet over it."""
    body = case.bodies[index]
    centre = body[:3] + rotation(body[3:7]) @ case.forms[index].middle
    [ground] = ground_heights(case, centre[None, :2], case.time)
    [plane] = plane_heights(support, centre[None, :2], 0.0)
    return bool(support.state == Support.PLANE and ground > centre[2] and abs(plane - ground) < 1e-6)


@examples(150)
@given(seeds, st.sampled_from(GROUNDS), st.sampled_from([0.0005, 0.005, 0.05]), st.booleans())
def test_what_a_body_stands_on_lies_along_the_ground_where_it_can_touch_either(
    seed: int, kind: str, tolerance: float, moving: bool
) -> None:
    case, rng = case_of(kind, seed, moving=moving), np.random.default_rng(seed)
    supports = chosen_for(case, PatchConfig(tolerance=tolerance))
    for index, form in enumerate(case.forms):
        support, xy = supports[index], points_under(case, index, rng)
        if support.state == Support.NONE:
            assert not touched_by_brute_force(case, index), "it has nothing, and reaches ground"
            continue
        if support.state == Support.FIELD:
            reached = touched_by_brute_force(case, index)
            rows = {row for row, _, _ in reached}
            columns = {column for _, column, _ in reached}
            last_row = support.row + (support.rows - 1) * support.stride
            last_column = support.column + (support.columns - 1) * support.stride
            assert all(support.row <= row < last_row for row in rows)
            assert all(support.column <= column < last_column for column in columns)
        bound = float(support.deviation)
        if math.isnan(bound):
            assert stands_on_what_is_over_its_middle(case, index, support)
            continue
        cells = (support.rows - 1) * (support.columns - 1)
        if support.state == Support.PLANE or 3 * cells * support.stride**2 <= SELECTION.most_cells:
            assert bound <= tolerance, "every sample under it would have had room"
        still = field_heights(case, support, xy) if support.state == Support.FIELD else None
        for t, position, turn in path_of(case.bodies[index], case.duration):
            if support.state == Support.PLANE:
                ground, collider = ground_heights(case, xy, case.time + t), plane_heights(support, xy, t)
                touches = inside_at(form, xy, collider, position, turn)
                assert not np.isnan(ground[touches]).any(), "a plane where there is no ground"
            else:  # its samples are those of the update, and it moves on as a whole
                assert still is not None
                ground, collider = ground_heights(case, xy, case.time), still
                touches = inside_at(form, xy, collider, position, turn) & ~np.isnan(ground)
                if not moving:
                    hole = inside_at(form, xy, collider, position, turn) & np.isnan(ground)
                    assert not hole.any(), "a field where there is no ground"
            touches |= inside_at(form, xy, ground, position, turn)
            if moving and support.state == Support.FIELD and t > 0.0:
                continue
            # Heights are kept as float32; between its ends the motion of the ground is curved.
            slack = 1e-5 + (curvature(case, xy, t) if moving else 0.0)
            off = np.abs(ground - collider)[touches]
            assert np.nanmax(off, initial=0.0) <= bound + slack


def curvature(case: Case, xy: np.ndarray, t: float) -> float:
    """How far the ground's motion is from a straight one after a time, at most [m]."""
    first, now, last = (
        case.heightmap.sample(np.arange(SIZE * SIZE), case.time + age).heights for age in (0.0, t, case.duration)
    )
    return float(np.nanmax(np.abs(now - first - (last - first) * t / case.duration)))


@examples(40)
@given(seeds, st.sampled_from(GROUNDS))
def test_a_heightfield_is_always_there_over_ground(seed: int, kind: str) -> None:
    case = case_of(kind, seed)
    supports = chosen_for(case, PatchConfig(kind="heightfield"))
    for index, form in enumerate(case.forms):
        support, body = supports[index], case.bodies[index]
        assert support.state != Support.PLANE
        centre = body[:2] + (rotation(body[3:7]) @ form.middle)[:2]
        if np.isnan(case.heightmap.at([centre], case.time).heights[0]):
            continue
        assert support.state == Support.FIELD
        if not touched_by_the_selection(case, index):
            row, column = np.floor(case.heightmap.geometry.to_grid(centre))
            assert support.row <= row < support.row + support.rows - 1
            assert support.column <= column < support.column + support.columns - 1


@examples(40)
@given(seeds, st.sampled_from(GROUNDS))
def test_the_foot_is_a_point_of_the_ground(seed: int, kind: str) -> None:
    """That a ball is nearest to; a ball on a plane touches the ground just where the gap says."""
    case = case_of(kind, seed)
    supports = chosen_for(case)
    for index, form in enumerate(case.forms):
        support = supports[index]
        if support.state == Support.NONE or not form.ball:
            continue
        foot = np.array([support.foot_x, support.foot_y, support.foot_z])
        # On the edge of a hole rounding may put it beside the ground.
        around = foot[:2] + 1e-7 * np.array([(0, 0), (1, 0), (-1, 0), (0, 1), (0, -1)])
        assert np.nanmin(np.abs(case.heightmap.at_edge(around, case.time).heights - foot[2])) < 1e-5
        centre = case.bodies[index, :3] + rotation(case.bodies[index, 3:7]) @ form.offset
        normal = np.array([support.normal_x, support.normal_y, support.normal_z])
        if math.isnan(support.deviation):  # its middle is below the ground: it leaves through the facet over it
            assert stands_on_what_is_over_its_middle(case, index, support)
            np.testing.assert_allclose(foot[:2], centre[:2], atol=1e-6)
            assert -support.gap == pytest.approx(form.half[0] + (foot[2] - centre[2]) * normal[2], abs=1e-6)
            continue
        np.testing.assert_allclose(foot + (support.gap + form.half[0]) * normal, centre, atol=1e-6)


@given(seeds, st.sampled_from(GROUNDS), st.booleans())
@examples(30)
def test_equal_input_gives_equal_bits(seed: int, kind: str, moving: bool) -> None:
    first, second = (chosen_for(case_of(kind, seed, moving=moving)) for _ in range(2))
    assert first.tobytes() == second.tobytes()
    reordered = case_of(kind, seed, moving=moving)
    backwards = reordered._replace(forms=reordered.forms[::-1], bodies=reordered.bodies[::-1].copy())
    assert chosen_for(backwards)[::-1].tobytes() == first.tobytes()


@examples(40)
@given(seeds, st.sampled_from(["slope", "steps", "noise", "waves"]), st.sampled_from([math.pi, -math.pi, 2.0, 0.5]))
@example(0, "steps", math.pi - 1.2e-8)
@example(1, "waves", -math.pi + 3e-8)
def test_it_does_not_matter_how_the_grid_is_turned(seed: int, kind: str, yaw: float) -> None:
    """The same bodies on the same ground, both turned, have the same supports, turned."""
    straight, turned = case_of(kind, seed, yaw=0.0), case_of(kind, seed, yaw=yaw)
    cos, sin = math.cos(yaw), math.sin(yaw)
    spin = np.array([[cos, -sin], [sin, cos]])
    origin = np.array([3.0, -2.0])
    bodies = straight.bodies.copy()
    bodies[:, :2] = (bodies[:, :2] - origin) @ spin.T + origin
    bodies[:, 7:9], bodies[:, 10:12] = bodies[:, 7:9] @ spin.T, bodies[:, 10:12] @ spin.T
    half_cos, half_sin = math.cos(0.5 * yaw), math.sin(0.5 * yaw)
    x, y, z, w = straight.bodies[:, 3:7].T
    bodies[:, 3:7] = np.column_stack(
        [
            half_cos * x - half_sin * y,
            half_cos * y + half_sin * x,
            half_cos * z + half_sin * w,
            half_cos * w - half_sin * z,
        ]
    )
    expected = chosen_for(straight)
    found = chosen_for(turned._replace(bodies=bodies, forms=straight.forms))
    same = expected["state"] == found["state"]
    assert same.mean() >= 0.9, "some are on the verge"
    for name in ("gap", "rise", "foot_z", "facet_z"):
        one, other = expected[name][same], found[name][same]
        finite = np.isfinite(one)
        # The facet nearest to a ball over an edge is either of two.
        assert np.isclose(other[finite], one[finite], rtol=0.0, atol=2e-4).mean() >= 0.9


def on_flat_ground(radius: float, heights: list[float], config: PatchConfig | None = None) -> Any:
    rng = np.random.default_rng(0)
    heightmap = HeightMap(np.zeros((SIZE, SIZE)), resolution=0.1)
    forms = [Form("ball", radius, rng) for _ in heights]
    bodies = np.zeros((len(heights), BODY_COLUMNS))
    bodies[:, :2], bodies[:, 2], bodies[:, 6] = 1.5, heights, 1.0
    return chosen_for(Case(heightmap, forms, bodies, 0.0, 1 / 60), config)


def test_flat_ground_is_a_plane_and_the_air_is_nothing() -> None:
    supports = on_flat_ground(0.3, [0.3, 0.29, 0.31, 2.0])
    assert supports["state"].tolist() == [Support.PLANE, Support.PLANE, Support.NONE, Support.NONE]
    np.testing.assert_array_equal(supports["deviation"][:2], 0.0)
    np.testing.assert_allclose(supports["gap"][:2], [0.0, -0.01], atol=1e-12)
    np.testing.assert_array_equal(supports["facet_z"][:2], 1.0)


@pytest.mark.parametrize("kind", ["auto", "heightfield", "plane"])
def test_far_above_the_ground_only_a_heightfield_is_kept(kind: Any) -> None:
    states = on_flat_ground(0.3, [0.3, 5.0], PatchConfig(kind=kind))["state"].tolist()
    near = Support.FIELD if kind == "heightfield" else Support.PLANE
    assert states == [near, Support.FIELD if kind == "heightfield" else Support.NONE]


@examples(30)
@given(seeds)
def test_a_plane_is_taken_whatever_it_deviates_where_planes_are_asked_for(seed: int) -> None:
    supports = chosen_for(case_of("noise", seed), PatchConfig(kind="plane"))
    assert not (supports["state"] == Support.FIELD).any()


def test_coarser_ground_gets_a_coarser_stride() -> None:
    """A large body on gently curved ground needs few samples, on rough ground many."""
    rows, columns = np.indices((80, 80)) * 0.1
    rng, fields = np.random.default_rng(0), []
    for heights in (0.02 * np.sin(rows + columns), rng.normal(scale=0.01, size=(80, 80))):
        heightmap = HeightMap(heights, resolution=0.1)
        body = np.zeros((1, BODY_COLUMNS))
        body[0, :3], body[0, 6] = (4.0, 4.0, 1.48), 1.0
        case = Case(heightmap, [Form("ball", 1.5, rng)], body, 0.0, 1 / 240)
        fields.append(chosen_for(case, PatchConfig(tolerance=0.005))[0])
    gentle, rough = fields
    assert gentle.state == rough.state == Support.FIELD
    assert gentle.stride > rough.stride == 1
    assert gentle.rows * gentle.columns < rough.rows * rough.columns
    assert gentle.deviation <= 0.005


@pytest.mark.parametrize("amplitude", [0.001, 0.003, 0.01])
def test_a_resting_body_does_not_change_back_and_forth(amplitude: float) -> None:
    rng = np.random.default_rng(1)
    shape = 0.02 * ground_of("waves", rng)
    heightmap = HeightMap(shape, resolution=0.1)
    forms = [Form(("ball", "box")[index % 2], 0.1 * rng.choice([0.5, 1.5, 4.0]), rng) for index in range(40)]
    bodies = np.zeros((40, BODY_COLUMNS))
    bodies[:, :2] = heightmap.geometry.to_world(*rng.uniform(5.0, SIZE - 6.0, (2, 40)))
    bodies[:, 6] = 1.0
    low = [form.half[2] for form in forms]
    bodies[:, 2] = heightmap.at(bodies[:, :2], 0.0).heights + low
    case = Case(heightmap, forms, bodies, 0.0, 1 / 240)
    selector = selector_of(case, PatchConfig(tolerance=0.002))
    changes, before = 0, np.empty((0, 3))
    for step in range(60):
        trembling = bodies.copy()
        trembling[:, :3] += rng.uniform(-1.0, 1.0, (40, 3)) * 2e-4 * [1.0, 1.0, 0.1]
        heightmap.replace(shape * (1.0 + amplitude * np.sin(step)), time=10.0 * step)
        selector.update(trembling, 10.0 * step, 1 / 240)
        supports = selector.supports
        field = supports["state"] == Support.FIELD
        has = np.where(field[:, None], np.stack([supports["rows"], supports["columns"], supports["stride"]], 1), 0)
        has = np.column_stack([supports["state"], has])
        changes += int((has != before).any(axis=1).sum()) if len(before) else 0
        before = has
    assert changes <= 0.02 * 40 * 60


@pytest.mark.parametrize("yaw", [0.0, 0.5 * math.pi])
def test_a_long_thin_box_has_every_sample_under_it(yaw: float) -> None:
    """A field is bounded by its cells in all, not by those on a side."""
    rng = np.random.default_rng(3)
    heightmap = HeightMap(rng.normal(scale=0.01, size=(81, 81)), resolution=0.05)
    plank = form_of(box((2.0, 0.1, 0.05)))
    bodies = np.zeros((1, BODY_COLUMNS))
    bodies[0, :3], bodies[0, 5:7] = (2.0, 2.0, 0.03), (math.sin(0.5 * yaw), math.cos(0.5 * yaw))
    [support] = chosen_for(Case(heightmap, [plank], bodies, 0.0, 1 / 60))
    assert (support.state, support.stride, support.deviation) == (Support.FIELD, 1, 0.0)
    assert max(support.rows, support.columns) * 0.05 >= 2.0


def test_a_body_larger_than_the_window_stands_on_a_field_of_bounded_size() -> None:
    rng = np.random.default_rng(3)
    heights = rng.normal(scale=0.05, size=(400, 400))
    heightmap = HeightMap(heights, resolution=0.05)
    bodies = np.zeros((1, BODY_COLUMNS))
    bodies[0, :3], bodies[0, 6] = (10.0, 10.0, 1.1), 1.0
    case = Case(heightmap, [form_of(box((16.0, 16.0, 2.0)))], bodies, 0.0, 1 / 60)
    [support] = chosen_for(case)
    assert support.state == Support.FIELD
    assert (support.rows - 1) * (support.columns - 1) <= SELECTION.most_cells
    assert math.isnan(support.deviation), "samples were left out"
    first = heightmap.geometry.to_world(support.row, support.column)
    last = heightmap.geometry.to_world(
        support.row + (support.rows - 1) * support.stride, support.column + (support.columns - 1) * support.stride
    )
    assert (first <= 2.0).all()
    assert (last >= 18.0).all()


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_bodies_at_no_place_have_nothing(bad: float) -> None:
    case = case_of("waves", 0)
    for column in (0, 2, 4, 8, 12):
        bodies = case.bodies.copy()
        bodies[3, column] = bad
        supports = chosen_for(case._replace(bodies=bodies))
        assert supports["state"][3] == Support.NONE
        expected = chosen_for(case)
        for index in (0, 1, 2, 4, 5, 6):
            assert supports[index].tobytes() == expected[index].tobytes()


UNCOMPILED = """
import json
import numpy as np
from tests.patches.test_selection import GROUNDS, case_of, chosen_for
from smartmesh_ros.patches.config import PatchConfig
found = {}
for kind in GROUNDS:
    for patch in ("auto", "heightfield"):
        supports = chosen_for(case_of(kind, 5, moving=kind in ("waves", "steps"), count=7), PatchConfig(kind=patch))
        found[f"{kind} {patch}"] = [[repr(float(value)) for value in record] for record in supports.tolist()]
print(json.dumps(found))
"""


@pytest.mark.parametrize("disabled", ["1"])
def test_as_python_the_same_functions_give_equal_results(disabled: str) -> None:
    results = []
    for switch in ("0", disabled):
        done = subprocess.run(
            [sys.executable, "-W", "ignore", "-c", UNCOMPILED],
            env={**os.environ, "NUMBA_DISABLE_JIT": switch},
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stderr
        results.append(json.loads(done.stdout.splitlines()[-1]))
    compiled, python = results
    assert compiled.keys() == python.keys()
    for name, records in compiled.items():
        values, others = np.array(records, float), np.array(python[name], float)
        np.testing.assert_allclose(others, values, rtol=1e-9, atol=1e-9, err_msg=name)
