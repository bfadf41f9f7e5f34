"""What a URDF says of its joints and inertias and PyBullet drops: as mechanics wants it, or told."""

import math
import sys
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from smartmesh_ros import BodyState, InputError, PhysicsConfig, Terrain, World, WorldConfig
from smartmesh_ros.world.joints import JointCommand, JointReading
from tests.grounds import said_by, world_of
from tests.urdfs import joint, link, robot

MOMENT, HIGH = 0.5, BodyState((0.0, 0.0, 5.0))
BASE = link("base", '<box size="1 1 1"/>', 1e6, 1e6)


def arm(more: str = "", kind: str = "continuous", moment: float = MOMENT, axis: str = "0 0 1") -> str:
    """A link that a joint turns about its centre, or pushes, on a base that does not give way."""
    return robot(BASE, link("arm", "", MOMENT, moment), joint("j", kind, "base", "arm", more, axis=axis))


def limit(velocity: float, effort: float = 1000.0, lower: float = -1e6, upper: float = 1e6) -> str:
    return f'<limit lower="{lower}" upper="{upper}" effort="{effort}" velocity="{velocity}"/>'


def weightless(rate: float = 240.0) -> World:
    """A world that tells its user nothing."""
    world = world_of(Terrain(), gravity=(0.0, 0.0, 0.0), rate=rate)
    world.say = lambda words: None
    return world


def moved(
    urdf: str, command: JointCommand, seconds: float = 1.0, speed: float = 0.0, rate: float = 240.0
) -> list[JointReading]:
    """The joint after each step, from a velocity of ``speed`` on."""
    with weightless(rate) as world:
        world.spawn_robot("r", urdf, HIGH)
        world.client.resetJointState(world.bodies["r"].uid, 0, 0.0, speed)
        world.command("r", "j", command)
        found = []
        for _ in range(round(seconds * rate)):
            world.step()
            found += world.joints("r")
        return found


@pytest.mark.parametrize("kind", ["revolute", "continuous", "prismatic"])
@pytest.mark.parametrize(
    "command", [JointCommand(position=2.0), JointCommand(position=-2.0, velocity=-9.0), JointCommand(velocity=30.0)]
)
def test_a_target_moves_a_joint_no_faster_than_its_urdf_allows(kind: str, command: JointCommand) -> None:
    found = moved(arm(limit(1.5), kind), command, 0.5)
    assert max(abs(one.velocity) for one in found) == pytest.approx(1.5, rel=1e-6)


@pytest.mark.parametrize(
    ("kind", "more", "command", "speed"),
    [
        ("continuous", "", JointCommand(velocity=30.0), 30.0),
        ("continuous", '<limit effort="100" velocity="0"/>', JointCommand(velocity=30.0), 30.0),
        ("continuous", limit(1.5), JointCommand(effort=2.0), 2.0 / MOMENT),  # the limit is one of targets
        ("prismatic", limit(1.5), JointCommand(effort=-2.0), -2.0 / MOMENT),
        ("continuous", limit(400.0), JointCommand(velocity=300.0), 300.0),  # faster than PyBullet lets it by itself
    ],
)
def test_without_a_lower_limit_a_joint_is_as_fast_as_it_is_told(
    kind: str, more: str, command: JointCommand, speed: float
) -> None:
    last = moved(arm(more, kind), command)[-1]
    assert last.velocity == pytest.approx(speed, rel=0.01)
    assert command.effort in (None, last.effort)


@pytest.mark.parametrize(
    ("command", "speed", "net"),
    [
        (JointCommand(effort=2.5), 0.0, 1.5),
        (JointCommand(effort=0.9), 0.0, 0.0),  # sticks
        (JointCommand(effort=-2.5), 4.0, -3.5),
        (JointCommand(velocity=50.0), 0.0, 4.0 - 1.0),
        (JointCommand(velocity=50.0, effort=2.0), 0.0, 2.0 - 1.0),
        (JointCommand(velocity=50.0, effort=0.5), 0.0, 0.0),  # a drive weaker than the friction
        (JointCommand(velocity=0.0), 20.0, -4.0 - 1.0),
        (JointCommand(position=500.0), 0.0, 4.0 - 1.0),
        (JointCommand(), 2.0, -1.0),  # free
        (JointCommand(), -2.0, 1.0),
        (JointCommand(), 0.5, -1.0),  # it stops by then
    ],
    ids=str,
)
def test_friction_hinders_what_drives_a_joint_and_helps_what_stops_it(
    command: JointCommand, speed: float, net: float
) -> None:
    found = moved(arm(limit(1e3, effort=4.0) + '<dynamics friction="1.0"/>'), command, 0.5, speed)[-1].velocity
    change = 0.5 * net / MOMENT
    if command == JointCommand():
        change = -math.copysign(min(abs(change), abs(speed)), speed)
    assert found - speed == pytest.approx(change, rel=0.01, abs=0.01)


@settings(max_examples=30)
@given(st.floats(-3.0, 4.0), st.floats(-4.0, 1.0), st.sampled_from([60.0, 240.0, 1000.0]))
@example(1.0, -4.0, 1000.0)  # slows down to -2e-323
def test_damping_never_diverges_and_is_exact_where_steps_bear_it(
    log_damping: float, log_moment: float, rate: float
) -> None:
    damping, moment = 10.0**log_damping, 10.0**log_moment
    urdf = arm(f'<dynamics damping="{damping}"/>', moment=moment)
    found = [one.velocity for one in moved(urdf, JointCommand(), 0.2, 1.0, rate)]
    found = [0.0 if abs(velocity) < sys.float_info.min else velocity for velocity in found]
    assert all(0.0 <= after <= before for before, after in zip([1.0, *found], found, strict=False))
    if damping / moment < 0.02 * rate:
        assert found[-1] == pytest.approx(math.exp(-damping / moment * 0.2), abs=0.01)


def test_a_chain_of_light_damped_links_slows_down_at_any_rate() -> None:
    """All joints parallel, so that each one's damping acts on its neighbours."""
    count = 8
    names = ["base", *(f"l{k}" for k in range(count))]
    damped = '<dynamics damping="2.0"/>'
    parts = [link(name, "", 0.1, 1e-4, at="0.1 0 0") for name in names[1:]]
    parts += [joint(f"j{k}", "continuous", names[k], names[k + 1], damped, xyz="0.2 0 0") for k in range(count)]
    with weightless() as world:
        said = said_by(world)
        world.spawn_robot("r", robot(link("base", '<box size="1 1 1"/>', 5.0, 1.0), *parts), HIGH)
        assert "less damping than given" in str(said)
        for rate in (1000.0, 100.0):
            world.configure(WorldConfig(physics=PhysicsConfig(gravity=(0.0, 0.0, 0.0), rate=rate)))
            for k, index in enumerate(world.bodies["r"].joints.values()):
                world.client.resetJointState(world.bodies["r"].uid, index, 0.3 * k, (-1.0) ** k)
            squares = []
            for _ in range(round(rate)):
                world.step()
                squares.append(sum(reading.velocity**2 for reading in world.joints("r")))
            assert max(squares) < 2.0 * count
            assert squares[-1] < 0.5 * squares[0]


@pytest.mark.parametrize("kind", ["continuous", "prismatic"])
def test_an_axis_of_any_length_is_a_direction(kind: str) -> None:
    with weightless() as world:
        world.spawn_robot("r", arm(limit(9.0), kind, axis="0 0 -3"), HIGH)
        world.command("r", "j", JointCommand(velocity=1.0))
        world.step(60)
        linear, angular = world.client.getLinkState(world.bodies["r"].uid, 0, computeLinkVelocity=1)[6:8]
        assert (angular if kind == "continuous" else linear) == pytest.approx((0.0, 0.0, -1.0), abs=1e-4)


@pytest.mark.parametrize(
    ("moments", "told"),
    [
        ((0.1, 0.1, 0.1), False), ((0.1, 0.1, 0.2), False), ((0.1, 0.1, 0.20001), False), ((0.1, 0.1, 1.0), True),
        ((0.0, 0.0, 0.0), True), ((-0.1, 0.1, 0.1), True), ((0.0, 0.0, 0.3), True),
    ],
)  # fmt: skip
@pytest.mark.parametrize("turned", [False, True])
def test_every_link_has_moments_of_a_real_body(moments: tuple[float, float, float], told: bool, turned: bool) -> None:
    """PyBullet replaces others by zero: a root is nowhere, a joint is locked. The largest moment stays."""
    turn, _ = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))
    full = turn @ np.diag(moments) @ turn.T if turned else np.diag(moments)
    terms = zip(("ixx", "iyy", "izz", "ixy", "ixz", "iyz"), full[(0, 1, 2, 0, 0, 1), (0, 1, 2, 1, 2, 2)], strict=True)
    inertia = "<inertia " + " ".join(f'{key}="{value}"' for key, value in terms) + "/>"
    made = f'<link name="{{}}"><inertial><mass value="2"/>{inertia}</inertial>{{}}</link>'
    ball = '<collision><geometry><sphere radius="0.1"/></geometry></collision>'
    with weightless() as world:
        said = said_by(world)
        world.spawn_robot(
            "r", robot(made.format("base", ball), made.format("tip", ""), joint("j", "continuous", "base", "tip")), HIGH
        )
        world.command("r", "j", JointCommand(effort=1e-4))
        world.step(10)
        assert world.joints("r")[0].velocity > 0.0
        assert np.isfinite(world.state("r").position).all()
        for index in (-1, 0):
            low, middle, high = sorted(world.client.getDynamicsInfo(world.bodies["r"].uid, index)[2])
            assert low >= 0.0 and high <= low + middle
            assert high == pytest.approx(max(moments), rel=1e-6) or not any(moments)
        assert any("base, tip" in words for words in said) == told


def test_a_joint_whose_limits_exclude_zero_starts_at_the_nearest_and_so_does_what_mimics_it() -> None:
    mimic = limit(1.0) + '<mimic joint="j" multiplier="-2" offset="0.5"/>'
    urdf = robot(
        BASE, link("arm", "", 1.0, 1.0), link("up", "", 1.0, 1.0), link("down", "", 1.0, 1.0),
        joint("j", "revolute", "base", "arm", limit(1.0, lower=0.4, upper=2.0)),
        joint("m", "revolute", "base", "up", mimic),
        joint("k", "prismatic", "base", "down", limit(1.0, lower=-0.9, upper=-0.7)),
    )  # fmt: skip
    with weightless() as world:
        world.spawn_robot("r", urdf, HIGH)
        world.step(10)
        found = {reading.name: reading.position for reading in world.joints("r")}
        assert found == pytest.approx({"j": 0.4, "m": -0.3, "k": -0.7}, abs=1e-3)


IGNORED = {
    "<gazebo> mu1 of wheel": '<gazebo reference="wheel"><mu1>0.2</mu1><material>Grey</material></gazebo>',
    "<gazebo> selfCollide of the robot": "<gazebo><selfCollide>true</selfCollide><gravity>true</gravity></gazebo>",
    "<safety_controller> of j": '<safety_controller k_velocity="10"/>',
    "<limit> (lower above upper) of j": limit(1.0, lower=1.0, upper=-1.0),
    "<limit> (no lower and upper) of j": '<limit effort="1" velocity="1"/>',
    "<contact_coefficients> of wheel": (
        '<collision><contact_coefficients mu="0.1"/><geometry><sphere radius="0.1"/></geometry></collision>'
    ),
    "<contact> contact_cfm of wheel": '<contact><contact_cfm value="0.1"/></contact>',
}  # fmt: skip


@pytest.mark.parametrize("words", IGNORED)
def test_what_has_no_effect_is_told(words: str) -> None:
    element = IGNORED[words]
    of_joint, of_link = (element if words.endswith(end) else "" for end in (" j", " wheel"))
    of_joint = of_joint if "<limit" in of_joint else limit(1.0) + of_joint
    of_link, whole = ("", element) if element.startswith("<gazebo") else (of_link, "")
    urdf = robot(BASE, link("wheel", "", more=of_link), joint("j", "revolute", "base", "wheel", of_joint), whole)
    with weightless() as world:
        said = said_by(world)
        world.spawn_robot("r", urdf, HIGH)
    assert said == [f"robot 'r': without effect: {words}"]


TRACK = '<surface_drive name="track" link="base"><axis xyz="0 1 0"/><limit velocity="1.5"/></surface_drive>'


def test_a_velocity_lasts_its_time_unless_it_is_renewed_and_positions_and_efforts_last() -> None:
    with weightless() as world:
        said = said_by(world)
        world.spawn_robot("r", arm(limit(9.0)).replace("</robot>", f"{TRACK}</robot>"), HIGH)
        for _ in range(4):  # renewed
            for name in ("j", "track"):
                world.command("r", name, JointCommand(velocity=1.0), 0.5)
            world.step(96)
        wrong: tuple[Any, ...] = (math.nan, -1.0, "long")
        for lasts in wrong:  # a command that is refused leaves the one before in force
            with pytest.raises(InputError, match="duration of a command"):
                world.command("r", "j", JointCommand(velocity=2.0), lasts)
        world.reset_time()  # changes nothing of it
        world.step(22)
        assert (world.joints("r")[0].velocity, world.surfaces("r")[0].speed) == pytest.approx((1.0, 1.0))
        copy = world.snapshot()
        for _ in range(2):  # the second is a copy of the world as it was
            world.step(4)
            assert (world.joints("r")[0].velocity, world.surfaces("r")[0].speed) == pytest.approx((0.0, 0.0), abs=1e-9)
            assert said.pop() == "no command came for j, track of 'r' in time: stopped"
            world.restore(copy)
        for command in (JointCommand(position=3.0), JointCommand(effort=0.5), JointCommand()):
            world.command("r", "j", JointCommand(velocity=1.0), 0.5)
            world.command("r", "j", command, 0.5)
            world.command("r", "track", JointCommand(velocity=0.0), 0.5)
            world.step(150)
            assert world.bodies["r"].commands["j"] == command
        world.command("r", "j", JointCommand(velocity=1.0), 0.5)
        world.remove("r")
        world.step(150)
        assert not said
