"""Bodies and robots spawned on the ground: how far above it, how tilted, how fast, and where they are refused."""

import math
from itertools import product
from pathlib import Path

import numpy as np
import pybullet_data
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from smartmesh_ros import BodyState, Box, Capsule, Cylinder, HeightMap, InputError, JointCommand, Sphere, Terrain, World
from smartmesh_ros.ground.shapes import Shape
from smartmesh_ros.world.states import SimulatedStates
from tests import urdfs
from tests.bodies import about_z, reach, rotation, surface_of
from tests.grounds import shaped

DATA = Path(pybullet_data.getDataPath())
ROBOTS = (
    "husky/husky.urdf", "racecar/racecar.urdf", "r2d2.urdf", "quadruped/minitaur.urdf", "quadruped/spirit40.urdf",
    "duck_vhacd.urdf", "teddy_vhacd.urdf",
)  # fmt: skip
SHAPES = [Sphere(0.3), Box(0.6, 0.4, 0.2), Cylinder(radius=0.25, height=0.5), Capsule(radius=0.15, height=0.4)]
# Distance between the samples in which a lowest point is found [m], or more.
FOUND = 2e-4
RISE = 0.4  # of a slope along x
UP = np.array([-RISE, 0.0, 1.0]) / math.hypot(RISE, 1.0)  # from it


def hills(amplitude: float = 0.3) -> HeightMap:
    return shaped(lambda x, y: amplitude * np.sin(0.7 * x) * np.cos(0.6 * y), 161)


def slope() -> HeightMap:
    return shaped(lambda x, y: RISE * x, 161)


@settings(max_examples=25, deadline=None)
@given(
    shape=st.sampled_from(SHAPES), x=st.floats(-6.0, 6.0), y=st.floats(-6.0, 6.0),
    turn=st.tuples(*[st.floats(-1.0, 1.0)] * 4).filter(lambda q: math.hypot(*q) > 0.1),
    clearance=st.sampled_from([0.0, 0.05]),
)  # fmt: skip
def test_the_lowest_point_has_the_clearance(
    shape: Shape, x: float, y: float, turn: tuple[float, float, float, float], clearance: float
) -> None:
    """On hills, to within what lies between points of the body, and on a slope, exactly."""
    a, b, c, d = (value / math.hypot(*turn) for value in turn)
    start = BodyState((x, y, 55.0), (a, b, c, d))
    with World(hills()) as world:
        world.spawn("body", shape, 1.0, start, on_ground=True, clearance=clearance)
        state = world.state("body")
        points = surface_of(shape) @ rotation(np.array(state.orientation)).T + state.position
        gaps = points[:, 2] - world.ground_at(points[:, :2]).z
    assert state.position[:2] == pytest.approx((x, y), abs=1e-9)
    assert clearance - FOUND <= gaps.min() <= clearance + 3e-3  # the points are up to 3 cm apart
    with World(slope()) as world:
        world.spawn("body", shape, 1.0, start, on_ground=True, clearance=clearance)
        distance = reach(shape, UP @ rotation(np.array(start.orientation))) + clearance * UP[2]
        assert world.state("body").position @ UP == pytest.approx(distance, abs=FOUND)


@pytest.mark.parametrize("robot", ROBOTS)
def test_robots_rest_where_they_were_put(robot: str) -> None:
    with World(hills(0.2)) as world:
        for name, place in (("one", (0.3, 0.2)), ("other", (-2.1, 1.7))):
            state = BodyState((*place, 0.0), about_z(0.7))
            world.spawn_robot(name, str(DATA / robot), state, on_ground=True, align=True)
            for joint in world.bodies[name].joints:
                world.command(name, joint, JointCommand(position=0.0))
        put = [world.state(name).position for name in world.bodies]
        world.step(480)
        assert [world.state(name).position for name in world.bodies] == [pytest.approx(it, abs=5e-3) for it in put]
        assert world.rescues == 0


def test_alignment_follows_the_slope_and_keeps_the_heading() -> None:
    with World(slope()) as world:
        heading = BodyState(orientation=about_z(0.6))
        world.spawn("box", Box(0.6, 0.4, 0.2), 1.0, heading, on_ground=True, align=True)
        state = world.state("box")
    axes = rotation(np.array(state.orientation))
    np.testing.assert_allclose(axes[:, 2], UP, atol=1e-3)
    assert math.atan2(axes[1, 0], axes[0, 0]) == pytest.approx(0.6, abs=0.1)
    assert state.position @ UP == pytest.approx(0.1, abs=FOUND)


def test_a_robot_on_legs_as_thin_as_wires_stands_on_them() -> None:
    """Which are between all samples of its underside."""
    parts, wire = [urdfs.link("base", urdfs.box((0.6, 0.4, 0.1)))], '<cylinder radius="0.001" length="0.4"/>'
    for number, (x, y) in enumerate(product((0.211, -0.211), (0.137, -0.137))):
        leg = urdfs.joint(f"joint{number}", "fixed", "base", f"leg{number}", xyz=f"{x} {y} -0.15")
        parts += [urdfs.link(f"leg{number}", wire), leg]
    with World(hills(0.0)) as world:
        world.spawn_robot("table", urdfs.robot(*parts), BodyState(), on_ground=True)
        assert world.base_state("table").position[2] == pytest.approx(0.35, abs=FOUND)


def test_it_moves_with_the_ground() -> None:
    heightmap = HeightMap(np.zeros((50, 50)), resolution=0.1)
    for number in range(1, 5):
        heightmap.replace(np.full((50, 50), 0.02 * number), time=number / 60.0)
    heightmap.slide((0.5, 0.0), 1.0)
    with World(heightmap) as world:
        world.time = 4 / 60.0
        world.spawn("ball", Sphere(0.2), 1.0, BodyState((2.5, 2.5, 0.0), linear=(0.0, 0.3, 0.0)), on_ground=True)
        assert world.state("ball").linear == pytest.approx((0.5, 0.3, 1.2), abs=1e-3)
        before = world.state("ball").position[2]
        world.reset_bodies()
        assert world.state("ball").position[2] == pytest.approx(before)


@pytest.mark.parametrize(
    ("place", "words"),
    [
        ((4.0, 4.0), "no ground at"), ((7.9, 2.0), "no ground at"), ((50.0, 0.0), "beside the map"),
        (None, "there is no terrain yet; ask again after the first map"),  # as of a question about the ground
    ],
)  # fmt: skip
def test_over_holes_beside_the_map_and_without_one_it_is_refused(place: tuple[float, float] | None, words: str) -> None:
    heights = np.zeros((81, 81))
    heights[38:42, 38:42] = np.nan
    ground = Terrain() if place is None else HeightMap(heights, resolution=0.1)
    state = BodyState((*(place or (0.0, 0.0)), 1.0))
    with World(ground) as world:
        for spawn in (
            lambda: world.spawn("body", Box(0.6, 0.6, 0.6), 1.0, state, on_ground=True),
            lambda: world.spawn_robot("body", urdfs.ROVER, state, on_ground=True, align=True),
        ):
            with pytest.raises(InputError, match=words) as caught:
                spawn()
            assert (caught.value.reason == "no_map") == (place is None)
        assert not world.bodies and not world.client.getNumBodies()
        if place is not None:
            with pytest.raises(InputError, match="clearance"):
                world.spawn("body", Sphere(0.1), 1.0, BodyState((2.0, 2.0, 0.0)), on_ground=True, clearance=-1.0)
            world.spawn("body", Sphere(0.1), 1.0, BodyState((2.0, 2.0, 0.0)), on_ground=True)


@pytest.mark.parametrize("on_ground", [False, True])
def test_a_robot_is_turned_as_its_root_link_is_whatever_its_axes_of_inertia(on_ground: bool) -> None:
    """At the start, in a reset, where it is moved and in place of another; its box is, too. Its saved state is the same
    to the last bit."""
    slab = urdfs.robot(urdfs.link("slab", urdfs.box((0.6, 0.4, 0.1)), 2.0, (0.6, 0.4, 0.1), at="0.1 0 0.05"))
    askew = slab.replace("<inertial><origin", '<inertial><origin rpy="0.3 0.9 1.2"')
    heading = about_z(0.7)
    with World(hills(0.0)) as world:
        for name, urdf in (("slab", slab), ("askew", askew)):
            world.spawn_robot(name, urdf, BodyState((0.0, 0.0, 0.05), heading), on_ground=on_ground)
        put = world.base_state("slab")
        assert world.base_state("askew").orientation == pytest.approx(heading, abs=1e-9)
        assert world.base_state("askew").position == pytest.approx(put.position, abs=1e-6)
        slab_body, askew_body = world.bodies["slab"], world.bodies["askew"]
        assert askew_body.outline.dimensions == pytest.approx(slab_body.outline.dimensions, abs=1e-6)
        for _ in range(2):
            assert SimulatedStates(world).read().numbers[:, 3:7] == pytest.approx(np.array([heading] * 2), abs=1e-9)
            assert world.state("askew").orientation == pytest.approx(heading, abs=1e-9)
            world.move("askew", world.state("askew"))
        world.reset()
        assert world.base_state("askew").orientation == pytest.approx(heading, abs=1e-9)
        saved = world.snapshot()
        world.restore(saved)
        assert world.snapshot() == saved
        for urdf in (slab, askew):
            world.replace_robot("slab", urdf)
            for _ in range(2):
                assert world.base_state("slab").position == pytest.approx(put.position, abs=1e-9)
                assert world.base_state("slab").orientation == pytest.approx(heading, abs=1e-9)
                world.reset()
