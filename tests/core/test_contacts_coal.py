"""Contacts of the core against the library coal: distances, depths, and ways out of the ground.

Depths: coal gives the shortest way out of each facet alone, which may lead sideways past the facet's edge. Where a body
overlaps several facets the shortest way out of all of them is longer. So coal's depth is a lower bound; on convex
ground, which is one convex solid, it is the depth itself.

On steep thin ridges about one pose in 10,000 of shapes with corners still overlaps the ground without a contact that
says so, or has one that is too deep. On convex ground one overlap in 200 is told up to a fifth too deep: its normal is
that of a face or facet beside the pair (SEAT of cones.h). `make contacts` finds and lists them, so it fails for those
shapes.
"""

import os
from collections.abc import Iterable, Iterator
from functools import cache

import coal
import numpy as np
import pytest

from smartmesh_ros import HeightMap
from smartmesh_ros.core.body_shape import BodyShape
from smartmesh_ros.terrain.trimesh import TriangleMesh
from tests.core import contact_cases, mesh_parts
from tests.core.contact_cases import IDENTITY, SHAPES, Case, Facets, body, contacts_of, distance, random_case

# Poses of each shape; `make contacts` tries 100,000.
POSES = int(os.environ.get("CONTACT_POSES", "300"))
PER_GROUND = 20
EXACT = 1e-6  # [m]
ROUND = ("ball", "capsule")
MOVES = 60
# Share of poses whose deepest contact may be shallower than coal's depth of a facet: a corner that pierced a thin ridge
# leaves by the ridge's other flank, which is nearer.
SHALLOW = 1e-3
MESH_MARGIN = 0.01  # up to which contacts with meshes are looked for [m]
# Overlaps with meshes by less than this must have a contact that says so [m]. A deeper body may be on the other side.
SHALLOW_IN_MESH = 6e-3
# Sines of the angles by which normals may leave their cones: CONE_TOLERANCE of cones.h, and of what overlaps SEAT.
CONE, SEAT = 1e-4, 0.02


MESHES = {
    "stairs": mesh_parts.stairs(4, 0.15, 0.4),
    "soup": mesh_parts.soup(mesh_parts.stairs(4, 0.15, 0.4)),
    "blocks": mesh_parts.blocks(4, 0.15, 0.4),
    "sheet": mesh_parts.sheet(1.0, 2),
    "plate": mesh_parts.box((-0.5, -0.5, -0.01), (0.5, 0.5, 0.0)),
    "box": mesh_parts.box((-0.5, -0.5, -0.15), (0.5, 0.5, 0.15)),
}


def allowed(depth: float) -> float:
    """Returns the error of a depth that is allowed [m]."""
    return max(1e-4, 0.01 * depth)


def nearest(contacts: np.ndarray) -> float:
    return float(contacts[:, 6].min(initial=np.inf))


def cases(name: str, count: int) -> Iterable[Case]:
    """Returns the first poses of a shape over random ground. They are kept for the next test, unless they are many."""
    return kept(name)[:count] if POSES <= 1000 else made(name, count)


@cache
def kept(name: str) -> list[Case]:
    return list(made(name, POSES))


def made(name: str, count: int) -> Iterator[Case]:
    for seed in range(count):
        rng = np.random.default_rng(seed)
        if seed % PER_GROUND == 0:
            ground = contact_cases.random_ground(rng)
        yield random_case(name, ground, rng)


@pytest.mark.parametrize("name", SHAPES)
def test_distances_and_depths_are_those_of_coal(name: str) -> None:
    wrong, shallow = [], 0
    for seed, case in enumerate(cases(name, POSES)):
        true, found = case.distance(case.margin + EXACT), nearest(case.contacts())
        if true > case.margin + EXACT:
            right = found > case.margin - EXACT
        elif true > EXACT:
            right = abs(found - true) <= EXACT or (true > case.margin - EXACT and found == np.inf)
        else:
            true = case.distance(EXACT, deep=True)
            right = found <= max(true, 0.0) + EXACT
            if name in ROUND:
                right = abs(found - true) <= allowed(-true)
            shallow += found > true + allowed(-true)
        if not right:
            wrong.append((seed, true, found, case.margin))
    assert not wrong, f"{len(wrong)} of {POSES}: {wrong[:10]}"
    assert shallow <= SHALLOW * POSES


@pytest.mark.parametrize("name", SHAPES)
def test_depths_in_convex_ground_are_those_of_the_solid(name: str) -> None:
    wrong, tried = [], 0
    for seed in range(POSES // 3):
        rng = np.random.default_rng(seed)
        if seed % PER_GROUND == 0:
            ground = contact_cases.convex_ground(rng)
            made = contact_cases.solid(ground)
        case = random_case(name, ground, rng)
        case = case.moved(np.array([0.0, 0.0, -rng.uniform(0.0, 0.02) * case.body.half.min()]))
        true = distance(made, IDENTITY, case.body.deep, coal.Transform3s(case.turn, case.position))
        if not -0.2 * case.body.half.min() < true < -EXACT:
            continue
        tried += 1
        found = nearest(case.contacts())
        if not abs(found - true) <= allowed(-true):
            wrong.append((seed, true, found))
    assert tried > POSES // 30
    assert not wrong, f"{len(wrong)} of {tried}: {wrong[:10]}"


@pytest.mark.parametrize("name", SHAPES)
def test_a_body_moved_out_along_its_deepest_contacts_is_apart(name: str) -> None:
    left = []
    for seed, start in enumerate(cases(name, POSES // 3)):
        case = start
        for _ in range(MOVES):
            contacts = case.contacts()
            deepest = contacts[np.argmin(contacts[:, 6])] if len(contacts) else None
            if deepest is None or deepest[6] > -EXACT:
                break
            case = case.moved(-deepest[6] * deepest[3:6])
        if case.distance(0.0, deep=True) < -1e-4:
            left.append((seed, case.distance(0.0, deep=True), nearest(case.contacts())))
    assert not left, f"{len(left)} of {POSES // 3}: {left[:10]}"


@pytest.mark.parametrize("name", SHAPES)
def test_normals_are_in_the_cones_of_the_ground(name: str) -> None:
    """No facet beside the point that is touched rises above the plane of the contact."""
    for seed, case in enumerate(cases(name, POSES // 3)):
        for contact in case.contacts():
            point, normal = contact[:3], contact[3:6]
            assert np.linalg.norm(normal) == pytest.approx(1.0, abs=1e-9)
            touched = case.ground.touching(point)
            assert len(touched) > 0 or contact[6] < 0.0  # deep points leave through a facet that they are under
            ways, sine = touched - point, CONE if contact[6] > 0.0 or name in ROUND else SEAT
            assert np.all(ways @ normal <= sine * np.linalg.norm(ways, axis=2) + 1e-9), (seed, contact)


@pytest.mark.parametrize("name", ["ball", "capsule", "box", "cylinder", "hull", "wheel"])
@pytest.mark.parametrize("form", MESHES)
def test_distances_from_meshes_are_exact_and_no_shallow_overlap_is_missed(form: str, name: str) -> None:
    vertices, corners = MESHES[form]
    mesh, facets, wrong, apart, shallow = TriangleMesh(vertices, corners), Facets(vertices[corners]), [], 0, 0
    for seed in range(120):
        rng = np.random.default_rng(seed)
        made, turn = body(name, 0.1, rng), contact_cases.random_rotation(rng)
        place = rng.dirichlet((0.5, 0.5, 0.5)) @ vertices[corners[rng.integers(len(corners))]]
        way = rng.normal(size=3)
        way *= np.sign(place @ way if form == "box" else way[2]) / np.linalg.norm(way)
        at = place + 1.5 * made.reach * way
        for _ in range(6):  # from the outside to the mesh
            at = at - way * np.clip(facets.distance(made.coal, turn, at, made.reach + 0.05), 0.0, 0.05)
        at = at - way * rng.uniform(-MESH_MARGIN, 0.5 * SHALLOW_IN_MESH)
        found = nearest(contacts_of(made.core, mesh, turn, at, MESH_MARGIN))
        true = facets.distance(made.coal, turn, at, made.reach + 0.05)
        if true > EXACT:
            apart += 1
            right = abs(found - true) <= EXACT or min(true, found) > MESH_MARGIN - EXACT
        else:
            true = facets.distance(made.deep, turn, at, made.reach)
            shallow += true > -SHALLOW_IN_MESH
            right = not -SHALLOW_IN_MESH < true < -1e-4 or found < 0.0
        if not right:
            wrong.append((seed, true, found))
    assert not wrong
    assert apart > 10 and shallow > 5


@pytest.mark.parametrize(
    ("third", "side", "high", "y"),
    [
        *((third, side, 4, 0.4) for third in ((0.2, 0.2, 0.0), (0.1, 0.0, 0.0)) for side in (1.0, -1.0)),
        ((0.0, 0.0, 0.3), 1.0, slice(None), 0.45),  # its rim across a ridge, between two of the samples
    ],
    ids=["flat", "flat, turned", "line", "line, turned", "upright"],
)
def test_hulls_without_volume_touch_spikes_from_either_side_and_ridges_with_their_rims(
    third: tuple[float, ...], side: float, high: int | slice, y: float
) -> None:
    heights = np.zeros((9, 9))
    heights[high, 4] = 0.1
    shape = BodyShape.hull(np.array([(-0.2, 0.0, 0.0), (0.2, -third[1], 0.0), third]), 0.0)
    ground, turn = HeightMap(heights, resolution=0.1), np.diag([1.0, side, side])
    assert nearest(contacts_of(shape, ground, turn, (0.4, y, 0.11), 0.02)) == pytest.approx(0.01, abs=1e-6)
