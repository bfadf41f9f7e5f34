"""Driven surfaces of links and bodies: commands, sleep, snapshots, settings, and what is refused."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pybullet as pb
import pytest

from smartmesh_ros import BodyState, Box, Ground, InputError, JointCommand, Sphere
from smartmesh_ros.ground.config import SleepConfig
from smartmesh_ros.ground.followers import Belt
from smartmesh_ros.ground.shapes import Shape
from smartmesh_ros.world.robots.prepared import prepare_robot
from tests import urdfs
from tests.bodies import about_y, put, run
from tests.grounds import add, level, shaped, world_of
from tests.tracked import NAME, UNDERCARRIAGE, drive, standing

BLOCK = urdfs.robot(urdfs.link("box", urdfs.box((0.4, 0.3, 0.2)), 1.0, (0.4, 0.3, 0.2)))


@pytest.mark.parametrize(("body", "link"), [(Box(0.4, 0.3, 0.2), ""), (BLOCK, "box")], ids=["body", "robot"])
@pytest.mark.parametrize("degrees", [7.0, 27.0, 30.0, 33.0, 40.0])
def test_a_driven_surface_pulls_no_more_than_friction_allows(degrees: float, body: Shape | str, link: str) -> None:
    """Up a slope that is too steep, a box slides down by the law of Coulomb, as fast as its surface may run."""
    friction, gravity, angle, time, speed_ = 0.5, 9.81, math.radians(degrees), 2.0, 1.0
    up = np.array([math.cos(angle), 0.0, math.sin(angle)])
    start = BodyState((-0.1 * math.sin(angle), 0.0, 0.1 * math.cos(angle)), about_y(-angle))
    with world_of(shaped(lambda x, y: math.tan(angle) * x, 121, 0.25), friction=friction, sleep=False) as world:
        add(world, "box", body, start)
        world.drive_surface("box", link, speed_, axis=(0.0, 1.0, 0.0))
        world.step(round(time * 240))
        way = float((np.array(world.state("box").position) - start.position) @ up)
    slides = gravity * (math.sin(angle) - friction * math.cos(angle))
    gains = speed_ / -slides if slides < 0.0 else math.inf  # time until it runs as fast as its surface [s]
    law = -0.5 * slides * time**2 if gains > time else speed_ * (time - 0.5 * gains)
    assert way == pytest.approx(law, rel=0.01, abs=0.02)


def test_a_command_beyond_the_limit_drives_at_the_limit_about_the_axis_of_the_frame_of_the_link() -> None:
    """Whose inertia has another frame."""
    turned = UNDERCARRIAGE.replace('<mass value="200"/>', '<origin rpy="0.3 0.2 1.2"/><mass value="200"/>')
    with standing(level(201), turned) as world:
        drive(world, 9.0, 9.0)
        world.step(600)
        assert world.state(NAME).linear[0] == pytest.approx(1.5, rel=0.01)
        told = [(found.name, found.speed, found.limit) for found in world.surfaces(NAME)]
        assert told == [("left_track", 1.5, 1.5), ("right_track", 1.5, 1.5)]


def test_what_has_no_surface_on_the_ground_is_refused() -> None:
    with standing(level(201)) as world:
        world.track("hand", 0.2, BodyState((5.0, 0.0, 0.2)))
        for name, link, speed_, axis, words in (
            ("nobody", "", 1.0, (0.0, 1.0, 0.0), "no body"),
            ("hand", "", 1.0, (0.0, 1.0, 0.0), "not simulated"),
            (NAME, "wheel", 1.0, (0.0, 1.0, 0.0), "'left_track_link'"),
            (NAME, "left_track_link", 1e9, (0.0, 1.0, 0.0), "finite"),
            (NAME, "left_track_link", 1.0, (0.0, math.inf, 0.0), "zero"),
        ):
            with pytest.raises(InputError, match=words):
                world.drive_surface(name, link, speed_, axis)
        for fields in ({"position": 1.0}, {"effort": 1.0}, {"velocity": 1.0, "effort": 1.0}, {}):
            with pytest.raises(InputError, match="velocity alone"):
                world.command(NAME, "left_track", JointCommand(**fields))
        with pytest.raises(InputError, match="left_track, right_track"):
            world.drive(NAME, "middle_track", 1.0)
        world.spawn("ball", Sphere(0.2), 1.0, BodyState((6.0, 0.0, 0.2)))
        with pytest.raises(InputError, match="attach"):
            world.ground.drive(world.bodies["ball"].uid, 3, (0.0, 1.0, 0.0), 1.0)


DRIVE = '<surface_drive name="left_track" link="left_track_link"><axis xyz="0 1 0"/><limit velocity="1.5"/>'


@pytest.mark.parametrize(
    ("instead", "words"),
    [
        (DRIVE.replace(' name="left_track"', ""), "no name"),
        (DRIVE.replace("left_track", "right_track", 1), "name of another"),
        (DRIVE.replace("left_track", "slew", 1), "of a joint"),
        (DRIVE.replace("left_track_link", "wheel"), "'wheel', which does not exist"),
        (DRIVE.replace("left_track_link", "right_track_link"), "one surface"),
        (DRIVE.replace("0 1 0", "0 1e-200 0"), "axis .* zero"),
        (DRIVE.replace("0 1 0", "0 1e200 0"), "no length"),
        (DRIVE.replace('<axis xyz="0 1 0"/>', ""), "0 elements <axis>"),
        (DRIVE.replace('<limit velocity="1.5"/>', ""), "0 elements <limit>"),
        (DRIVE.replace("1.5", "fast"), "a number"),
        (DRIVE.replace("1.5", "0"), "above zero"),
        (DRIVE.replace("1.5", "-1"), "above zero"),
        (DRIVE.replace("left_track_link", "bare"), "touches nothing"),
    ],
)
def test_a_description_whose_surface_cannot_be_driven_is_refused(instead: str, words: str) -> None:
    assert DRIVE in UNDERCARRIAGE
    bare = '<link name="bare"/><joint name="j" type="fixed"><parent link="house"/><child link="bare"/></joint></robot>'
    with pytest.raises(InputError, match=words):
        prepare_robot(UNDERCARRIAGE.replace(DRIVE, instead).replace("</robot>", bare))


@pytest.fixture
def ground(client: Any) -> Ground:
    """The ground of a PyBullet world of one's own, to which a box of 2 kg is attached."""
    put(client, Box(0.4, 0.4, 0.2), (0.0, 0.0, 0.1), 2.0)
    made = Ground(client, level(201))
    made.attach(0)
    return made


def speed_after(ground: Ground, client: Any, steps: int) -> float:
    run(ground, steps)
    return float(client.getBaseVelocity(0)[0][0])


@pytest.mark.parametrize("renamed", ["left_track_link", "slew"])
def test_a_robot_whose_file_lost_a_link_or_joint_is_not_restored(tmp_path: Path, renamed: str) -> None:
    urdf = UNDERCARRIAGE.replace(
        '<joint name="slew" type="fixed">',
        '<joint name="slew" type="revolute"><limit lower="-1" upper="1" effort="1e4" velocity="1"/>',
    )
    file = tmp_path / "robot.urdf"
    file.write_text(urdf)
    with standing(level(201), str(file)) as world:
        drive(world, 0.5, 0.5)
        world.step(24)
        saved, before = world.snapshot(), world.state(NAME)
        file.write_text(urdf.replace(renamed, "other"))
        with pytest.raises(InputError, match=f"has no (link|joint) '{renamed}'"):
            world.restore(saved)
        assert world.state(NAME) == before
        world.step(240)
        assert world.state(NAME).linear[0] == pytest.approx(0.5, rel=0.02)


def test_in_a_pybullet_world_of_ones_own(ground: Ground, client: Any) -> None:
    ground.drive(0, -1, np.array([0.0, 1.0, 0.0]), np.float32(0.25))  # type: ignore[arg-type]
    assert ground.followers.at(0, -1).belt == Belt((0.0, 1.0, 0.0), 0.25)  # type: ignore[union-attr]
    assert speed_after(ground, client, 240) == pytest.approx(0.25, rel=0.01)
    ground.detach(0)
    ground.attach(0)
    assert speed_after(ground, client, 240) == pytest.approx(0.0, abs=1e-3), "it is attached anew"


@pytest.mark.parametrize(("rise", "speed_"), [(1.5, 0.25), (2.0, 0.0)])
def test_a_face_runs_at_the_speed_of_the_surface_unless_it_is_one_of_its_sides(
    ground: Ground, client: Any, rise: float, speed_: float
) -> None:
    """A side is a face whose normal is within 30 degrees of the axis."""
    ground.drive(0, -1, (0.0, 1.0, rise), 0.25)
    assert speed_after(ground, client, 240) == pytest.approx(speed_, rel=0.01, abs=1e-4)


@pytest.mark.parametrize("by_pybullet", [False, True])
def test_commands_wake_what_sleeps_and_what_creeps_stays_awake(ground: Ground, client: Any, by_pybullet: bool) -> None:
    """Also below the 2 mm/s at which others count as still."""
    if by_pybullet:
        client.changeDynamics(0, -1, activationState=pb.ACTIVATION_STATE_ENABLE_SLEEPING)
    else:
        ground.let_sleep(SleepConfig())
    speed_after(ground, client, 1200)
    for speed_ in (0.0, 0.3, 1.95e-3, 0.0):
        before = ground.is_asleep(0)
        ground.drive(0, -1, (0.0, 1.0, 0.0), speed_)
        assert speed_ or ground.is_asleep(0) == before, "nothing changed"
        assert speed_after(ground, client, 960) == pytest.approx(speed_, rel=0.01)
        assert by_pybullet or ground.is_asleep(0) == (speed_ == 0.0)
