"""Driven surfaces: a tracked machine drives, climbs, slips and turns as Coulomb's friction at its contacts says."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import pytest

from smartmesh_ros import (
    BodyState,
    Box,
    HeightMap,
    InputError,
    PatchConfig,
    PhysicsConfig,
    Snapshot,
    Sphere,
    World,
    WorldConfig,
)
from smartmesh_ros.patches.config import PatchKind
from smartmesh_ros.scenes.tracks import ground as ramp
from smartmesh_ros.scenes.tracks import robot_file
from smartmesh_ros.soil.bodies import BulletBodies
from smartmesh_ros.soil.soil import Soil
from smartmesh_ros.terrain.grid import GridGeometry
from smartmesh_ros.world.joints import JointCommand
from smartmesh_ros.world.robots.prepared import prepare_robot

GRAVITY, NAME = 9.81, "machine"
GAUGE = 1.0  # of the undercarriage [m]
LEVEL = GridGeometry(rows=201, columns=201, resolution=0.1, origin=(-10.0, -10.0, 0.0))
UNDERCARRIAGE = robot_file().read_text()
# A chassis of 60 kg and two boxes of 20 kg as tracks, all of whose corners carry the load.
BOXES = """<robot name="boxes"><link name="base"><inertial><mass value="60"/>
<inertia ixx="3" iyy="5" izz="7" ixy="0" ixz="0" iyz="0"/></inertial></link>
{}{}</robot>"""
SIDE = """<link name="{name}"><inertial><mass value="20"/>
<inertia ixx="0.2" iyy="1.2" izz="1.2" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><geometry><box size="1.2 0.2 0.3"/></geometry></collision></link>
<joint name="{name}_joint" type="fixed"><parent link="base"/><child link="{name}"/><origin xyz="0 {y} -0.1"/></joint>
<surface_drive name="{name}_track" link="{name}"><axis xyz="0 1 0"/><limit velocity="2"/></surface_drive>"""
FLAT_TRACKS = BOXES.format(SIDE.format(name="left", y=0.4), SIDE.format(name="right", y=-0.4))
STANDING = 120  # steps until a machine stands


def slope(degrees: float = 0.0, friction: float = 1.0) -> HeightMap:
    """Ground that rises along x."""
    x = 0.1 * np.arange(201) - 10.0
    return HeightMap(np.tile(math.tan(math.radians(degrees)) * x, (201, 1)), geometry=LEVEL, friction=friction)


def standing(ground: HeightMap, urdf: str = UNDERCARRIAGE, *, sleep: bool = False, friction: float = 1.0) -> World:
    world = World(ground, WorldConfig(physics=PhysicsConfig(friction=friction, sleep=sleep)))
    world.spawn_robot(NAME, urdf, BodyState((0.0, 0.0, 0.0)), on_ground=True, align=True)
    world.step(STANDING)
    return world


def drive(world: World, left: float, right: float) -> None:
    world.drive(NAME, "left_track", left)
    world.drive(NAME, "right_track", right)


def speed(world: World) -> float:
    """Velocity along x and uphill [m/s]."""
    x, _, z = world.state(NAME).linear
    return math.copysign(math.hypot(x, z), x)


def yaw(world: World) -> float:
    x, y, z, w = world.state(NAME).orientation
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


@pytest.mark.parametrize("urdf", [UNDERCARRIAGE, FLAT_TRACKS])
@pytest.mark.parametrize("commanded", [0.5, -1.2])
def test_it_drives_straight_at_the_speed_of_its_tracks(urdf: str, commanded: float) -> None:
    with standing(slope(), urdf) as world:
        drive(world, commanded, commanded)
        world.step(120)
        before = world.state(NAME).position
        world.step(480)
        after = world.state(NAME).position
        assert after[0] - before[0] == pytest.approx(2.0 * commanded, rel=0.01)
        assert (after[1], yaw(world)) == pytest.approx((0.0, 0.0), abs=1e-3)
        drive(world, 0.0, 0.0)
        world.step(480)  # it rocks on the middles of its tracks for one or two seconds
        assert world.state(NAME).linear == pytest.approx((0.0, 0.0, 0.0), abs=1e-3)


def test_a_command_beyond_the_limit_drives_at_the_limit() -> None:
    with standing(slope()) as world:
        drive(world, 9.0, 9.0)
        world.step(600)
        assert speed(world) == pytest.approx(1.5, rel=0.01)
        assert [(s.name, s.speed, s.limit) for s in world.surfaces(NAME)] == [
            ("left_track", 1.5, 1.5),
            ("right_track", 1.5, 1.5),
        ]


def test_on_ground_that_moves_back_as_fast_it_stays_in_place() -> None:
    with standing(slope()) as world:
        drive(world, 0.5, 0.5)
        start = world.time
        for step in range(720):
            if step % 4 == 0:
                moved = 0.5 * (world.time - start)
                geometry = GridGeometry(rows=201, columns=201, resolution=0.1, origin=(-10.0 - moved, -10.0, 0.0))
                world.terrain.put("", HeightMap(np.zeros((201, 201)), geometry=geometry, time=world.time))
            world.step()
            if step == 240:
                before = world.state(NAME).position[0]
        assert world.state(NAME).position[0] == pytest.approx(before, abs=0.02)


def test_on_ground_that_rises_and_sinks_it_keeps_its_speed() -> None:
    with standing(slope()) as world:
        drive(world, 0.5, 0.5)
        ground = world.terrain.tiles[""]
        assert isinstance(ground, HeightMap)
        for step in range(480):
            if step % 4 == 0:
                ground.replace(np.full((201, 201), 0.1 * math.sin(3.0 * world.time)), time=world.time)
            world.step()
            if step >= 120:
                assert world.state(NAME).linear[0] == pytest.approx(0.5, rel=0.02)


@pytest.mark.parametrize("urdf", [UNDERCARRIAGE, FLAT_TRACKS])
def test_it_climbs_20_degrees_with_enough_friction(urdf: str) -> None:
    with standing(slope(20.0), urdf) as world:
        drive(world, 0.5, 0.5)
        world.step(240)
        before = world.state(NAME).position[2]
        world.step(480)
        assert speed(world) == pytest.approx(0.5, rel=0.01)
        assert world.state(NAME).position[2] - before == pytest.approx(math.sin(math.radians(20.0)), rel=0.01)


def test_on_soil_it_climbs_20_degrees_and_leaves_ruts() -> None:
    with World(ramp()) as world:
        soil = Soil(world.terrain, "lete_sand", BulletBodies(world.client, world))
        world.spawn_robot(NAME, UNDERCARRIAGE, BodyState((5.3, 0.0, 0.0)), on_ground=True, align=True)
        for step in range(720):
            if step == 120:
                drive(world, 0.5, 0.5)
            if step == 360:
                before = world.state(NAME).position
            world.step()
            soil.apply(world.contacts(), world.dt, world.time)
        x, _, z = np.array(world.state(NAME).position) - before
        assert 0.8 * 0.75 < math.hypot(x, z) < 0.75, "slower than its tracks"
        assert math.degrees(math.atan2(z, x)) == pytest.approx(20.0, abs=1.0)
        assert 0.003 < soil.sinkage().max() < 0.05


@pytest.mark.parametrize("driven", [0.0, 0.5])
def test_it_slides_down_where_friction_is_less_than_the_slope(driven: float) -> None:
    """The tracks slip all the time, so that their speed does not matter."""
    mu, angle = 0.3, math.radians(20.0)
    with standing(slope(20.0), FLAT_TRACKS, friction=mu) as world:
        drive(world, driven, driven)
        before = speed(world)
        world.step(240)
        expected = -GRAVITY * (math.sin(angle) - mu * math.cos(angle))
        assert speed(world) - before == pytest.approx(expected, rel=0.02)


def test_on_ice_it_starts_as_fast_as_friction_allows() -> None:
    with standing(slope(friction=0.05), FLAT_TRACKS) as world:
        drive(world, 1.0, 1.0)
        world.step(120)
        assert speed(world) == pytest.approx(0.05 * GRAVITY * 0.5, rel=0.02)
        drive(world, -1.0, -1.0)
        world.step(120)
        assert speed(world) == pytest.approx(0.0, abs=0.01)


def composite() -> tuple[np.ndarray, np.ndarray]:
    """Inertia of the machine of boxes about its centre of mass [kg m^2], and its contacts (8, 3) from there [m]."""
    centre = np.array([0.0, 0.0, -0.04])
    inertia = np.zeros((3, 3))
    for mass, moments, at in (
        (60.0, (3.0, 5.0, 7.0), (0.0, 0.0, 0.0)),
        (20.0, (0.2, 1.2, 1.2), (0.0, 0.4, -0.1)),
        (20.0, (0.2, 1.2, 1.2), (0.0, -0.4, -0.1)),
    ):
        lever = np.array(at) - centre
        inertia += np.diag(moments) + mass * (lever @ lever * np.eye(3) - np.outer(lever, lever))
    corners = [(x, y, -0.25) for y in (-0.5, -0.3, 0.3, 0.5) for x in (-0.6, 0.6)]
    return inertia, np.array(corners) - centre


def equilibrium(heading: float, belt: float, *, isotropic: bool) -> float:
    """Rate [rad/s] at which the moments of friction balance, while the tracks run at -belt and +belt [m/s].

    Friction of equally loaded contacts is opposed to the slip; in PyBullet's solver for multibodies to the slip times
    the mass that each axis of the world meets at the contact.
    """
    cos, sin = math.cos(heading), math.sin(heading)
    turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    inertia, contacts = composite()
    levers, inverse = contacts @ turn.T, np.linalg.inv(turn @ inertia @ turn.T)
    along = np.where(contacts[:, 1:2] < 0.0, belt, -belt) * turn[:, 0]
    arms = np.cross(levers[:, None], np.eye(3)[None, :2])  # (8, 2, 3)
    masses = 1.0 / (1.0 / 100.0 + np.einsum("kai,ij,kaj->ka", arms, inverse, arms))

    def moment(rate: float) -> float:
        slip = np.cross([0.0, 0.0, rate], levers)[:, :2] - along[:, :2]
        force = -slip * (1.0 if isotropic else masses)
        force /= np.linalg.norm(force, axis=1, keepdims=True)
        return float((levers[:, 0] * force[:, 1] - levers[:, 1] * force[:, 0]).sum())

    low, high = 0.0, 2.0
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if moment(middle) > 0.0 else (low, middle)
    return low


@pytest.mark.parametrize(("belt", "friction"), [(0.4, 1.0), (0.2, 1.0), (0.4, 0.3)])
def test_flat_tracks_turn_at_the_equilibrium_of_friction(belt: float, friction: float) -> None:
    """At each heading as the solver's friction says. The equilibrium changes while the machine turns, and the rate lags
    behind it by its inertia: by a share of v^2 / mu, 1 % at 0.4 m/s and mu 1."""
    with standing(slope(), FLAT_TRACKS, friction=friction) as world:
        drive(world, -belt, belt)
        world.step(60)
        for _ in range(24):
            world.step(60)
            expected = equilibrium(yaw(world), belt, isotropic=False)
            assert world.state(NAME).angular[2] == pytest.approx(expected, rel=0.08 * belt**2 / friction)


def test_isotropic_friction_of_four_corners_has_a_closed_form() -> None:
    """For thin tracks of length L and gauge g the rate is 2 v / g / (1 + (L / g)^2), which the page tells."""
    assert equilibrium(0.3, 0.4, isotropic=True) == pytest.approx(1.0 / (1.0 + 1.5**2), rel=0.02)


def test_the_undercarriage_turns_on_the_spot_as_without_slip() -> None:
    """Its load is on the middles of its tracks. Over all headings."""
    with standing(slope()) as world:
        drive(world, -0.4, 0.4)
        world.step(120)
        start = np.array(world.state(NAME).position)
        for _ in range(32):
            world.step(60)
            assert world.state(NAME).angular[2] == pytest.approx(2.0 * 0.4 / GAUGE, rel=0.1)
        np.testing.assert_allclose(world.state(NAME).position, start, atol=0.02)


def test_one_faster_track_makes_a_curve() -> None:
    with standing(slope()) as world:
        drive(world, 0.3, 0.5)
        world.step(360)
        for _ in range(8):
            world.step(60)
            assert world.state(NAME).angular[2] == pytest.approx(0.2 / GAUGE, rel=0.1)
            assert math.hypot(*world.state(NAME).linear[:2]) == pytest.approx(0.4, rel=0.02)


def test_any_body_can_creep_on_its_surface() -> None:
    with World(slope()) as world:
        world.spawn("box", Box(0.4, 0.4, 0.2), 2.0, BodyState((0.0, 0.0, 0.1)))
        world.step(24)
        world.drive_surface("box", "", 0.3, axis=(-2.0, 0.0, 0.0))
        world.step(480)
        assert world.state("box").linear == pytest.approx((0.0, 0.3, 0.0), abs=3e-3)
        assert world.surfaces("box") == []


def test_the_axis_is_one_of_the_frame_of_the_link() -> None:
    """Whose inertia has another frame."""
    turned = UNDERCARRIAGE.replace('<mass value="200"/>', '<origin rpy="0.3 0.2 1.2"/><mass value="200"/>')
    with standing(slope(), turned) as world:
        drive(world, 0.5, 0.5)
        world.step(240)
        assert speed(world) == pytest.approx(0.5, rel=0.01)


def test_it_sleeps_only_while_its_tracks_stand_still() -> None:
    with standing(slope(), sleep=True) as world:
        world.step(480)
        assert world.is_asleep(NAME)
        drive(world, 0.0, 0.0)
        world.step()
        assert world.is_asleep(NAME), "nothing changed"
        drive(world, 0.5, 0.5)
        world.step(240)
        assert speed(world) == pytest.approx(0.5, rel=0.01)
        drive(world, 0.0, 0.0)
        world.step(720)
        assert world.is_asleep(NAME)


def test_at_a_wall_it_stays_on_the_ground_and_awake() -> None:
    """Each contact runs along its own ground: up at the wall, forward below."""
    heights = np.zeros((201, 201))
    heights[:, 109:] = 1.5
    with standing(HeightMap(heights, geometry=LEVEL), FLAT_TRACKS, sleep=True, friction=0.2) as world:
        before = world.state(NAME).position[2]
        drive(world, 0.3, 0.3)
        for _ in range(96):
            world.step(10)
            assert world.state(NAME).position[2] == pytest.approx(before, abs=5e-3)
        assert 0.15 < world.state(NAME).position[0] < 0.3 and not world.is_asleep(NAME)


def test_at_the_foot_of_a_slope_its_rear_stays_on_the_level() -> None:
    heights = np.tile(np.clip(0.1 * np.arange(201) - 11.0, 0.0, None) * math.tan(math.radians(20.0)), (201, 1))
    with standing(HeightMap(heights, geometry=LEVEL), FLAT_TRACKS) as world:
        drive(world, 0.5, 0.5)
        for _ in range(480):
            world.step()
            rear = min(contact.position[0] for contact in world.contacts())
            assert rear - world.state(NAME).position[0] < -0.5
        assert world.state(NAME).position[0] > 0.9


def test_contacts_are_where_the_surface_touches_the_ground() -> None:
    with standing(slope(), FLAT_TRACKS) as world:
        drive(world, 1.5, 1.5)
        world.step(120)
        x, y, _ = world.state(NAME).position
        places = sorted((contact.position[0] - x, contact.position[1] - y) for contact in world.contacts())
        corners = [(end, side) for end in (-0.6, 0.6) for side in (-0.5, -0.3, 0.3, 0.5)]
        np.testing.assert_allclose(sorted(places), corners, atol=1.5 * 2.0 / 240.0)


@pytest.fixture
def driven() -> Iterator[World]:
    with standing(slope()) as world:
        drive(world, 0.3, 0.5)
        world.step(60)
        yield world


def test_commands_stay_after_a_reset(driven: World) -> None:
    driven.reset_bodies()
    driven.step(240)
    assert math.hypot(*driven.state(NAME).linear) == pytest.approx(0.4, rel=0.02)


def test_a_restored_world_goes_on_as_the_saved_one_to_the_bit(driven: World) -> None:
    driven.spawn("box", Box(0.4, 0.4, 0.2), 2.0, BodyState((3.0, 0.0, 0.1)))
    driven.drive_surface("box", "", 0.3)
    saved = driven.save()
    driven.step(120)
    with World(slope()) as other:
        other.restore(Snapshot.from_json(saved.to_json()))
        assert [s.speed for s in other.surfaces(NAME)] == [0.3, 0.5]
        other.step(120)
        assert other.snapshot().to_json() == driven.snapshot().to_json()


def test_a_change_of_settings_keeps_the_tracks_running(driven: World) -> None:
    """Also one to colliders of PyBullet's own and back; on these the tracks stand still."""
    steps: list[tuple[PatchKind, float]] = [("auto", 0.4), ("heightfield", 0.0), ("auto", 0.4)]
    for kind, expected in steps:
        config = WorldConfig(physics=driven.config.physics, patch=PatchConfig(kind=kind))
        driven.configure(config)
        driven.step(600)
        assert math.hypot(*driven.state(NAME).linear) == pytest.approx(expected, abs=0.02), kind


def test_another_body_in_the_slot_of_a_removed_one_stands_still(driven: World) -> None:
    driven.remove(NAME)
    driven.spawn_robot(NAME, UNDERCARRIAGE, BodyState((0.0, 0.0, 0.0)), on_ground=True)
    driven.step(120)
    assert driven.state(NAME).linear == pytest.approx((0.0, 0.0, 0.0), abs=1e-3)


def test_where_contacts_are_pybullets_own_a_command_is_refused() -> None:
    with World(slope(), WorldConfig(patch=PatchConfig(kind="heightfield"))) as world:
        world.spawn_robot(NAME, UNDERCARRIAGE, BodyState((0.0, 0.0, 0.0)), on_ground=True)
        with pytest.raises(InputError, match="choose 'auto'"):
            drive(world, 0.5, 0.5)
        assert [s.speed for s in world.surfaces(NAME)] == [0.0, 0.0]


@pytest.mark.parametrize(
    ("command", "words"),
    [
        (JointCommand(position=1.0), "velocity alone"),
        (JointCommand(effort=1.0), "velocity alone"),
        (JointCommand(velocity=1.0, effort=1.0), "velocity alone"),
        (JointCommand(), "velocity alone"),
    ],
)
def test_a_track_takes_a_velocity_alone(driven: World, command: JointCommand, words: str) -> None:
    with pytest.raises(InputError, match=words):
        driven.command(NAME, "left_track", command)
    assert [s.speed for s in driven.surfaces(NAME)] == [0.3, 0.5]


def test_what_has_no_surface_on_the_ground_is_refused(driven: World) -> None:
    driven.track("hand", 0.2, BodyState((5.0, 0.0, 0.2)))
    for name, link, speed_, axis, words in (
        ("nobody", "", 1.0, (0.0, 1.0, 0.0), "no body"),
        ("hand", "", 1.0, (0.0, 1.0, 0.0), "not simulated"),
        (NAME, "wheel", 1.0, (0.0, 1.0, 0.0), "'left_track_link'"),
        (NAME, "left_track_link", math.nan, (0.0, 1.0, 0.0), "finite"),
        (NAME, "left_track_link", 1e9, (0.0, 1.0, 0.0), "finite"),
        (NAME, "left_track_link", 1.0, (0.0, 0.0, 0.0), "zero"),
        (NAME, "left_track_link", 1.0, (0.0, math.inf, 0.0), "zero"),
    ):
        with pytest.raises(InputError, match=words):
            driven.drive_surface(name, link, speed_, axis)
    with pytest.raises(InputError, match="left_track, right_track"):
        driven.drive(NAME, "middle_track", 1.0)
    driven.spawn("ball", Sphere(0.2), 1.0, BodyState((6.0, 0.0, 0.2)))
    with pytest.raises(InputError, match="attach"):
        driven.ground.drive(driven.bodies["ball"].uid, 3, (0.0, 1.0, 0.0), 1.0)


DRIVE = '<surface_drive name="left_track" link="left_track_link"><axis xyz="0 1 0"/><limit velocity="1.5"/>'


@pytest.mark.parametrize(
    ("instead", "words"),
    [
        (DRIVE.replace(' name="left_track"', ""), "no name"),
        (DRIVE.replace("left_track", "right_track", 1), "name of another"),
        (DRIVE.replace("left_track", "slew", 1), "of a joint"),
        (DRIVE.replace("left_track_link", "wheel"), "'wheel', which does not exist"),
        (DRIVE.replace("left_track_link", "right_track_link"), "one surface"),
        (DRIVE.replace("0 1 0", "0 0 0"), "axis .* zero"),
        (DRIVE.replace("0 1 0", "0 1"), "3 numbers"),
        (DRIVE.replace("0 1 0", "0 1 nan"), "finite"),
        (DRIVE.replace('<axis xyz="0 1 0"/>', ""), "0 elements <axis>"),
        (DRIVE.replace('<limit velocity="1.5"/>', ""), "0 elements <limit>"),
        (DRIVE.replace("1.5", "fast"), "a number"),
        (DRIVE.replace("1.5", "0"), "above zero"),
        (DRIVE.replace("1.5", "-1"), "above zero"),
    ],
)
def test_a_description_whose_surface_cannot_be_driven_is_refused(instead: str, words: str) -> None:
    assert DRIVE in UNDERCARRIAGE
    with pytest.raises(InputError, match=words):
        prepare_robot(UNDERCARRIAGE.replace(DRIVE, instead))


def test_a_link_without_a_shape_has_no_surface() -> None:
    bare = '<link name="bare"/><joint name="j" type="fixed"><parent link="house"/><child link="bare"/></joint></robot>'
    moved = UNDERCARRIAGE.replace(DRIVE, DRIVE.replace("left_track_link", "bare")).replace("</robot>", bare)
    with pytest.raises(InputError, match="touches nothing"):
        prepare_robot(moved)


def test_pybullet_itself_ignores_the_element() -> None:
    with World() as world:
        uid = world.client.loadURDF(str(robot_file()))
        assert world.client.getNumJoints(uid) == 3
