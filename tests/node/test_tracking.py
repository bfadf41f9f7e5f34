"""Velocities of tracked bodies, estimated from their poses, and time-outs by arrival. Without ROS."""

import math
from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from smartmesh_ros import HeightMap, World
from smartmesh_ros.ground.shapes import Box
from smartmesh_ros.ground.state import BodyState
from smartmesh_ros.node.inputs.tracking import Tracking

FACE = 0.85  # of the box, along x [m]
RADIUS = 0.4


@pytest.fixture
def world() -> Iterator[World]:
    with World(HeightMap(np.zeros((41, 41)), resolution=0.5, origin=(-10.0, -10.0))) as made:
        yield made


def pose(x: float, y: float = 0.0, yaw: float = 0.0) -> BodyState:
    return BodyState((x, y, RADIUS), (0.0, 0.0, math.sin(0.5 * yaw), math.cos(0.5 * yaw)))


def run(world: World, tracking: Tracking, states: list[BodyState], rate: float) -> float:
    """Tracks a rover through the states at a rate [Hz]; the fastest that the box was [m/s]."""
    world.spawn("box", Box(0.3, 0.6, 0.6), 5.0, BodyState((FACE + 0.15, 0.0, 0.3)))
    world.step(60)
    fastest = 0.0
    for number, state in enumerate(states):
        tracking.update("rover", RADIUS, state, number / rate)
        for _ in range(round(240 / rate)):
            world.step()
            fastest = max(fastest, math.hypot(*world.state("box").linear))
    return fastest


@pytest.mark.parametrize("rate", [5.0, 10.0, 50.0, 100.0])
@pytest.mark.parametrize("jump", [0.05, 0.2, 0.3])
def test_a_jump_of_a_pose_pushes_nothing_that_the_body_does_not_touch(world: World, rate: float, jump: float) -> None:
    """As by a loop closure, there and back: velocities of up to 30 m/s."""
    n = round(rate)
    states = [*[pose(0.0)] * n, *[pose(jump)] * n, *[pose(0.0)] * n, *[pose(jump, yaw=3.0)] * n]
    assert run(world, Tracking(world, 60.0), states, rate) < 0.01


def test_a_body_that_drives_pushes_with_its_velocity(world: World) -> None:
    states = [pose(0.01 * k) for k in range(100)]
    run(world, Tracking(world, 60.0), states, 48.0)
    assert world.state("box").linear[0] == pytest.approx(0.48, abs=0.05)
    assert world.state("rover").linear == pytest.approx((0.48, 0.0, 0.0))


@given(st.floats(0.1, 5.0), st.floats(-1.0, 1.0), st.floats(-math.pi, math.pi), st.floats(5.0, 60.0))
def test_steady_motion_keeps_its_velocity(speed: float, spin: float, course: float, rate: float) -> None:
    """On a circle, from whichever direction."""
    with World(HeightMap(np.zeros((3, 3)), resolution=50.0, origin=(-50.0, -50.0))) as world:
        tracking = Tracking(world, 60.0)
        x = y = 0.0
        for number in range(6):
            yaw = course + spin * number / rate
            tracking.update("rover", 0.2, pose(x, y, yaw), number / rate)
            x += speed * math.cos(yaw) / rate
            y += speed * math.sin(yaw) / rate
        state = world.state("rover")
        assert math.hypot(*state.linear) == pytest.approx(speed, rel=0.03)
        assert state.angular[2] == pytest.approx(spin, abs=1e-6)


def test_a_jump_while_driving_leaves_the_velocity(world: World) -> None:
    tracking = Tracking(world, 60.0, max_velocity=10.0)
    for number in range(10):
        jump = tracking.update("rover", RADIUS, pose(0.05 * number + 0.3 * (number > 5)), 0.1 * number)
        assert jump == ""
        assert number == 0 or world.state("rover").linear == pytest.approx((0.5, 0.0, 0.0))


def test_changes_that_are_too_fast_give_no_velocity_and_are_said(world: World) -> None:
    tracking = Tracking(world, 60.0, max_velocity=2.0)
    tracking.update("rover", RADIUS, pose(0.0), 0.0)
    for number in range(1, 5):
        said = tracking.update("rover", RADIUS, pose(0.3 * number), 0.1 * number)
        assert "'rover' jumped by 0.3 m" in said and "bodies.max_velocity = 2" in said
        assert world.state("rover").linear == (0.0, 0.0, 0.0)
    tracking.max_velocity = 5.0
    assert tracking.update("rover", RADIUS, pose(1.5), 0.5) == ""
    # A body that spins in place moves at its surface.
    assert "jumped by 0 m" in tracking.update("rover", RADIUS, pose(1.5, yaw=3.0), 0.6)


def test_a_source_that_states_velocities_is_believed_when_it_states_none(world: World) -> None:
    tracking = Tracking(world, 60.0)
    for number in range(4):
        tracking.update("stands", 0.2, pose(0.5 * number), 0.5 * number, stated=True)
        assert world.state("stands").linear == (0.0, 0.0, 0.0)
    tracking.update("stops", 0.2, BodyState((3.0, 3.0, 0.2), linear=(1.0, 0.0, 0.0)), 0.0)
    tracking.update("stops", 0.2, BodyState((3.1, 3.0, 0.2)), 0.1)
    assert world.state("stops").linear == (0.0, 0.0, 0.0)


@given(late=st.floats(0.0, 1e9), rate=st.floats(2.5, 60.0))
def test_a_body_that_is_heard_of_neither_stops_nor_goes_however_old_its_poses_are(late: float, rate: float) -> None:
    with World() as world:
        tracking = Tracking(world, timeout=0.5)
        for number in range(20):
            heard = 1e9 + number / rate
            state = BodyState((number / rate, 0.0, 0.2), linear=(1.0, 0.0, 0.0))
            tracking.update("rover", 0.2, state, heard - late, heard)
            assert tracking.expire(heard + 0.99 / rate) == []
            assert world.state("rover").linear == (1.0, 0.0, 0.0)
        assert tracking.expire(heard + 0.51) == ["rover"]
