"""What cannot be is refused with a reason and what would be right, and the ground is as before."""

import math
import pickle
import warnings
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pytest

from smartmesh_ros import Box, Deck, GridGeometry, HeightMap, HeightScan, InputError, Material, MotionConfig, Terrain
from smartmesh_ros.terrain.surface_query import checked_points, checked_rays
from smartmesh_ros.terrain.trimesh import TriangleMesh, grid_triangles
from tests.grounds import terrain_of

NAN, INF = math.nan, math.inf
# Vertices of a mesh of 6 x 8.
PLACES = np.stack([*np.divmod(np.arange(48.0), 8.0), np.sin(np.arange(48.0))], axis=1)
TRIANGLES = grid_triangles(6, 8)
DOWN = [[0, 0, -1]]
ONES = np.ones((9, 12))


scan = partial(HeightScan.of, "isaac_lab")
geometry = partial(GridGeometry, **{"rows": 10, "columns": 10, "resolution": 0.1})


def rays(origins: Any, directions: Any = DOWN, reach: float = 1.0) -> object:
    return checked_rays(origins, directions, reach)


def flat(**given: Any) -> HeightMap:
    return HeightMap(np.zeros((9, 12)), **{"resolution": 0.1, **given})


def places(points: Any) -> object:
    return flat().at(points, 0.0)


def mesh(vertices: Any = PLACES, triangles: Any = TRIANGLES, **more: Any) -> TriangleMesh:
    return TriangleMesh(vertices, triangles, **more)


def deck_move(*pose: Any, **given: Any) -> None:
    deck = Deck(flat())
    deck.move((0.0, 0.0, 0.0), time=1.0)
    deck.move(*pose, **{"time": 2.0, **given})


def layer(name: str) -> Callable[..., object]:
    """A maker of a map whose material has this layer."""
    return lambda given: flat(material=Material(**{name: given}))


FERRY = terrain_of(ferry=Deck(flat()))
FERRY.put("", flat())
# Makers with arguments that cannot be, the reason, and words of the refusal.
REFUSED: dict[tuple[Callable[..., object], str], list[tuple[Any, str]]] = {
    (scan, "height_scan"): [
        ({"size": (1.0,)}, "the size is (1.0,); it must be 2 numbers"), ({"size": (NAN, 1.0)}, "size"),
        ({"spacing": 0.0}, "above 0"), ({"spacing": 0.001}, "at most 100000 points"),
        ({"spacing": None}, "the spacing is None; it must be a number"), ({"noise": True}, "noise"),
        ({"order": "zx"}, "one of ('xy', 'yx')"), ({"values": "depth"}, "one of ('height', 'clearance')"),
        ({"distribution": "pink"}, "one of ('uniform', 'normal')"), ({"offset": (0.0, INF, 0.0)}, "offset"),
        ({"clip": (1.0, -1.0)}, "a lower and a higher bound"), ({"delay": 11.0}, "0 to 10 s"),
        ({"scale": INF}, "finite"), ({"seed": 0.5}, "whole number"),
        ({"spacing": 10**400}, "must be a number"), ({"order": ONES}, "one of ('xy', 'yx')"),
    ],
    (HeightScan.of, "height_scan"): [((name,), "one of ('isaac_lab', ") for name in ("isaac_gym", [])],
    (MotionConfig, "parameter"): [
        *(({"mode": value}, "one of ('hold', ") for value in ("guess", ONES)),
        *(({"changes": value}, "one of ('motion', ") for value in ("guess", ONES)),
        ({"max_interval": 0.0}, "max_interval"),
        ({"max_velocity": NAN}, "max_velocity"), ({"settle": 0.0}, "settle"), ({"noise": "little"}, "noise"),
        *(({"min_interval": value}, "min_interval") for value in (1.0, -1.0)), ({"smoothing": 11.0}, "smoothing"),
    ],
    (geometry, "geometry"): [
        ({"rows": 2}, "3 x 3"), ({"columns": 0}, "3 x 3"), ({"rows": 5.0}, "whole numbers"), ({"yaw": NAN}, "yaw"),
        ({"origin": (0.0, INF, 0.0)}, "origin"), ({"origin": ("x", 0.0, 0.0)}, "three numbers"),
        *(({"resolution": value}, "resolution") for value in (0.0, NAN)), ({"yaw": "north"}, "yaw is north"),
    ],
    (geometry, "size"): [
        ({"rows": count, "columns": count}, "too many") for count in (2**20, np.int32(2**16), np.uint16(65535))
    ],
    (flat, "geometry"): [
        ({"resolution": None, "geometry": (9, 12)}, "pass GridGeometry(rows=..., ...)"),
        ({"geometry": GridGeometry(rows=9, columns=12, resolution=0.2)}, "resolution is given twice"),
    ],
    (checked_points, "length"): [(([0.0, 0.0],), "(N, 2)"), (([["a", "b"]],), "real numbers")],
    (checked_points, "non_finite"): [
        (([[0.0, INF]],), "finite"), ((np.ma.masked_equal([[0.0, -9.0]], -9.0),), "finite"),
    ],
    (checked_points, "geometry"): [(([[-1e300, 0.0]],), "m away")],
    (rays, "length"): [(([[0, 0, 1]], [[0, 0, -1], [0, 0, 1]]), "both must be"), (([[0, 0]], [[0, 0]]), "both")],
    (rays, "non_finite"): [(([[0, 0, NAN]],), "not finite"), (([[0, 0, 1]], [[0, INF, -1]]), "not finite")],
    (rays, "direction"): [(([[0, 0, 1]], [[0, 0, 0]]), "direction 0 has no length")],
    (rays, "geometry"): [(([[0, 0, 1e300]],), "up to 1e+300 m away")],
    (rays, "range"): [(([[0, 0, 1]], DOWN, reach), "range") for reach in (0.0, INF, None, "far")],
    (rays, "type"): [(([["a", 0, 1]],), "no real numbers")],
    (places, "length"): [((points,), "real numbers of shape (N, 2)")
                         for points in ([], [[0.0, 0.0, 0.0]], np.zeros((2, 2, 2)), [[1j, 0.0]])],
    (flat, "parameter"): [({"motion": "hold"}, "pass MotionConfig(mode=...)")],
    (flat, "type"): [
        ({"material": given}, "pass Material(friction=..., ...)") for given in ({"friction": 0.5}, np.ones((9, 12)))
    ],
    (flat, "layer"): [({"friction": 0.3, "material": Material(friction=0.3)}, "given twice")],
    (layer("friction"), "friction"): [((given,), "zero or more") for given in (-0.1, NAN, INF, -ONES, INF * ONES)],
    (layer("friction"), "type"): [((np.full((9, 12), "ice"),), "real numbers")],
    (layer("stiffness"), "stiffness"): [((0.0,), "above zero"), ((-ONES,), "above zero")],
    (layer("damping"), "damping"): [((-1.0,), "zero or more"), ((INF,), "zero or more")],
    (layer("restitution"), "restitution"): [((1.1,), "at most 1")],
    (layer("rolling"), "rolling"): [((INF * ONES,), "zero or more")],
    (layer("rolling"), "length"): [((np.ones((3, 3)),), "it must be")],
    (layer("soil"), "soil"): [((np.full((9, 12), 255),), "0 to 254")],
    (Deck, "thickness"): [({"thickness": given}, "above zero") for given in (-1.0, 0.0, NAN, [0.1])],
    (deck_move, "deck"): [
        *((((0.0, 0.0, *more),), "three finite numbers") for more in ((), (NAN,))),
        ({"position": (0.0, 0.0, 0.0), "velocity": (1.0, 0.0, 0.0)}, "give both the velocity and the spin"),
    ],
    (deck_move, "quaternion"): [(((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 2.0)), "must be a unit quaternion")],
    (deck_move, "time"): [({"position": (0.0, 0.0, 0.0), "time": 0.5}, "too late"),
                          ({"position": (0.0, 0.0, 0.0), "time": 1e308}, "up to 1e+12")],
    (Terrain().put, "name"): [
        ((name, made), "must be a text") for name in (3, None) for made in (flat(), Deck(flat()))
    ],
    (FERRY.put, "name"): [(("", Deck(flat())), "the name of a tile"), (("ferry", flat()), "the name of a deck")],
    (FERRY.deck, "unknown_deck"): [(("sea",), "there is no deck 'sea'; known: 'ferry'"), (([],), "no deck []")],
    (FERRY.tile, "unknown_tile"): [(("sea",), "there is no tile 'sea'; known: ''"), (([],), "no tile []")],
    (FERRY.remove, "name"): [(([],), "must be a text")],
    **{(moving, "time"): [((time,), "finite number of seconds") for time in ("now", NAN, 1e308)]
       for moving in (FERRY.moving, FERRY.deck("ferry").moving, FERRY.tile("").moving, mesh().moving,
                      FERRY.deck("ferry").frame)},
    (partial(HeightScan().read, flat()), "length"): [
        ((poses, 0.0), "x, y, z and yaw of each") for poses in ([[0, 0, 0]], [["a", "b", "c", "d"]])
    ],
    (partial(Box, 1.0, 1.0, 1.0), "geometry"): [
        ({"centre": centre}, "three numbers") for centre in ((1.0, 2.0), None, (0.0, 0.0, NAN), (0.0, 0.0, 1e9))
    ],
    **{(sample, "type"): [((numbers, 0.0), "whole numbers") for numbers in ("x", [0.5])]
       for sample in (flat().sample, mesh().sample)},
    **{(sample, "time"): [(([0], "now"), "finite number of seconds"), (([0], 0.0, -1.0), "the time ahead is -1.0")]
       for sample in (flat().sample, mesh().sample)},
    (flat().slide, "motion"): [
        *(((speeds, 1.0), "two finite numbers [m/s]") for speeds in ("x", None, (1.0,), (1.0, 2.0, 3.0), (NAN, 0.0))),
        *((((1.0, 0.0), interval), "above zero, up to 1e+12 s") for interval in ("x", None, 0.0, NAN)),
        (((1.0, 0.0), 1.0, "x"), "the spin of a map is 'x'"),
    ],
    (mesh, "length"): [
        ((PLACES[:, :2],), "(V, 3)"), ((PLACES, [[0, 1]]), "(T, 3)"), ((PLACES, np.zeros((0, 3), int)), "at least one"),
        ({"velocities": np.zeros((3, 3))}, "(48, 3)"),
    ],
    (mesh, "index"): [((PLACES, [corners]), "a triangle uses") for corners in ([0, 1, 48], [0, 1, -1], [0, 1, 1])],
    (mesh, "type"): [((PLACES, [[0.0, 1.0, 2.0]]), "whole numbers")],
    (mesh, "geometry"): [((PLACES * 1e12,), "m away")],
    (mesh, "non_finite"): [((PLACES * NAN,), "not finite"), ((np.ma.masked_equal(PLACES, PLACES[5, 2]),), "finite")],
}  # fmt: skip


@pytest.mark.parametrize(
    ("make", "reason", "given", "words"),
    [(make, reason, given, words) for (make, reason), cases in REFUSED.items() for given, words in cases],
)
def test_what_cannot_be_made_is_refused(make: Callable[..., object], reason: str, given: Any, words: str) -> None:
    with pytest.raises(InputError) as refused:
        make(**given) if isinstance(given, dict) else make(*given)
    assert refused.value.reason == reason
    assert words in str(refused.value)


def map_update(how: str, *place: int, heights: Any = ONES, **given: Any) -> tuple[HeightMap, Any]:
    """A map that is pressed, and an update of it."""
    heightmap = HeightMap(np.zeros((9, 12)), resolution=0.1, material=Material(rolling=0.2))
    heightmap.press(np.array([[1, 1]]), np.array([-0.2], np.float32))
    return heightmap, lambda: getattr(heightmap, how)(*place, heights, **{"time": 1.0, **given})


def map_layers(**layers: Any) -> tuple[HeightMap, Any]:
    heightmap = flat(friction=0.3)
    return heightmap, lambda: heightmap.give(Material(**layers))


def map_shift(by: Any) -> tuple[HeightMap, Any]:
    heightmap = flat()
    return heightmap, lambda: heightmap.shift_time(by)


def mesh_update(vertices: Any, **given: Any) -> tuple[TriangleMesh, Any]:
    made = mesh()
    return made, lambda: made.move(vertices, time=1.0, **given)


UPDATES = [
    *((map_update, (how, *place), given, reason)
        for how, *place in (("replace",), ("update_region", 0, 0))
        for given, reason in (
            *(({"time": time}, "time") for time in (NAN, INF, 10**400, "soon", -1.0)),
            *(({"heights": np.full((9, 12), height)}, "non_finite") for height in (np.inf, 1e300)),
            ({"heights": np.full((9, 12), 1j)}, "type"), ({"velocities": np.zeros((3, 3))}, "length"),
            ({"velocities": np.full((9, 12), INF)}, "non_finite"), ({"variance": np.zeros((3, 3))}, "length"),
            ({"material": Material(rolling=0.1, stiffness=-1.0)}, "stiffness"),
        )),
    *((map_update, (how, *place), {"heights": np.zeros(shape)}, reason) for how, place, shape, reason in (
        ("replace", (), (9, 13), "length"), ("update_region", (7, 0), (3, 1), "region"),
        ("update_region", (0, -1), (1, 1), "region"), ("update_region", (0, 0), (0, 1), "length"),
        ("update_region", (0, 0), (3,), "length"))),
    *((map_update, ("update_region", row, 0), {"heights": np.zeros((2, 2))}, "region")
        for row in (1.0, "1", None, np.uint8(255))),
    (map_layers, (), {"friction": 0.5, "stiffness": 0.0}, "stiffness"),
    *((map_shift, (by,), {}, "time") for by in (NAN, INF, None, "later")),
    *((mesh_update, (vertices,), {} if indices is None else {"indices": indices}, reason)
        for vertices, indices, reason in (
            (np.zeros((3, 3)), None, "length"), (np.zeros((1, 3)), [48], "index"), (np.zeros((2, 3)), [4, 4], "index"),
            (np.zeros((2, 3)), [4], "length"), (np.full((1, 3), INF), [4], "non_finite"),
            (np.full((1, 3), -1e12), [4], "geometry"))),
]  # fmt: skip


@pytest.mark.parametrize(("update", "place", "given", "reason"), UPDATES)
def test_an_update_that_is_refused_changes_nothing(
    update: Callable[..., tuple[Any, Any]], place: tuple[Any, ...], given: dict[str, Any], reason: str
) -> None:
    ground, act = update(*place, **given)
    before, revision = pickle.dumps(ground), ground.revision
    with pytest.raises(InputError) as refused:
        act()
    assert refused.value.reason == reason
    assert (pickle.dumps(ground), ground.revision) == (before, revision)


@pytest.mark.parametrize("number", [0.25, np.float32(0.25), np.float64(0.25)])
def test_a_number_of_numpy_is_a_number(number: Any) -> None:
    heightmap = flat(variance=number, friction=number)
    heightmap.replace(np.zeros((9, 12)), time=1.0, variance=number)
    heightmap.update_region(np.uint8(1), np.int64(2), np.zeros((2, 2)), time=2.0, variance=number)
    assert heightmap.noise == 0.5 and heightmap.friction == 0.25
    scan = HeightScan.of("isaac_lab", spacing=number, size=np.ones(2), seed=np.int32(3))
    assert (scan.spacing, scan.size, scan.seed) == (0.25, (1.0, 1.0), 3)


def test_tiles_and_decks_are_put_and_not_assigned() -> None:
    """An assignment would reach questions and no contacts."""
    terrain = Terrain(flat())
    terrain.put("deck", Deck(flat()))
    for known in (terrain.tiles, terrain.decks, terrain.deck("deck").tiles):
        with pytest.raises(TypeError):
            known["other"] = flat()  # type: ignore[index]
        assert len(known) == 1
    copy = pickle.loads(pickle.dumps(terrain))
    assert copy.tiles.keys() == {""} and copy.decks.keys() == {"deck"}


def test_triangles_may_lie_in_memory_in_any_order() -> None:
    assert np.array_equal(mesh(triangles=np.asfortranarray(TRIANGLES)).triangles, TRIANGLES)


def test_heights_whose_sum_is_too_large_are_taken_without_a_warning() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert HeightMap(np.full((9, 12), 1e38), resolution=0.1).heights[0, 0] == np.float32(1e38)
