"""`Ground` in scripts of others: what they see, wrong calls, copies."""

import copy
import pickle
import re
from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np
import pybullet as pb
import pytest
from pybullet_utils.bullet_client import BulletClient

import smartmesh_ros
from smartmesh_ros import (
    BaseConfig,
    BodyState,
    Box,
    Deck,
    Ground,
    HeightMap,
    ImuConfig,
    InputError,
    JointCommand,
    PhysicsConfig,
    Sphere,
    Terrain,
    World,
    WorldConfig,
)
from smartmesh_ros.core import CORE
from smartmesh_ros.core.body_shape import BodyShape
from smartmesh_ros.ground.config import SleepConfig
from smartmesh_ros.soil.soil import Soil
from smartmesh_ros.terrain.surface_query import checked_rays
from smartmesh_ros.terrain.trimesh import TriangleMesh
from smartmesh_ros.world.settings import FallConfig, GuestConfig
from tests.bodies import TETRAHEDRON
from tests.grounds import level, terrain_of


@pytest.fixture
def client(client: Any) -> int:
    """The number of a client, as users of ``physicsClientId=`` have it."""
    return int(client._client)


def ball_in(client: int) -> int:
    shape = pb.createCollisionShape(pb.GEOM_SPHERE, radius=0.2, physicsClientId=client)
    pb.setGravity(0.0, 0.0, -9.81, physicsClientId=client)
    return int(pb.createMultiBody(1.0, shape, basePosition=(0.0, 0.0, 0.3), physicsClientId=client))


def settings() -> Iterator[tuple[Callable[[int], Any], str]]:
    """Settings and states that are wrong, and words of the refusals."""
    yield (lambda c: World(level(), PhysicsConfig())), "must be WorldConfig(physics="
    yield (lambda c: WorldConfig(physics=None)), "physics of a world is None; it must be PhysicsConfig(...)"
    yield (lambda c: WorldConfig(falls=100.0)), "falls of a world is 100.0; it must be FallConfig(...)"
    yield (lambda c: PhysicsConfig(gravity=9.81)), "gravity is 9.81; it must be three"
    for name, value in {"rate": "fast", "gravity": (0.0, np.nan, 0.0), "restitution": 1.5, "friction": -0.1}.items():
        yield (lambda c, name=name, value=value: PhysicsConfig(**{name: value})), name
    yield (lambda c: JointCommand(velocity="3")), "velocity 3; it must be finite"
    for position in ((1.0, 0.0), "up", (0.0, 0.0, None)):
        yield (lambda c, position=position: BodyState(position)), "it must be 3 numbers"
    yield (lambda c: BodyState((0.0, 0.0, 1.0), (0.0, 0.0, 1.0))), "it must be 4 numbers"
    yield (lambda c: SleepConfig(after=-1.0)), "after of sleep is -1.0; it must be zero"
    yield (lambda c: FallConfig(period=np.nan)), "period of falls is nan"
    yield (lambda c: FallConfig(depth="deep")), "depth is 'deep'"
    yield (lambda c: GuestConfig(settle=-0.1)), "settle of guests is -0.1"
    for margin in (0.0, "wide"):
        words = f"margin of guests is {margin!r}; it must be finite"
        yield (lambda c, margin=margin: GuestConfig(margin=margin)), words
    for name, wrong in (
        ("rate", 0.0), ("rate", np.nan), ("rate", "fast"), ("seed", -1), ("seed", 0.5), ("gyroscope_bias", (0.0, 1.0)),
        ("accelerometer_bias", (0.0, 0.0, np.inf)), ("gyroscope_noise_density", -1.0),
        ("accelerometer_random_walk", True),
    ):  # fmt: skip
        yield (lambda c, name=name, wrong=wrong: ImuConfig(**{name: wrong})), f"{name} of an IMU is"
    for given, words in (
        ({}, "has wheels"), ({"wheels": ["a"], "tracks": ["b"]}, "has wheels"), ({"wheels": "a"}, "list of different"),
        ({"wheels": ["a", "a"]}, "list of different"), ({"wheels": ["a"], "radius": -1}, "0 to 10000 m"),
        ({"wheels": ["a"], "linear_limit": 0}, "above zero"), ({"wheels": ["a"], "track": "wide"}, "a number"),
        ({"wheels": ["a"], "wheelbase": 1.0}, "no wheelbase"),
        ({"wheels": ["a"], "steering": ["b"], "track": 1.0}, "no track"),
    ):  # fmt: skip
        yield (lambda c, given=given: BaseConfig(**given)), words


def times() -> Iterator[Callable[[int], Any]]:
    for time in (np.nan, np.inf, None, "now"):
        yield lambda c, time=time: level(time=time)
        yield lambda c, time=time: level().show(time)
        yield lambda c, time=time: Terrain(level()).shift_time(time)
        yield lambda c, time=time: Ground(c, level()).step(time, 1 / 240)
        yield lambda c, time=time: Ground(c, level()).update(time, 1 / 240)
        yield lambda c, time=time: Ground(c, level()).find_patches(time)
        yield lambda c, time=time: Ground(c, level()).at([[0.0, 0.0]], time)
        yield lambda c, time=time: Ground(c, level()).cast_rays([[0, 0, 1]], [[0, 0, -1]], 3.0, time)
        yield lambda c, time=time: TriangleMesh(np.eye(3), [[0, 1, 2]], time=time)
        yield lambda c, time=time: TriangleMesh(np.eye(3), [[0, 1, 2]]).move(np.eye(3), time=time)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda c: Ground(BulletClient(pb.DIRECT), np.zeros((5, 5))), "type ndarray; pass HeightMap(heights"),
        (lambda c: World([[0.0]]), "type list; pass HeightMap(heights"),
        (lambda c: Terrain().put("a", None), "type NoneType; pass HeightMap(heights"),
        (lambda c: Ground(level(), c), "the client is of type HeightMap; pass the module pybullet"),
        (lambda c: Ground(np.int64(1000), level()), "client 1000 is not connected; call pybullet.connect"),
        (lambda c: [Ground(c, level()), Ground(c, level())], "has a ground already"),
        (lambda c: Ground(c, level()).attach(99), "no body 99; pass the number that loadURDF"),
        (lambda c: Ground(c, level()).attach(float(ball_in(c))), "no body 0.0"),
        (lambda c: Ground(c, level()).attach(ball_in(c), 5), "no link 5; it has -1 (the base) alone"),
        (lambda c: Ground(c, level()).attach(ball_in(c), -1.0), "no link -1.0"),
        (
            lambda c: Ground(c, level()).attach(ball_in(c), shape=Sphere(0.2), radius=0.2),
            "a shape and a radius; give eit",
        ),
        (lambda c: Ground(c, level()).attach(ball_in(c), shape="ball"), "pass Sphere, Box, Cylinder or Capsule"),
        *(
            (
                lambda c, link=link: Ground(c, terrain_of(deck=Deck(level()))).carry("deck", ball_in(c), link),
                f"no link {link!r}",
            )
            for link in (-2, 0, "deck")
        ),
        (lambda c: Ground(c, terrain_of(deck=Deck(level()))).carry("deck", 99), "no body 99"),
        (lambda c: [g := Ground(c, level()), g.attach(g.attach(ball_in(c)).collider)], "is a piece of this ground"),
        (lambda c: HeightMap(np.zeros((5, 5))), "resolution is missing; pass resolution="),
        (lambda c: HeightMap(np.zeros((5, 5)), resolution="fine"), "resolution is 'fine'"),
        (lambda c: HeightMap(np.zeros((5, 5)), resolution=0.1, yaw=90), "convert degrees with math.radians"),
        (lambda c: HeightMap(np.zeros((5, 5)), resolution=0.1, origin=(0, 0, 0, 1)), "must be x, y or x, y, z"),
        (lambda c: HeightMap([[1.0, 2.0], [1.0]], resolution=0.1), "all rows must have the same length"),
        (lambda c: level().at([[1.0, 2.0], [1.0]], 0.0), "all rows must have the same length"),
        (lambda c: TriangleMesh([[1.0, 2.0], [1.0]], [[0, 1, 2]]), "all rows must have the same length"),
        (lambda c: Ground(c, level()).cast_rays([[0, 0], [0]], [[0, 0, 1]], 1.0, 0.0), "same length"),
        (lambda c: level(time=5.0).replace(np.zeros((41, 41)), time=4.0), "after one of 5 s; after the time was set"),
        (lambda c: Ground(c, level()).step(0.0, 0.01), "steps 0.004166666666666667 s; call setTimeStep(0.01)"),
        (lambda c: Ground(c, level()).set_soil("clay"), "pass Soil(ground.terrain, ...)"),
        (lambda c: Ground(c, level()).let_sleep(True), "pass SleepConfig(...), or None"),
        *(
            (lambda c, name=name: [g := Ground(c, level()), getattr(g, name)(g.attach(ball_in(c)))], "pass the number")
            for name in ("detach", "wake", "is_asleep")
        ),
        (lambda c: Ground(c, level()).detach("robot"), "no body 'robot'"),
        (lambda c: World(level()).save(extra=5), "the extra state is 5; it must be a dict"),
        (lambda c: [g := Ground(c, level()), g.attach(b := ball_in(c)), g.drive(b, -1, None, 1.0)], "three numbers"),
        (lambda c: Ground(c, level()).step(0.0, None), "dt is None s"),
        *settings(),
        *((call, "it must be a finite number of seconds") for call in times()),
        *((lambda c, rate=rate: Ground(c, level()).show(rate), "above zero") for rate in (0.0, np.inf, "often")),
    ],
)
def test_a_wrong_call_is_told_what_would_be_right(client: int, call: Callable[[int], Any], words: str) -> None:
    with pytest.raises(InputError) as caught:
        call(client)
    assert words in str(caught.value)
    assert {*re.findall(r"(?:pass|be) ([A-Z]\w+)\(", str(caught.value))} <= {*smartmesh_ros.__all__}


def test_ground_and_soil_cannot_be_exchanged_by_an_assignment_that_changes_nothing(client: int) -> None:
    ground: Any = Ground(client, level())
    with World(level()) as world:
        owner: Any = world
        for of, name, value in (
            (ground, "terrain", level()), (ground, "soil", Soil(ground.terrain, "clay")), (owner, "terrain", level()),
        ):  # fmt: skip
            with pytest.raises(AttributeError):
                setattr(of, name, value)


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))], ids=["copy", "pickle"])
def test_an_environment_that_holds_a_ground_is_copied_and_reset(client: int, copied: Callable[[Any], Any]) -> None:
    """PyBullet's world is not; whoever steps the copy before is told so."""
    terrain = level()
    env = SimpleNamespace(terrain=terrain, ground=Ground(client, terrain), ball=ball_in(client))
    env.ground.attach(env.ball)
    env.ground.step(0.0, 1 / 240)
    other = copied(copied(env))
    assert other.ground.terrain.tile("") is other.terrain is not env.terrain
    assert other.ground.at([[0.0, 0.0]], 0.0).z == 0.0
    for call in (
        lambda: other.ground.step(0.0, 1 / 240), lambda: other.ground.attach(0), lambda: other.ground.is_ground(0),
    ):  # fmt: skip
        with pytest.raises(InputError, match=r"this ground is a copy.*make Ground"):
            call()
    other.ground.close()
    number = pb.connect(pb.DIRECT)
    other.ground, other.ball = Ground(number, other.terrain), ball_in(number)
    other.ground.attach(other.ball)
    for each, connected in ((env, client), (other, number)):
        for step in range(240):
            each.ground.step(step / 240, 1 / 240)
        position, _ = pb.getBasePositionAndOrientation(each.ball, physicsClientId=connected)
        assert position[2] == pytest.approx(0.2, abs=1e-3)
    pb.disconnect(number)


# Of the body's own two parts, and given ones.
SHAPES = {
    "compound": None, "capsule": BodyShape.capsule(0.1, 0.3), "cylinder": BodyShape.cylinder(0.1, 0.3),
    "box": BodyShape.box((0.1, 0.2, 0.3), (0.1, 0.0, 0.2), (0.0, 0.6, 0.0, 0.8)),
    "hull": BodyShape.hull(TETRAHEDRON, 0.01),
}  # fmt: skip


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))], ids=["copy", "pickle"])
@pytest.mark.parametrize("shape", SHAPES)
def test_what_a_ground_returned_is_copied_with_it(client: int, copied: Callable[[Any], Any], shape: str) -> None:
    """To the bit. Patches, which are found in PyBullet's world, say so instead."""
    ground = Ground(client, level())
    parts = pb.createCollisionShapeArray(
        [pb.GEOM_BOX, pb.GEOM_CAPSULE], radii=[0.0, 0.1], halfExtents=[[0.1, 0.2, 0.3], [0.0] * 3], lengths=[0.0, 0.3],
        collisionFramePositions=[[0.1, 0.0, 0.0], [0.0, 0.0, 0.5]], physicsClientId=client,
    )  # fmt: skip
    body = pb.createMultiBody(1.0, parts, physicsClientId=client)
    follower = ground.attach(body, shape=SHAPES[shape])
    rays = checked_rays([[0.0, 0.0, 1.0]], [[0.0, 0.1, -1.0]], 3.0)
    env = SimpleNamespace(
        ground=ground, follower=follower, followers=ground.followers, rays=ground.rays, patches=ground.find_patches(0.0)
    )
    other = copied(copied(env))
    assert other.follower is not follower and other.followers[0] is other.follower
    assert vars(other.follower) == vars(follower) | {"shape": other.follower.shape}
    poses = np.random.default_rng(0).normal(size=(20, 7))
    for pose in poses / np.linalg.norm(poses[:, 3:], axis=1)[:, None]:
        mine, its = (CORE.LowerSurface([each.shape]).bounds(pose[None]) for each in (follower, other.follower))
        np.testing.assert_array_equal(mine, its)
    for mine, its in zip(env.rays.cast(rays, 0.0), other.rays.cast(rays, 0.0), strict=True):
        np.testing.assert_array_equal(mine, its)
    with pytest.raises(InputError, match=r"these patches are a copy.*patches.table\(\)"):
        other.patches.table()


def test_a_copied_world_goes_on_as_its_original_and_soil_is_not_lost() -> None:
    with World(level(resolution=0.05)) as world:
        world.ground.set_soil(soil := Soil(world.terrain, "clay"))
        for part in (world.ground, soil):
            with pytest.raises(InputError, match="soil cannot be copied"):
                copy.deepcopy(part)
        world.spawn("ball", Sphere(0.1), 30.0, BodyState((0.0, 0.0, 0.3), linear=(1.0, 0.0, 0.0)))
        world.spawn("box", Box(0.2, 0.3, 0.2), 1.0, BodyState((0.5, 0.5, 0.3), angular=(1.0, 2.0, 0.0)))
        world.track("walker", 0.3, BodyState((-1.0, 0.0, 0.3)))
        world.step(60)
        with copy.deepcopy(world) as other, pickle.loads(pickle.dumps(world)) as third:
            world.save()  # as both were made of a snapshot
            for each in (world, other, third):
                each.step(120)
            for each in (other, third):
                assert each.snapshot() == world.snapshot()
                assert each.ground.soil is not soil
                np.testing.assert_array_equal(each.ground.soil.sinkage(), soil.sinkage())
        assert soil.sinkage().max() > 0.0
