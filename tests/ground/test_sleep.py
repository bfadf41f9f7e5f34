"""Bodies that sleep have no collider and cost nothing, and end where they would have ended awake."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pybullet as pb
import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule, run_state_machine_as_test

from smartmesh_ros import BodyState, Box, Cylinder, HeightMap, Sphere, Terrain, World, WorldConfig
from smartmesh_ros.ground.config import PhysicsConfig, SleepConfig
from smartmesh_ros.ground.ground import Ground
from smartmesh_ros.patches.supports import Support
from smartmesh_ros.terrain.motion import MotionConfig
from smartmesh_ros.world.joints import JointCommand
from studies.matrix.arena import HUSKY
from tests.examples import examples

SIDE, SPACING, RATE = 61, 0.1, 240
FLAT = np.zeros((SIDE, SIDE), np.float32)
BOX = Box(0.2, 0.2, 0.2)


def flat_world(**settings: Any) -> World:
    ground = HeightMap(FLAT, resolution=SPACING, origin=(-3.0, -3.0))
    return World(ground, WorldConfig(physics=PhysicsConfig(**settings)))


def asleep(world: World) -> set[str]:
    """Names of the sleeping bodies and links."""
    return {world.followers[slot].name for slot in world.followers.asleep.tolist()}


def test_bodies_at_rest_sleep_without_colliders_and_keep_patches_contacts_and_wrenches() -> None:
    with flat_world() as world:
        world.spawn("ball", Sphere(0.1), 2.0, BodyState((-1.0, 0.0, 0.1)))
        world.spawn("box", BOX, 3.0, BodyState((0.0, 0.0, 0.1)))
        world.spawn("can", Cylinder(0.1, 0.2), 4.0, BodyState((1.0, 0.0, 0.1)))
        world.step(60)
        assert not asleep(world)
        awake = {batch.kind: len(batch.bodies) for batch in world.shown_batches()}
        touching = {contact.body for contact in world.contacts()}
        world.step(RATE)
        assert asleep(world) == {"ball", "box", "can"}
        assert all(follower.collider is None for follower in world.followers)
        assert {batch.kind: len(batch.bodies) for batch in world.shown_batches()} == awake
        assert {contact.body for contact in world.contacts()} == touching == {"ball", "box", "can"}
        for wrench, mass in zip(world.wrenches(), (2.0, 3.0, 4.0), strict=True):
            assert wrench.force == pytest.approx([0.0, 0.0, 9.81 * mass], abs=0.02 * 9.81 * mass)
        world.step()
        assert world.client.getContactPoints() == (), "nothing is collided with the ground"
        world.wake("box")
        world.step()
        assert asleep(world) == {"ball", "can"}
        assert world.state("box").position == pytest.approx((0.0, 0.0, 0.1), abs=1e-4)


def test_without_the_setting_none_sleeps() -> None:
    with flat_world(sleep=False) as world:
        world.spawn("box", BOX, 1.0, BodyState((0.0, 0.0, 0.1)))
        world.step(3 * RATE)
        assert not asleep(world)
        world.configure(WorldConfig(physics=PhysicsConfig(sleep=True)))
        world.step(RATE)
        assert asleep(world) == {"box"}
        world.configure(WorldConfig(physics=PhysicsConfig(sleep=False)))
        world.step()
        assert not asleep(world)
        assert world.state("box").position == pytest.approx((0.0, 0.0, 0.1), abs=1e-4)


def test_a_body_falls_asleep_only_with_all_that_it_may_touch() -> None:
    """A box beside one that spins in place stays awake, one apart from both sleeps."""
    with flat_world(friction=0.0) as world:
        world.spawn("spins", Cylinder(0.1, 0.2), 1.0, BodyState((0.0, 0.0, 0.1), angular=(0.0, 0.0, 2.0)))
        world.spawn("beside", BOX, 1.0, BodyState((0.204, 0.0, 0.1)))
        world.spawn("apart", BOX, 1.0, BodyState((1.0, 0.0, 0.1)))
        world.step(2 * RATE)
        assert asleep(world) == {"apart"}


def test_bodies_side_by_side_do_not_wake_one_another() -> None:
    """Their bounding spheres overlap, their boxes do not touch: once asleep they stay so."""
    with flat_world() as world:
        for index in range(4):
            world.spawn(f"box_{index}", Box(0.4, 0.4, 0.1), 1.0, BodyState((0.43 * index, 0.0, 0.06 + 0.05 * index)))
        world.step(2 * RATE)
        assert len(asleep(world)) == 4
        for _ in range(RATE):
            world.step()
            assert len(asleep(world)) == 4


@pytest.mark.parametrize("moved", [1e-4, 3e-4])
def test_small_changes_of_the_ground_add_up(moved: float) -> None:
    """A change below the limit wakes none; many of them do, once they exceed it."""
    limit = SleepConfig().ground
    ground = HeightMap(FLAT, resolution=SPACING, origin=(-3.0, -3.0), motion=MotionConfig(max_interval=0.1))
    with World(ground) as world:
        world.spawn("box", BOX, 1.0, BodyState((0.0, 0.0, 0.1)))
        world.step(RATE)
        assert asleep(world) == {"box"}
        for count in range(1, 20):
            ground.replace(FLAT + np.float32(count * moved), time=world.time)
            world.step(4)
            if not asleep(world):
                break
            assert count * moved <= limit
            world.step(60)
        assert count == math.floor(limit / moved + 1e-6) + 1


def test_what_is_changed_elsewhere_wakes_none() -> None:
    ground = HeightMap(FLAT, resolution=SPACING, origin=(-3.0, -3.0))
    with World(ground) as world:
        world.spawn("box", BOX, 1.0, BodyState((0.0, 0.0, 0.1)))
        world.step(RATE)
        for step in range(240):
            if step % 4 == 0:
                ground.update_region(0, 0, FLAT[:20, :20] + np.float32(0.1 * math.sin(step)), time=world.time)
            if step % 4 == 2:
                ground.replace(ground.heights, time=world.time)
            world.step()
            assert asleep(world) == {"box"}


def test_a_correction_moves_a_body_once_however_often_it_sleeps() -> None:
    """A body that was woken by a correction and sleeps again stays where it is when it is woken for another reason."""
    motion = MotionConfig(changes="correction")
    ground = HeightMap(FLAT, resolution=SPACING, origin=(-3.0, -3.0), motion=motion)
    with World(ground) as world:
        world.spawn("box", BOX, 1.0, BodyState((0.0, 0.0, 0.1)))
        world.step(RATE)
        ground.replace(FLAT + np.float32(0.0002), time=world.time)  # too small to wake it, and moved with in the next
        world.step(60)
        assert asleep(world) == {"box"}
        ground.replace(FLAT + np.float32(0.05), time=world.time)
        world.step(2 * RATE)
        assert asleep(world) == {"box"}
        world.wake("box")
        heights = [world.state("box").position[2] for _ in range(60) if world.step() is None]
        assert max(heights) < 0.1505
        assert min(heights) > 0.1495


def test_a_body_moved_through_pybullet_is_noticed_within_a_second() -> None:
    with flat_world() as world:
        for index in range(20):
            world.spawn(f"box_{index}", BOX, 1.0, BodyState((0.5 * (index % 5) - 1.0, 0.5 * (index // 5), 0.1)))
        world.step(RATE)
        assert len(asleep(world)) == 20
        world.client.resetBasePositionAndOrientation(world.bodies["box_13"].uid, (2.0, 0.0, 0.5), (0.0, 0.0, 0.0, 1.0))
        for _ in range(RATE + 8):
            world.step()
            if "box_13" not in asleep(world):
                break
        assert asleep(world) == {f"box_{index}" for index in range(20)} - {"box_13"}
        world.step(2 * RATE)
        assert world.state("box_13").position == pytest.approx((2.0, 0.0, 0.1), abs=1e-3)


def test_robots_sleep_whole_and_wake_by_a_command() -> None:
    with flat_world() as world:
        world.spawn_robot("husky", HUSKY, BodyState((0.0, 0.0, 0.15)))
        joints = list(world.bodies["husky"].joints)
        for joint in joints:
            world.command("husky", joint, JointCommand(velocity=0.0))
        world.step(3 * RATE)
        assert {name.partition("/")[0] for name in asleep(world)} == {"husky"}
        assert len(asleep(world)) == len(world.followers)
        world.command("husky", joints[0], JointCommand(velocity=0.0))
        assert asleep(world), "the same command again is none"
        start = world.state("husky").position
        for joint in joints:
            world.command("husky", joint, JointCommand(velocity=4.0))
        assert not asleep(world)
        world.step(RATE)
        assert math.dist(start, world.state("husky").position) > 0.1
        assert not asleep(world), "a robot whose joints are driven never sleeps"


def test_a_world_saved_asleep_goes_on_as_the_one_restored_from_it() -> None:
    def go_on(world: World) -> str:
        for step in range(RATE):
            if step == 30:
                world.spawn("hits", Sphere(0.1), 1.0, BodyState((-0.5, 0.01, 0.1), linear=(4.0, 0.0, 0.0)))
            world.step()
        return world.snapshot().hash

    with flat_world() as world, flat_world() as other:
        world.spawn("box", BOX, 1.0, BodyState((0.0, 0.0, 0.1)))
        world.spawn("ball", Sphere(0.1), 1.0, BodyState((1.0, 0.0, 0.1)))
        world.step(2 * RATE)
        assert asleep(world) == {"box", "ball"}
        other.restore(world.save())
        assert go_on(world) == go_on(other)


@pytest.mark.parametrize("gravity", [0.0057, 0.03])
def test_a_body_that_is_thrown_up_where_gravity_is_weak_comes_back(gravity: float) -> None:
    with flat_world(gravity=(0.0, 0.0, -gravity)) as world:
        world.spawn("ball", Sphere(0.1), 1.0, BodyState((0.0, 0.0, 0.3), linear=(0.0, 0.0, 0.05)))
        world.step(int((0.1 / gravity + 2.0 * math.sqrt(0.4 / gravity)) * RATE))
        assert world.state("ball").position[2] == pytest.approx(0.1, abs=1e-3)


def test_a_ball_rolls_down_a_slope_where_gravity_is_weak() -> None:
    """5/7 of what gravity has along the slope, from rest, and for so long as it takes for 1 m on the Earth's slope."""
    gravity, angle = 0.02, math.radians(3.0)
    slope = HeightMap(math.tan(angle) * SPACING * np.mgrid[:SIDE, :SIDE][1], resolution=SPACING, origin=(-3.0, -3.0))
    seconds = math.sqrt(2.0 * 1.0 / (5.0 / 7.0 * gravity * math.sin(angle)))
    with World(slope, WorldConfig(physics=PhysicsConfig(gravity=(0.0, 0.0, -gravity)))) as world:
        world.spawn("ball", Sphere(0.1), 1.0, BodyState((2.0, 0.0, 5.0 * math.tan(angle) + 0.1 / math.cos(angle))))
        world.step(int(seconds * RATE))
        assert world.state("ball").position[0] == pytest.approx(1.0, abs=0.1)


def test_bodies_sleep_where_gravity_is_weak_too() -> None:
    with flat_world(gravity=(0.0, 0.0, -1.62)) as world:
        world.spawn("box", BOX, 1.0, BodyState((0.0, 0.0, 0.1)))
        world.step(3 * RATE)
        assert asleep(world) == {"box"}


def test_a_body_that_nothing_supports_never_sleeps() -> None:
    """It hovers because a force is applied in every step, as a rotor would, and falls as soon as that ends."""
    with flat_world() as world:
        world.spawn("drone", Box(0.3, 0.3, 0.1), 1.0, BodyState((0.0, 0.0, 1.0)))
        uid = world.bodies["drone"].uid
        for _ in range(2 * RATE):
            x, y, z = world.state("drone").position
            world.client.applyExternalForce(uid, -1, (0.0, 0.0, 9.81), (x, y, z), pb.WORLD_FRAME)
            world.step()
            assert not asleep(world)
        assert world.state("drone").position[2] == pytest.approx(1.0, abs=1e-3)
        world.step(RATE // 4)
        assert world.state("drone").position[2] == pytest.approx(1.0 - 0.5 * 9.81 / 16.0, abs=0.01)


@pytest.mark.parametrize("after", [0.0, 0.02])
def test_a_body_at_its_apex_does_not_sleep_however_soon_others_do(after: float) -> None:
    with World(
        HeightMap(FLAT, resolution=SPACING, origin=(-3.0, -3.0)), WorldConfig(sleep=SleepConfig(after=after))
    ) as world:
        world.spawn("ball", Sphere(0.1), 1.0, BodyState((0.0, 0.0, 0.3), linear=(0.0, 0.0, 2.0)))
        world.spawn("rests", BOX, 1.0, BodyState((1.0, 0.0, 0.1)))
        for _ in range(RATE // 3):
            world.step()
            assert "ball" not in asleep(world)
        assert asleep(world) == {"rests"}


class SleepingBesideAwake(RuleBasedStateMachine):
    """One world sleeps, one never does; both are told the same. No body of the first may be elsewhere than in the
    second, and its supports are those that fresh tables give."""

    def __init__(self) -> None:
        super().__init__()
        self.worlds = [self._world(sleep=True), self._world(sleep=False)]
        self.level = 0.0
        self.names: dict[str, int] = {}
        self.made = 0

    @staticmethod
    def _world(*, sleep: bool) -> World:
        terrain = Terrain()
        terrain.put("west", HeightMap(FLAT[:, :31], resolution=SPACING, origin=(-3.0, -3.0)))
        terrain.put("east", HeightMap(FLAT[:, 30:], resolution=SPACING, origin=(0.0, -3.0)))
        return World(terrain, WorldConfig(physics=PhysicsConfig(sleep=sleep)))

    def teardown(self) -> None:
        for world in self.worlds:
            world.close()

    def place(self, cell: int, above: float = 0.0) -> tuple[float, float, float]:
        """The middle of one of nine cells that boxes cannot leave within a step of the machine."""
        return 1.6 * (cell % 3) - 1.6, 1.6 * (cell // 3) - 1.6, self.level + 0.1 + above

    @precondition(lambda self: len(self.names) < 9)
    @rule(data=st.data(), above=st.sampled_from([0.0, 0.2]))
    def spawn(self, data: Any, above: float) -> None:
        cell = data.draw(st.sampled_from(sorted(set(range(9)) - set(self.names.values()))))
        name = f"box_{self.made}"
        self.made += 1
        for world in self.worlds:
            world.spawn(name, BOX, 1.0, BodyState(self.place(cell, above)))
        self.names[name] = cell

    @precondition(lambda self: self.names)
    @rule(data=st.data())
    def remove(self, data: Any) -> None:
        name = data.draw(st.sampled_from(sorted(self.names)))
        for world in self.worlds:
            world.remove(name)
        del self.names[name]

    @precondition(lambda self: self.names)
    @rule(data=st.data(), speed=st.sampled_from([0.0, 0.4]))
    def put_back(self, data: Any, speed: float) -> None:
        name = data.draw(st.sampled_from(sorted(self.names)))
        for world in self.worlds:
            world.move(name, BodyState(self.place(self.names[name]), linear=(speed, 0.0, 0.0)))

    @rule(change=st.sampled_from([-0.05, -1e-4, 1e-4, 0.002, 0.05]))
    def new_maps(self, change: float) -> None:
        self.level += change
        for world in self.worlds:
            for mesh in world.terrain.tiles.values():
                assert isinstance(mesh, HeightMap)
                mesh.replace(np.full_like(mesh.heights, self.level), time=world.time)

    @rule(row=st.integers(0, 40))
    def same_region(self, row: int) -> None:
        for world in self.worlds:
            for mesh in world.terrain.tiles.values():
                assert isinstance(mesh, HeightMap)
                mesh.update_region(row, 3, mesh.heights[row : row + 9, 3:12], time=world.time)

    @rule()
    def tile_again(self) -> None:
        """A tile is taken away and another of its name put there, at the same height."""
        for world in self.worlds:
            world.terrain.remove("east")
            again = np.full((SIDE, 31), self.level, np.float32)
            world.terrain.put("east", HeightMap(again, resolution=SPACING, origin=(0.0, -3.0), time=world.time))

    @rule()
    def clock_back(self) -> None:
        for world in self.worlds:
            world.reset_time()

    @rule(steps=st.sampled_from([1, 30]))
    def step(self, steps: int) -> None:
        for world in self.worlds:
            world.step(steps)

    @precondition(lambda self: self.names)
    @rule()
    def fall_asleep(self) -> None:
        for world in self.worlds:
            world.step(RATE)

    @invariant()
    def same_places(self) -> None:
        sleeping, awake = self.worlds
        for name in self.names:
            here, there = (world.state(name).position for world in (sleeping, awake))
            assert math.dist(here, there) < 2e-3, f"{name} is at {here}, awake at {there}"

    @precondition(lambda self: self.names)
    @rule()
    def supports_are_those_of_fresh_tables(self) -> None:
        """Right after an update without memory of the last one, each awake body has the support that a new world's
        body at its place has."""
        world = self.worlds[0]
        world.ground.configure(world.config.patch)  # wakes all
        world.refresh()
        with World(world.terrain, world.config) as fresh:
            fresh.time = world.time
            for name in self.names:
                fresh.spawn(name, BOX, 1.0, world.state(name))
            fresh.refresh()
            found, expected = (
                {w.followers[slot].name: w.ground.patches.supports[slot] for slot in w.followers.solid.tolist()}
                for w in (world, fresh)
            )
            assert found.keys() == expected.keys()
            for name, support in found.items():
                assert support.state == expected[name].state
                if support.state == Support.NONE:
                    continue
                for field in ("foot_x", "foot_y", "foot_z", "gap", "rise"):  # extents depend on the schedule
                    assert support[field] == pytest.approx(expected[name][field], abs=1e-9), f"{field} of {name}"


def test_sleeping_and_waking_bodies_are_where_awake_ones_are() -> None:
    run_state_machine_as_test(SleepingBesideAwake, settings=settings(examples(40), stateful_step_count=20))


@pytest.mark.parametrize("maximal", [True, False], ids=["rigid body", "multibody"])
def test_bodies_of_a_pybullet_world_sleep_where_their_user_lets_them(client: Any, maximal: bool) -> None:
    """A box loses its collider at rest, rides on ground that rises, and is awake again for good when told so."""
    shape = client.createCollisionShape(pb.GEOM_BOX, halfExtents=[0.1] * 3)
    body = client.createMultiBody(1.0, shape, basePosition=(0.0, 0.0, 0.1), useMaximalCoordinates=maximal)
    heightmap = HeightMap(FLAT, resolution=SPACING, origin=(-3.0, -3.0))
    ground = Ground(client, heightmap)
    follower = ground.attach(body)
    ground.let_sleep(lambda _: True)

    def run(first: int, count: int) -> None:
        for step in range(first, first + count):
            ground.step(step / RATE, 1.0 / RATE)

    run(0, RATE)
    assert follower.collider is None
    heightmap.replace(FLAT + np.float32(0.05), time=RATE / RATE)
    run(RATE, 5)
    assert follower.collider is not None
    run(RATE + 5, 2 * RATE)
    assert client.getBasePositionAndOrientation(body)[0][2] == pytest.approx(0.15, abs=1e-3)
    assert follower.collider is None
    ground.let_sleep(None)
    run(3 * RATE + 5, 2 * RATE)
    assert follower.collider is not None
    assert client.getBasePositionAndOrientation(body)[0][2] == pytest.approx(0.15, abs=1e-3)


def test_a_sleeping_body_is_awake_before_it_is_touched() -> None:
    """A ball rolls towards a box: as it comes near the box has its collider again, and is no deeper for it."""
    with flat_world() as world:
        world.spawn("box", BOX, 1.0, BodyState((0.0, 0.0, 0.1)))
        world.step(RATE)
        world.spawn("ball", Sphere(0.1), 1.0, BodyState((-1.0, 0.0, 0.1), linear=(3.0, 0.0, 0.0)))
        while asleep(world):
            world.step()
            assert world.time < 10.0
        gap = world.state("box").position[0] - world.state("ball").position[0] - 0.2
        assert -1e-3 < gap < 0.05
        lowest = [world.state("box").position[2] for _ in range(60) if world.step() is None]
        assert min(lowest) > 0.099


def test_two_runs_are_equal_to_the_bit_although_bodies_sleep_and_wake() -> None:
    def run() -> list[str]:
        with flat_world() as world:
            for index in range(12):
                world.spawn(f"box_{index}", BOX, 1.0, BodyState((0.5 * (index % 4) - 1.0, 0.5 * (index // 4), 0.1)))
            hashes = []
            for second in range(5):
                world.step(RATE)
                start = BodyState((-2.0, 0.5 * (second % 3), 0.1), linear=(3.0, 0.0, 0.0))
                world.spawn(f"ball_{second}", Sphere(0.1), 1.0, start)
                hashes.append(world.snapshot().hash)
            return hashes

    assert run() == run()


@pytest.mark.parametrize("gravity", [0.0057, 0.02])
def test_a_body_that_is_released_where_gravity_is_weak_falls(gravity: float) -> None:
    with flat_world(gravity=(0.0, 0.0, -gravity)) as world:
        world.spawn("ball", Sphere(0.1), 1.0, BodyState((0.0, 0.0, 1.1)))
        world.step(int(0.9 * math.sqrt(2.0 / gravity) * RATE))
        assert world.state("ball").position[2] == pytest.approx(1.1 - 0.81, abs=2e-3)
