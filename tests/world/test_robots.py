"""Robots with odd centres of mass, fixed bases and contacts of their own; frames: tests/node/test_robots.py."""

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from smartmesh_ros import BodyState, Box, PhysicsConfig, World, WorldConfig
from smartmesh_ros.terrain.motion import Changes, MotionConfig
from tests.grounds import level, step_on_moving, world_of
from tests.urdfs import inertial, joint, link, robot


def test_a_link_whose_centre_of_mass_is_below_the_ground_beside_its_shape_is_no_rescue() -> None:
    """A pendulum-like link: a box on the ground, and its centre of mass a quarter of a metre below it."""
    urdf = robot(
        '<link name="base"><collision><geometry><box size="0.4 0.4 0.2"/></geometry></collision>',
        inertial(5.0, 0.1, "0 0 -0.35"), "</link>",
    )  # fmt: skip
    with World(level()) as world:
        world.spawn_robot("keel", urdf, BodyState((0.0, 0.0, -0.24)))
        world.step(240)
        assert world.state("keel").position[2] == pytest.approx(-0.25, abs=0.01)
        assert world.rescues == 0
        assert world.below_ground() == []


def test_threads_load_robots_of_one_description() -> None:
    """Each in a world of its own."""
    urdfs = [robot(link("base", f'<sphere radius="{0.1 + 0.01 * number}"/>')) for number in range(20)]

    def load(number: int) -> float:
        with World(level()) as world:
            world.spawn_robot("robot", urdfs[number // 8], BodyState((0.0, 0.0, 1.0)))
            return world.bodies["robot"].radius

    with ThreadPoolExecutor(8) as threads:
        found = [*threads.map(load, range(160))]
    assert found == pytest.approx([0.1 + 0.01 * (number // 8) for number in range(160)], abs=1e-6)


# A pole of 1 m whose root is the world, and an arm on a hinge at its top.
POLE = (
    link("world", "", 0.0, 0.0) + joint("weld", "fixed", "world", "pole", xyz="0 0 0")
    + link("pole", '<box size="0.1 0.1 1.0"/>', 5.0, 0.1)
)  # fmt: skip
ARM = joint("hinge", "continuous", "pole", "arm", xyz="0 0 0.5") + link(
    "arm", '<box size="0.05 0.05 0.7"/>', 1.0, 0.1, at="0.1 0 -0.35"
)


@pytest.mark.parametrize("changes", ["motion", "correction"])
@pytest.mark.parametrize("parts", [[POLE], [POLE, ARM]], ids=["alone", "with an arm"])
def test_a_fixed_base_stays_where_it_was_put_whatever_the_ground_does_and_velocity_it_is_given(
    parts: list[str], changes: Changes
) -> None:
    """Also buried."""
    with World(level(motion=MotionConfig(changes=changes))) as world:
        world.spawn_robot("mast", robot(*parts), BodyState((0.0, 0.0, -0.1), linear=(1.0, 0.0, 0.5)))
        step_on_moving(world, lambda time: 0.2 * time, 480)
        assert world.state("mast") == BodyState((0.0, 0.0, -0.1))
        world.move("mast", BodyState((0.5, 0.0, 0.5), linear=(0.0, 1.0, 0.0), angular=(0.0, 0.0, 2.0)))
        world.step(240)
        assert world.state("mast") == BodyState((0.5, 0.0, 0.5))
        world.reset_bodies()
        world.step(240)
        assert world.state("mast") == BodyState((0.0, 0.0, -0.1))
        assert world.rescues == 0
        assert world.below_ground() == []


SLED = robot(
    link("base", '<box size="0.3 0.3 0.1"/>', 1.0, 0.01, '<contact><lateral_friction value="0.15"/></contact>'),
    joint("hinge", "continuous", "base", "arm"),
    '<!-- <contact><lateral_friction value="0.9"/></contact> -->',
    link("arm", moment=1.0, more='<contact><restitution value="0.3"/></contact>'),
)


def test_contact_parameters_of_the_urdf_go_before_the_configured_ones(tmp_path: Path) -> None:
    """Each by itself, for each link, from a file as from a text, and restored; comments do not count. A guest has the
    configured ones."""
    file = tmp_path / "sled.urdf"
    file.write_text(SLED)
    with world_of(level(), friction=0.6, restitution=0.2) as world:
        for name, urdf in (("text", SLED), ("file", str(file))):
            world.spawn_robot(name, urdf, BodyState((0.0, 0.0, 1.0)))
        guest = world.add_guest("guest", "peer", Box(0.3, 0.3, 0.1), 1.0)
        assert world.client.getDynamicsInfo(guest, -1)[1] == pytest.approx(0.6)
        for _ in range(2):
            for name in ("text", "file"):
                found = [world.client.getDynamicsInfo(world.bodies[name].uid, link) for link in (-1, 0)]
                assert [(round(link[1], 6), round(link[5], 6)) for link in found] == [(0.15, 0.2), (0.6, 0.3)]
            world.configure(WorldConfig(physics=PhysicsConfig(friction=0.1)))  # for bodies that come later
            world.restore(world.snapshot())
