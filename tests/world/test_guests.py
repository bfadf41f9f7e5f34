"""Bodies of several worlds meet as those of one do, and guests are what their owners say they are."""

import math
from itertools import pairwise

import numpy as np
import pybullet as pb
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from smartmesh_ros import BodyState, Box, Capsule, Cylinder, InputError, PhysicsConfig, Sphere
from smartmesh_ros.core import CORE
from smartmesh_ros.ground.shapes import DIMENSIONS, Shape
from smartmesh_ros.world.guest_owner import GuestOwner
from smartmesh_ros.world.settings import GuestConfig
from smartmesh_ros.world.states import SimulatedStates
from tests.bodies import random_turn, rotation
from tests.peers import RATE, Start, flat_world, peers
from tests.urdfs import ROVER

BALL = Sphere(0.2)
SMOOTH = PhysicsConfig(rate=RATE, restitution=0.97, friction=0.0)
IMPACTS = {  # speeds [m/s] and masses [kg] of two balls
    "head-on": ((2.5, 1.0), (-2.5, 1.0)),
    "against a resting ball": ((3.0, 1.0), (0.0, 1.0)),
    "heavy on light": ((3.0, 5.0), (0.0, 1.0)),
}


def ball(x: float, speed: float, mass: float = 1.0) -> Start:
    return Start(BALL, mass, x, speed, BALL.radius)


def speeds_after(starts: list[list[Start]], late: int, ahead: int = 0) -> np.ndarray:
    """Velocities of all bodies along x after a second [m/s], as their owners have them. ``ahead``: steps by which the
    first world is before the others."""
    with peers(starts, late, SMOOTH) as made:
        made.worlds[0].step(ahead)
        made.step(240)
        return np.array([made.state(f"b{index}").linear[0] for index in range(sum(map(len, starts)))])


@pytest.mark.parametrize(("late", "ahead"), [(0, 0), (1, 0), (6, 0), (0, 5)])
@pytest.mark.parametrize("impact", [*IMPACTS, "on a row of balls of four worlds"])
def test_balls_of_several_worlds_part_as_those_of_one(impact: str, late: int, ahead: int) -> None:
    """Also if a world hears of its peers' future, and they of its past, by some steps."""
    if impact in IMPACTS:
        (v, m), (w, n) = IMPACTS[impact]
        balls, off = [ball(-1.0, v, m), ball(0.8, w, n)], 0.01
    else:
        balls, off = [ball(-1.5, 2.0), *(ball(0.401 * place, 0.0) for place in range(3))], 0.025
    together = speeds_after([balls], 0)
    speed = balls[0].speed - balls[-1].speed
    assert together[-1] - together[0] > 0.9 * speed  # they have bounced off each other
    assert np.allclose(speeds_after([[one] for one in balls], late, ahead), together, atol=off * speed)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("impact", IMPACTS)
def test_worlds_that_step_at_different_instants_find_the_same_impact(impact: str, seed: int) -> None:
    """What becomes of an impact depends on where in a step it is found: momentum is kept if both find the same."""
    (v, m), (w, n) = IMPACTS[impact]
    with peers([[ball(-1.0, v, m)], [ball(0.8, w, n)]], 1, SMOOTH, seed=seed) as made:
        made.step(240)
        after = [made.state(name).linear[0] for name in ("b0", "b1")]
    assert after[1] - after[0] > 0.8 * (v - w)
    assert abs(m * after[0] + n * after[1] - m * v - n * w) < 0.01 * min(m, n) * (v - w)


@pytest.mark.parametrize("late", [0, 6])
def test_states_from_before_an_impact_do_not_undo_it(late: int) -> None:
    """A ball that is hit into another within a step meets it before that one's owner knows of the hit, and once."""
    heavy, light, elasticity = 2.0, 1.0, SMOOTH.restitution**2
    with peers([[ball(0.0, 0.0, heavy)], [ball(0.41, 0.0, light)]], late, SMOOTH) as made:
        made.step(60)
        world = made.worlds[0]
        world.client.resetBaseVelocity(world.bodies["b0"].uid, (3.0, 0.0, 0.0))
        made.step(120)
        after = made.state("b0").linear[0]
    assert after == pytest.approx(3.0 * (heavy - elasticity * light) / (heavy + light), abs=0.1)


def test_a_guest_sleeps_with_its_owners_body_and_goes_where_that_is_put_or_pushed() -> None:
    box = Box(0.4, 0.4, 0.4)
    with peers([[Start(box, 1.0, 0.0, 0.0, 0.2)], [Start(box, 1.0, 1.0, 0.0, 0.2)]], 0) as made:
        made.step(480)
        owner, other = made.worlds
        assert owner.is_asleep("b0")
        for _ in range(60):
            made.step()
            assert other.is_asleep("b0")
        uid = owner.bodies["b0"].uid
        for act in (
            lambda: owner.client.resetBasePositionAndOrientation(uid, (0.0, 0.1, 0.2), (0.0, 0.0, 0.0, 1.0)),
            lambda: owner.client.resetBaseVelocity(uid, (0.0, 1.0, 0.0)),
        ):
            act()
            made.step(GuestConfig().steps_apart + 1)
            assert other.state("b0").position == pytest.approx(owner.state("b0").position, abs=1e-3)


@pytest.mark.parametrize("late", [0, 1])
@pytest.mark.parametrize("pusher", ["b0", "rover"])
def test_a_box_is_pushed_by_what_another_world_has(pusher: str, late: int) -> None:
    """By a heavy box that slides into it, until friction ends it, and by a rover at its own pace; where one world and
    two have both then."""
    first = [Start(Box(0.6, 0.6, 0.4), 20.0, -1.5, 3.0, 0.2)] if pusher == "b0" else []
    box, ends = Start(Box(0.4, 1.0, 0.4), 1.0, 0.0, 0.0, 0.2), []
    for starts, age in (([[*first, box]], 0), ([first, [box]], late)):
        with peers(starts, age, PhysicsConfig(rate=RATE, friction=0.3)) as made:
            if pusher == "rover":
                made.worlds[0].spawn_robot("rover", ROVER, BodyState((-1.5, 0.0, 0.12)))
                for wheel in made.worlds[0].bodies["rover"].joints:
                    made.worlds[0].drive("rover", wheel, 6.0)
            made.step(960 if pusher == "rover" else 240)
            ends.append([made.state(name).position[0] for name in (pusher, f"b{len(first)}")])
    assert ends[0][1] > 0.5, "it was pushed"
    assert np.allclose(ends[1], ends[0], atol=0.03)


@pytest.mark.parametrize(
    "shape",
    [
        Sphere(0.2), Box(0.3, 0.4, 0.5), Box(0.3, 0.4, 0.5, centre=(0.1, 0, 0.1)), Cylinder(radius=0.2, height=0.5),
        Capsule(radius=0.1, height=0.4),
    ],
)  # fmt: skip
def test_a_guest_is_its_owners_body(shape: Shape) -> None:
    with peers([[Start(shape, 2.5, 0.0, 0.0, 0.6)], [ball(1.2, 0.0)]], 1) as made:
        made.step(60)
        guest = made.worlds[1].bodies["b0"]
        assert (guest.shape, guest.mass, guest.owner) == (shape, 2.5, "world 0")
        there, here = made.worlds[0].state("b0"), made.worlds[1].state("b0")
        assert np.allclose(there.position, here.position, atol=5e-3)


def test_guests_are_shown_saved_and_reset_by_their_owners_only() -> None:
    with peers([[ball(0.0, 0.0)], [ball(0.5, 0.0)]], 0) as made:
        made.step(5)
        for world, own in zip(made.worlds, ("b0", "b1"), strict=True):
            assert set(world.bodies) == {"b0", "b1"}
            assert [world.followers.names[slot] for slot in world.patches().slots.tolist()] == [own]
            assert {contact.body for contact in world.contacts()} == {own}
            assert [wrench.body for wrench in world.wrenches()] == [own]
            assert [body.name for body in world.snapshot().bodies] == [own]
            assert SimulatedStates(world).read().names == [own]
            world.save()
        made.step(5)
        for world, own in zip(made.worlds, ("b0", "b1"), strict=True):
            world.reset()
            assert list(world.bodies) == [own]


def test_bodies_come_and_go_with_the_distance_and_with_their_owner() -> None:
    with peers([[ball(-6.0, 4.0)], [Start(BALL, 1.0, 0.0, 0.0, 3.0)]], 0, SMOOTH, GuestConfig(margin=2.6)) as made:
        world, near = made.worlds[1], []
        for _ in range(720):
            made.step()
            one, other = made.state("b0"), made.state("b1")
            distance = math.dist(one.position, other.position) - 2.0 * BALL.radius
            goes = 0.2 * math.dist(one.linear, other.linear)
            near.append("b0" in world.bodies)
            if distance < 2.5 + 0.9 * goes or (True in near and distance < 1.5 * 2.6 + 0.4):
                assert near[-1]
            if distance > 1.5 * 2.6 + goes + 0.1:
                assert not near[-1]
        assert sum(a != b for a, b in pairwise(near)) == 2
    with peers([[ball(0.0, 0.0)], [ball(0.5, 0.0)]], 0) as made:
        made.step(2)
        made.worlds[1].guests.forget("world 0")
        assert set(made.worlds[1].bodies) == {"b1"}
        made.worlds[1].step(5)
        made.step(2)
        made.worlds[0].remove("b0")
        made.step(2)
        assert set(made.worlds[1].bodies) == {"b1"}


def test_what_owners_say_of_impossible_bodies_is_refused_and_the_last_states_stay() -> None:
    with peers([[ball(0.0, 0.0)], [ball(0.5, 0.0)]], 0) as made:
        made.step(3)
        states, world = SimulatedStates(made.worlds[0]).read(), made.worlds[1]
        for field, value, reason in (
            ("numbers", math.nan, "non_finite"), ("numbers", 1e300, "quaternion"), ("masses", math.nan, "geometry"),
            ("radii", math.inf, "geometry"), ("dimensions", 0.0, "geometry"), ("kinds", 0, "shape"),
            ("kinds", len(DIMENSIONS), "shape"), ("kinds", 255, "shape"),
        ):  # fmt: skip
            bad = states._replace(**{field: np.full_like(getattr(states, field), value)})
            with pytest.raises(InputError) as refused:
                world.guests.take("world 0", bad, world.time)
            assert refused.value.reason == reason
        made.worlds[1].step(3)
        assert np.allclose(world.state("b0").position, (0.0, 0.0, 0.2), atol=1e-3)


def test_two_owners_of_one_name_are_named_and_neither_body_is_a_guest() -> None:
    with flat_world() as world, flat_world() as other:
        for one in (world, other):
            one.spawn("twin", BALL, 1.0, BodyState((0.0, 0.0, 0.2)))
        other.spawn("single", BALL, 1.0, BodyState((1.0, 0.0, 0.2)))
        world.spawn("mine", BALL, 1.0, BodyState((0.0, 0.8, 0.2)))
        world.step()
        states = SimulatedStates(other).read()
        [objection] = world.guests.take("/fleet/b", states, world.time)
        assert objection.reason == "two_owners"
        assert "'twin' is simulated by /fleet/b and by this node" in str(objection)
        assert world.guests.take("/fleet/b", states, world.time) == []  # said once
        [objection] = world.guests.take("/fleet/c", states._replace(names=["other", "single"]), world.time)
        assert "/fleet/c and by /fleet/b" in str(objection)
        world.step(4)
        assert {name: body.owner for name, body in world.bodies.items()} == {
            "twin": "", "mine": "", "other": "/fleet/c",
        }  # fmt: skip
        for name in ("single", "other"):
            with pytest.raises(InputError, match="simulated by /fleet"):
                world.spawn(name, BALL, 1.0) if name == "single" else world.remove(name)
        other.remove("twin")
        world.remove("twin")
        assert world.guests.take("/fleet/b", SimulatedStates(other).read(), world.time) == []
        world.guests.forget("/fleet/c")
        assert world.guests.take("/fleet/b", SimulatedStates(other).read(), world.time) == []
        world.step(4)
        assert {name: body.owner for name, body in world.bodies.items()} == {"mine": "", "single": "/fleet/b"}


def test_a_body_changes_its_owner_while_older_states_are_in_use() -> None:
    with flat_world() as world, flat_world() as other:
        other.spawn("body", BALL, 1.0, BodyState((0.0, 0.0, 0.2)))
        with_it = SimulatedStates(other).read()
        other.remove("body")
        without = SimulatedStates(other).read()
        for _ in range(5):
            world.guests.take("a", with_it, world.time)
            world.step()
        world.guests.take("a", without, world.time)  # too young to be used yet
        world.spawn("body", BALL, 1.0, BodyState((0.0, 0.0, 0.2)))
        world.step(5)
        assert world.bodies["body"].simulated
        world.remove("body")
        world.spawn("mine", BALL, 1.0, BodyState((0.0, 0.5, 0.2)))
        for _ in range(5):
            world.guests.take("a", with_it, world.time)
            world.step()
        world.guests.take("a", without, world.time)
        world.guests.take("b", with_it, world.time - 1.0)  # old enough to be used at once
        world.step()
        assert world.bodies["body"].owner == "a"
        world.step(5)
        assert world.bodies["body"].owner == "b"


@given(st.floats(-0.5, 0.5), st.lists(st.floats(-0.15, 0.15), min_size=20, max_size=20))
def test_steps_of_an_owner_that_come_half_way_between_own_ones_are_counted_one_by_one(
    phase: float, jitter: list[float]
) -> None:
    owner, config = GuestOwner(), GuestConfig()
    steps = [owner.to_own_steps(number + phase + late, config) for number, late in enumerate(jitter)]
    assert [after - before for before, after in pairwise(steps)] == [1] * 19


@given(seed=st.integers(0, 2**32 - 1), duration=st.floats(-0.2, 0.2))
@example(seed=307, duration=-0.05859375)
def test_states_move_on_at_their_velocities(seed: int, duration: float) -> None:
    rng = np.random.default_rng(seed)
    numbers = rng.normal(scale=5.0, size=(3, 13))
    numbers[:, 3:7] = [random_turn(rng) for _ in range(3)]
    moved = CORE.extrapolated(numbers, duration)
    for before, after in zip(numbers, moved, strict=True):
        assert np.allclose(after[:3], before[:3] + duration * before[7:10])
        spin = pb.getQuaternionFromAxisAngle(before[10:], duration * float(np.linalg.norm(before[10:])))
        _, turned = pb.multiplyTransforms((0.0, 0.0, 0.0), spin, (0.0, 0.0, 0.0), before[3:7])
        turned = np.array(turned) / np.linalg.norm(turned)  # PyBullet works in single precision here
        assert np.allclose(rotation(after[3:7]), rotation(turned), atol=1e-6)
        assert np.array_equal(after[7:], before[7:])
    assert np.allclose(CORE.blended(numbers, moved, 1.0)[:, :3], moved[:, :3])
    half = CORE.blended(numbers, -moved, 0.5)[:, 3:7]  # the same rotations by the other quaternion
    assert np.allclose(np.linalg.norm(half, axis=1), 1.0)


@pytest.mark.parametrize("late", [0, 1, 6])
def test_a_pile_of_four_worlds_boxes_stands(late: int) -> None:
    boxes = [Start(Box(0.4, 0.4, 0.4), 1.0, 0.02 * place, 0.0, 0.2 + 0.4 * place) for place in range(4)]
    with peers([[box] for box in boxes], late) as made:
        made.step(480)
        for place, box in enumerate(boxes):
            state = made.state(f"b{place}")
            assert np.allclose(state.position, (box.x, 0.0, box.z), atol=0.01)
            assert math.hypot(*state.linear) < 0.02
