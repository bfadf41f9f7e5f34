"""Cameras have the bodies in sight, beside the panel and above the ground."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from smartmesh_ros.tools.client.ground import Ground
from smartmesh_ros.tools.view.camera import CLOSEST, FAR, Camera, Lens, camera_on
from tests.examples import examples
from tests.tools.view.test_drawn_ground import ground_of

PLACES = st.tuples(st.floats(-30, 30), st.floats(-30, 30), st.floats(-3, 3))
BODIES = st.lists(st.tuples(PLACES, st.floats(0.05, 2.0)), min_size=1, max_size=12)
LENSES = st.builds(Lens, st.floats(0.5, 1.4), st.floats(0.5, 3.0), st.floats(0.0, 0.4))


def places_in(camera: Camera, points: np.ndarray, lens: Lens) -> np.ndarray:
    """Coordinates of points (n, 3) [m] in a picture (n, 2), right and up: 0 in the middle, -1 and 1 at the edges.
    Points behind the camera are far outside."""
    forward = np.subtract(camera.target, camera.position)
    right = np.cross(forward, (0.0, 0.0, 1.0))
    axes = np.stack([axis / np.linalg.norm(axis) for axis in (right, np.cross(right, forward), forward)])
    across, above, ahead = axes @ (points - np.asarray(camera.position)).T
    depth = np.maximum(ahead, 1e-6) * math.tan(0.5 * lens.field_of_view)
    return np.stack([across / (lens.aspect * depth), above / depth], axis=1)


@given(bodies=BODIES, lens=LENSES)
@examples(100)
def test_all_bodies_are_in_the_picture_beside_the_panel(
    bodies: list[tuple[tuple[float, float, float], float]], lens: Lens
) -> None:
    positions, radii = np.array([place for place, _ in bodies]), np.array([radius for _, radius in bodies])
    camera = camera_on(positions, radii, lens, Ground())
    away = np.linalg.norm(positions - np.median(positions, axis=0), axis=1)
    near = away <= FAR * max(float(np.median(away)), CLOSEST)
    places = places_in(camera, positions[near], lens)
    assert (np.abs(places) < 1.0).all()
    assert (places[:, 0] < 1.0 - 2.0 * lens.covered).all()


def test_the_camera_is_as_near_as_the_bodies_allow_but_one_that_is_lost_far_below() -> None:
    """From half the distance some of them would be out of the picture."""
    positions = np.random.default_rng(1).uniform(-10, 10, (20, 3)) * (1.0, 1.0, 0.0)
    lens = Lens(math.radians(75.0), 1.6, 0.25)
    camera = camera_on(np.append(positions, [[0.0, 0.0, -5000.0]], axis=0), np.full(21, 0.3), lens, Ground())
    assert math.dist(camera.position, camera.target) < 50.0
    nearer = camera._replace(position=tuple(0.5 * (np.array(camera.position) + camera.target)))
    places = places_in(nearer, positions, lens)
    assert (np.abs(places[:, 1]) > 1.0).any() or (places[:, 0] > 0.5).any() or (places[:, 0] < -1.0).any()


@pytest.mark.parametrize("depth", [0.0, 3.0, 20.0])
def test_the_ground_does_not_hide_a_body_in_a_pit(depth: float) -> None:
    x = np.arange(-20.0, 20.1, 0.5)
    far = np.hypot(*np.meshgrid(x, x))
    ground = ground_of(np.where(far < 3.0, -depth, 0.0), resolution=0.5, origin=(-20.0, -20.0, 0.0))
    body = np.array([0.0, 0.0, 0.3 - depth])
    camera = camera_on(body[None], np.array([0.3]), Lens(1.3, 1.5), ground)
    line = np.asarray(camera.position) + np.linspace(0.0, 1.0, 50)[:, None] * (body - camera.position)
    heights = ground.heights(line[:, :2])
    assert not (line[:-1, 2] < heights[:-1] - 0.3).any()
