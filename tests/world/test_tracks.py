"""A tracked machine drives, climbs and turns as Coulomb's friction at its contacts says; up slopes:
test_surface_drives.py; its slip on soil: tests/soil/test_plates_and_carts.py."""

import math

import numpy as np
import pytest

from smartmesh_ros import BodyState, HeightMap
from studies.soil.rut_pictures import ramp
from tests.bodies import rate_of_turn
from tests.grounds import level, on_soil, shaped
from tests.tracked import FLAT_TRACKS, NAME, UNDERCARRIAGE, drive, standing


def test_on_ground_that_moves_back_as_fast_it_stays_in_place() -> None:
    ground = level(201)
    ground.slide((-0.5, 0.0), 100.0)
    with standing(ground) as world:
        drive(world, 0.5, 0.5)
        world.step(240)
        before = world.state(NAME).position[0]
        world.step(480)
        assert world.state(NAME).position[0] == pytest.approx(before, abs=0.02)


@pytest.mark.parametrize(("kind", "size"), [("step", 0.05), ("step", 0.1), ("trench", 0.2), ("trench", 0.5)])
def test_it_climbs_steps_and_crosses_trenches(kind: str, size: float) -> None:
    x = 0.02 * np.arange(251) - 1.5
    heights = np.where(x > 1.0, size, 0.0) if kind == "step" else np.where((x > 1.0) & (x < 1.0 + size), -1.0, 0.0)
    ground = HeightMap(np.tile(heights, (121, 1)), resolution=0.02, origin=(-1.5, -1.2))
    with standing(ground, friction=0.5) as world:
        height = world.state(NAME).position[2]  # of its centre of mass above level ground
        drive(world, 0.5, 0.5)
        world.step(5 * 240)
        x, y, z = world.state(NAME).position
        assert x == pytest.approx(2.5, rel=0.1)
        assert z - float(world.ground.at([(x, y)], world.time).z[0]) == pytest.approx(height, abs=2e-3)


def test_on_soil_it_climbs_20_degrees_and_leaves_ruts() -> None:
    with on_soil(ramp(), "lete_sand") as world:
        world.spawn_robot(NAME, UNDERCARRIAGE, BodyState((5.3, 0.0, 0.0)), on_ground=True, align=True)
        for step in range(720):
            if step == 120:
                drive(world, 0.5, 0.5)
            if step == 360:
                before = world.state(NAME).position
            world.step()
        x, _, z = np.array(world.state(NAME).position) - before
        assert 0.8 * 0.75 < math.hypot(x, z) < 0.75, "slower than its tracks"
        assert math.degrees(math.atan2(z, x)) == pytest.approx(20.0, abs=1.0)
        assert 0.003 < world.ground.soil.sinkage().max() < 0.05


@pytest.mark.parametrize(("belt", "friction"), [(0.4, 1.0), (0.2, 1.0), (0.4, 0.3)])
def test_flat_tracks_turn_at_the_equilibrium_of_friction(belt: float, friction: float) -> None:
    """At all headings alike."""
    corners = np.array([(x, y) for y in (-0.5, -0.3, 0.3, 0.5) for x in (-0.6, 0.6)])
    expected = rate_of_turn(corners, -np.sign(corners[:, 1]) * belt, np.ones(8))
    with standing(level(201), FLAT_TRACKS, friction=friction) as world:
        drive(world, -belt, belt)
        world.step(60)
        for _ in range(24):
            world.step(60)
            assert world.state(NAME).angular[2] == pytest.approx(expected, rel=1e-4)


def test_at_the_foot_of_a_slope_its_rear_stays_on_the_level() -> None:
    rising = shaped(lambda x, y: np.clip(x - 1.0, 0.0, None) * math.tan(math.radians(20.0)), 201)
    with standing(rising, FLAT_TRACKS) as world:
        drive(world, 0.5, 0.5)
        for _ in range(480):
            world.step()
            rear = min(contact.position[0] for contact in world.contacts())
            assert rear - world.state(NAME).position[0] < -0.5
        assert world.state(NAME).position[0] > 0.9
