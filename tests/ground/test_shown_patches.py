"""Patches are the ground in reach of bodies, whatever was kept of those before."""

from collections.abc import Iterable
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from rclpy.serialization import deserialize_message
from visualization_msgs.msg import MarkerArray

from smartmesh_ros import Deck, HeightMap, MotionConfig, Terrain
from smartmesh_ros.core.body_shape import BodyShape
from smartmesh_ros.ground.followers import Follower, Followers
from smartmesh_ros.ground.shown_patches import PatchTable, ShownPatches
from smartmesh_ros.ground.state import BODY_COLUMNS
from smartmesh_ros.stopwatch import Stopwatch
from smartmesh_ros.terrain.grid import BoolArray, FloatArray
from smartmesh_ros.terrain.terrain import MainMesh
from smartmesh_ros.terrain.trimesh import TriangleMesh
from tests.bodies import rotation
from tests.core import mesh_parts
from tests.examples import examples
from tests.grounds import level, patch_of, shaped, terrain_of
from tests.terrain.surfaces import facet_distances, triangles_of

HOLD = MotionConfig(mode="hold")


class Reaching:
    """Bodies of ``shapes`` (n,) in the first slots. Those that are not ``solid`` (n,) have patches at any height."""

    def __init__(self, ground: MainMesh | Terrain, shapes: Iterable[BodyShape], solid: BoolArray | bool = True) -> None:
        known, self.followers = list(shapes), Followers()
        for body, is_solid in enumerate(np.broadcast_to(solid, len(known)).tolist()):
            self.followers.add(Follower(body, -1, known[body], is_solid))
        self.patches = ShownPatches(Terrain.of(ground), self.followers, Stopwatch())

    def at(self, positions: FloatArray, time: float = 0.0, speed: float = 0.0) -> PatchTable:
        """Patches of bodies at positions (n, 3) [m] that move along x [m/s]."""
        states = np.zeros((self.followers.capacity, BODY_COLUMNS))
        states[: len(positions), :3], states[:, 6], states[:, 7] = positions, 1.0, speed
        self.patches.find(states, time)
        return self.patches.table()


def balls_on(ground: MainMesh | Terrain, radii: Iterable[float], solid: BoolArray | bool = True) -> Reaching:
    """Balls of these radii [m]."""
    return Reaching(ground, [BodyShape.ball(radius) for radius in radii], solid)


def rough(seed: int = 0, side: int = 60, holes: float = 0.0, **more: Any) -> HeightMap:
    rng = np.random.default_rng(seed)
    heights = rng.normal(scale=0.05, size=(side, side))
    heights[rng.random(heights.shape) < holes] = np.nan
    return HeightMap(heights, resolution=0.1, origin=(1.0, -2.0, 0.3), yaw=0.4, **more)


def places_on(terrain: HeightMap, rng: np.random.Generator, count: int, above: float) -> FloatArray:
    """Places (count, 3) over a map, at a height above where it is known."""
    rows, columns = terrain.geometry.rows, terrain.geometry.columns
    places = terrain.geometry.to_world(rng.uniform(0, rows - 1, count), rng.uniform(0, columns - 1, count))
    heights = np.nan_to_num(terrain.at(places, 0.0).heights, nan=0.3)
    return np.column_stack([places, heights + above])


def corners_of(bodies: Reaching, slot: int) -> FloatArray:
    """The triangles (t, 3, 3) of a body's marker [m]."""
    one = np.array([slot])
    data = bodies.patches.markers(one, one, one[:0], (0, 0), "map", "patches", (1.0, 1.0, 1.0, 1.0), 0.0)
    [marker] = deserialize_message(data, MarkerArray).markers
    return np.array([(p.x, p.y, p.z) for p in marker.points]).reshape(-1, 3, 3)


def ordered(triangles: FloatArray) -> FloatArray:
    rows = triangles.reshape(len(triangles), 9)
    return np.asarray(rows[np.lexsort(rows.round(6).T)])


@examples(30)
@given(st.integers(0, 10**6), st.floats(0.02, 0.6), st.sampled_from([0.0, 0.1]))
@example(49166, 0.03125, 0.1)
def test_a_marker_has_the_cells_of_the_map_in_reach_and_no_others(seed: int, radius: float, holes: float) -> None:
    terrain, rng = rough(seed, holes=holes), np.random.default_rng(seed)
    bodies, places = balls_on(terrain, [radius] * 8), places_on(terrain, rng, 8, 0.5 * radius)
    facets = triangles_of(terrain, 0.0)
    cells = np.floor(terrain.geometry.to_grid(facets[..., :2].mean(axis=1)))
    slots = bodies.at(places).slots.tolist()
    for slot, at in enumerate(places):
        place = terrain.geometry.to_grid(at[:2])
        away = np.maximum(np.maximum(cells - place, place - cells - 1.0), 0.0) * 0.1  # from the cell of each triangle
        expected = facets[(away**2).sum(axis=1) <= radius**2]
        if len(expected) and at[2] - radius > expected[..., 2].max():
            continue  # it is above all of them, where the ground below its middle is a hole
        assert (slot in slots) == (len(expected) > 0)
        if slot in slots:
            np.testing.assert_allclose(ordered(corners_of(bodies, slot)), ordered(expected), atol=1e-5)


@pytest.mark.parametrize("radius", [0.3, 6.0])
def test_points_are_samples_and_say_how_many_were_left_out(radius: float) -> None:
    terrain = rough(side=201)
    place = np.array([[*terrain.geometry.to_world(100.2, 99.7), 0.3]])
    table = balls_on(terrain, [radius]).at(place)
    stride = int(table.stride[0])
    assert balls_on(terrain_of(deck=Deck(terrain)), [radius]).at(place).stride.tolist() == [stride]
    assert (stride == 1) == (radius < 1.0)
    side = round(len(patch_of(table, 0)[0]) ** 0.5)
    steps = stride * (np.arange(side) - side // 2)
    rows, columns = table.rows[0] + steps[:, None] + 0 * steps, table.columns[0] + 0 * steps[:, None] + steps
    expected = np.column_stack([terrain.geometry.to_world(rows.ravel(), columns.ravel()), np.zeros(side * side)])
    expected[:, 2] = terrain.heights[rows, columns].ravel() + 0.3
    np.testing.assert_allclose(patch_of(table, 0)[0], expected, atol=1e-5)


SHAPES = [BodyShape.ball(0.15), BodyShape.box((0.3, 0.2, 0.1)), BodyShape.ball(0.4), BodyShape.ball(0.05)]
IS_SOLID = np.array([True, True, False, True])


@examples(40)
@given(
    st.integers(0, 10**6),
    st.lists(st.sampled_from(["map", "region", "move", "time", "mesh", "tile", "nothing"]), max_size=12),
    st.sampled_from([MotionConfig(), HOLD, MotionConfig(changes="correction")]),
)
def test_kept_patches_are_those_of_fresh_ones(seed: int, actions: list[str], motion: MotionConfig) -> None:
    """After whatever changed of bodies and ground."""
    rng, time = np.random.default_rng(seed), 0.0
    tile, mesh = rough(seed, 40, 0.05, motion=motion), TriangleMesh(*mesh_parts.sheet(4.0, 12))
    terrain = Terrain.of(tile)
    terrain.put("mesh", mesh)
    bodies, places = Reaching(terrain, SHAPES, IS_SOLID), places_on(tile, rng, 4, 0.1)
    for action in (*actions, "nothing"):
        if action == "map":
            tile.replace(tile.heights + rng.normal(scale=0.01, size=tile.heights.shape), time=time)
        elif action == "region":
            row, column = rng.integers(0, 30, 2).tolist()
            tile.update_region(row, column, rng.normal(scale=0.05, size=(8, 6)), time=time)
        elif action == "mesh":
            mesh.move(mesh.vertices + (0.0, 0.0, 0.01), time=time)
        elif action == "move":
            places += rng.normal(scale=0.1, size=places.shape)
        elif action == "time":
            time += float(rng.choice([1e-3, 0.05, 3.0]))
        elif action == "tile":
            terrain.put("other", HeightMap(np.zeros((20, 20)), resolution=0.15, origin=(-1.0, 0.0), motion=motion))
        kept = bodies.at(places, time)
        fresh = Reaching(terrain, SHAPES, IS_SOLID)
        if len(terrain.tiles) < 3:  # where tiles overlap, a body stays with its own
            wanted = fresh.at(places, time)
            for name in ("slots", "tiles", "rows", "columns", "stride", "motion", "points_w", "triangles"):
                np.testing.assert_array_equal(getattr(kept, name), getattr(wanted, name), err_msg=name)
            for slot in kept.slots.tolist():
                np.testing.assert_array_equal(corners_of(bodies, slot), corners_of(fresh, slot))


def test_what_lies_still_on_ground_that_stands_still_is_not_read_again() -> None:
    terrain = rough(side=200, motion=HOLD)
    places = np.array([[*terrain.geometry.to_world(20.3, 20.2), 0.3]])
    bodies = balls_on(terrain, [0.2])
    before = bodies.at(places).revisions, bodies.patches.marker_revisions()
    terrain.update_region(150, 150, np.ones((9, 9)), time=1.0)  # elsewhere
    terrain.update_region(20, 20, terrain.heights[20:22, 20:22], time=2.0)  # as it was
    after = bodies.at(places, 3.0).revisions, bodies.patches.marker_revisions()
    assert before == after
    terrain.update_region(20, 20, np.ones((2, 2)), time=4.0)
    assert bodies.at(places, 4.0).revisions != before[0]


@given(st.floats(-2, 2), st.floats(-0.9, 0.9), st.floats(-0.9, 0.9), st.floats(-3.1, 3.1))
def test_the_motion_is_that_of_rigidly_moving_ground(rise: float, roll: float, pitch: float, yaw: float) -> None:
    terrain = HeightMap(np.zeros((60, 60)), resolution=0.2, yaw=yaw)
    place = terrain.geometry.to_world(*np.indices((60, 60)))
    velocities = rise + roll * place[..., 1] - pitch * place[..., 0]
    terrain.replace(np.zeros((60, 60)), time=0.1, velocities=velocities)
    table = balls_on(terrain, [0.3]).at(np.array([[*terrain.geometry.to_world(29.7, 30.2), 0.2]]), time=0.1)
    x, y = terrain.geometry.to_world(table.rows[0], table.columns[0]).tolist()
    expected = [0.0, 0.0, rise + roll * y - pitch * x, roll, pitch, 0.0]
    np.testing.assert_allclose(table.motion[0], expected, atol=1e-3)


def test_bodies_in_the_air_have_no_patch_unless_other_simulators_move_them() -> None:
    bodies = balls_on(rough(), [0.2, 0.2, 0.2], np.array([True, False, True]))
    middle = [*rough().geometry.to_world(30.0, 30.0)]
    places = np.array([[*middle, 3.0], [*middle, 3.0], [*middle, 0.4]])
    assert bodies.at(places).slots.tolist() == [1, 2]
    assert bodies.at(places, speed=2.0 * 60.0).slots.tolist() == [1, 2], "whatever its speed, it comes no farther"
    places[:, 0] += 50.0
    assert not len(bodies.at(places))


def test_on_a_mesh_triangles_in_reach_are_shown() -> None:
    vertices, triangles = mesh_parts.sheet(4.0, 20, lambda x, y: 0.1 * np.sin(3.0 * x))
    bodies, middle = balls_on(TriangleMesh(vertices, triangles), [0.35]), np.array([[0.3, 0.4, 0.2]])
    table = bodies.at(middle)
    assert table.is_mesh.tolist() == [True]
    away = facet_distances(vertices[triangles] * (1.0, 1.0, 0.0), middle * (1.0, 1.0, 0.0))[0]
    shown = {corners.tobytes() for corners in corners_of(bodies, 0)}
    for corners, far in zip(vertices[triangles], away, strict=True):
        if abs(far - 0.35) > 1e-6:
            assert (corners.tobytes() in shown) == (far < 0.35)
    np.testing.assert_array_equal(vertices[table.columns[0]], patch_of(table, 0)[0][_middle(patch_of(table, 0)[0])])


@pytest.mark.parametrize("kind", ["map", "mesh"])
def test_patches_on_a_deck_are_those_on_the_same_ground_at_rest_seen_from_the_world(kind: str) -> None:
    vertices, triangles = mesh_parts.sheet(4.0, 20, lambda x, y: 0.1 * np.sin(3.0 * x))
    ground = rough(holes=0.1) if kind == "map" else TriangleMesh(vertices + [3.0, 3.0, 0.3], triangles)
    places = places_on(rough(), np.random.default_rng(0), 8, 0.1)
    deck, terrain = Deck(ground, thickness=0.5), Terrain()
    turn = np.array([0.1, -0.2, 0.3, 0.0])
    turn[3] = np.sqrt(1.0 - turn @ turn)
    at, velocity, spin = np.array([1.0, 2.0, 5.0]), np.array([0.3, 0.2, -0.1]), np.array([0.1, -0.05, 0.2])
    deck.place(at, turn, time=0.0)
    terrain.put("ferry", deck)
    rotated = rotation(turn)
    resting, riding = (balls_on(on, [0.3] * 8) for on in (ground, terrain))
    known, table = resting.at(places), riding.at(places @ rotated.T + at)
    assert table.slots.tolist() == known.slots.tolist()
    assert len(table) > 2
    assert set(table.tiles) == {"ferry"}
    assert (table.rows.tolist(), table.columns.tolist()) == (known.rows.tolist(), known.columns.tolist())
    for slot in table.slots.tolist():
        expected = corners_of(resting, slot) @ rotated.T + at
        np.testing.assert_allclose(corners_of(riding, slot), expected, atol=1e-9)
    assert np.array_equal(riding.at(places @ rotated.T + at).revisions, table.revisions), "nothing has changed"
    deck.move(at, turn, time=0.0, velocity=velocity, spin=spin)
    moving = riding.at(places @ rotated.T + at)
    assert not set(moving.revisions.tolist()) & set(table.revisions.tolist())
    for index in range(len(moving)):
        points = patch_of(moving, index)[0]
        middle = points[_middle(points)]
        np.testing.assert_allclose(moving.motion[index], [*(velocity + np.cross(spin, middle - at)), *spin], atol=1e-9)
    deck.ride(3, -1, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
    assert 3 not in riding.at(places @ rotated.T + at).slots, "a carrier has no patch on its own deck"


def _middle(points: FloatArray) -> int:
    """The point nearest to the mean of all, seen from above: where clients take the motion to hold."""
    return int(np.argmin(((points[:, :2] - points[:, :2].mean(axis=0)) ** 2).sum(axis=1)))


def test_patches_on_a_deck_are_of_the_tiles_that_it_has_now() -> None:
    deck = Deck(level())
    bodies = balls_on(terrain_of(deck=deck), [0.1])
    for height in (0.0, -0.05):
        deck.put("", shaped(lambda x, y, height=height: height))  # type: ignore[misc]
        assert bodies.at(np.zeros((1, 3))).points_w[:, 2] == pytest.approx(height)
    deck.remove("")
    deck.put("other", level())
    assert bodies.at(np.zeros((1, 3))).tiles == ["deck/other"]
