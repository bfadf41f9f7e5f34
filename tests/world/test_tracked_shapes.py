"""Tracked bodies have their shapes: what they push, carry and let through is what their geometry says."""

import math
from pathlib import Path

import numpy as np
import pytest

from smartmesh_ros import BodyState, Box, Capsule, Cylinder, Deck, HeightMap, InputError, Sphere, Terrain, World
from smartmesh_ros.ground.quaternions import conjugate, product, rotate, rotation_vector
from smartmesh_ros.ground.shapes import Hull, Solid
from smartmesh_ros.world.contacts import GroundContact
from smartmesh_ros.world.tracked_robot import TrackedRobot
from tests import urdfs
from tests.bodies import TETRAHEDRON, about_y, about_z, rotation
from tests.grounds import level, world_of

RAMP = Hull(
    ((-0.4, -0.3, -0.2), (0.4, -0.3, -0.2), (0.4, 0.3, -0.2), (-0.4, 0.3, -0.2), (0.4, -0.3, 0.2), (0.4, 0.3, 0.2))
)
DECK = Hull(tuple((x, y, z) for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-0.2, 0.2)))
SHAPES: dict[Solid, float] = {  # and how far below their middles they reach [m]
    Sphere(0.3): 0.3, Box(0.8, 0.6, 0.4): 0.2, Cylinder(height=0.4, radius=0.3): 0.2,
    Capsule(height=0.4, radius=0.2): 0.4, RAMP: 0.2,
}  # fmt: skip
SIDE = about_y(0.5 * math.pi)  # their z axis along x


@pytest.mark.parametrize(
    ("shape", "turn", "reach"),
    [
        (Box(0.8, 0.6, 0.4), (0, 0, 0, 1), 0.4), (Box(0.2, 0.6, 0.6), (0, 0, 0, 1), 0.1),
        (Cylinder(height=0.4, radius=0.3), (0, 0, 0, 1), 0.3), (Cylinder(height=0.9, radius=0.2), SIDE, 0.45),
        (Capsule(height=0.5, radius=0.15), SIDE, 0.4), (RAMP, (0, 0, 0, 1), 0.4),
    ],
)  # fmt: skip
def test_it_pushes_with_its_velocity_and_its_side(shape: Solid, turn: tuple[float, ...], reach: float) -> None:
    """A crate that drags on the ground stays on its front, at its velocity."""
    with world_of(level(101), friction=0.4) as world:
        world.spawn("crate", Box(0.4, 0.4, 0.4), 1.0, BodyState((1.0, 0.0, 0.2)))
        for step in range(480):
            place = (0.7 - reach + 0.8 * step / 240.0, 0.0, 0.22)
            world.track("it", shape, BodyState(place, turn, linear=(0.8, 0.0, 0.0)))  # type: ignore[arg-type]
            world.step()
            if step == 239:
                before = world.state("crate").position
        after = world.state("crate").position
        np.testing.assert_allclose(np.subtract(after, before), (0.8, 0.0, 0.0), atol=0.01)
        assert after[0] - world.state("it").position[0] == pytest.approx(reach + 0.2, abs=0.01)


@pytest.mark.parametrize("shape", [Box(2.0, 2.0, 0.4), DECK, Cylinder(height=0.4, radius=1.0)])
def test_it_carries_what_stands_on_it_as_it_moves_rises_and_turns(shape: Solid) -> None:
    """Means over half a second: on hulls and cylinders a box rattles by millimetres a second, on its way nowhere."""
    with World() as world:
        world.spawn("crate", Box(0.2, 0.2, 0.2), 1.0, BodyState((0.5, 0.0, 2.3)))
        for linear, spin in (((0.4, 0.2, 0.3), 0.0), ((0.0, 0.0, 0.0), 0.5)):
            twists = []
            for _ in range(360):
                known = world.state("it") if "it" in world.bodies else BodyState((0.0, 0.0, 2.0))
                world.track("it", shape, BodyState(known.position, known.orientation, linear, (0.0, 0.0, spin)))
                world.step()
                crate, it = world.state("crate"), world.state("it")
                arm = np.array(crate.position) - it.position
                twists.append(
                    [*(np.array(crate.linear) - linear - (-spin * arm[1], spin * arm[0], 0.0)), *crate.angular]
                )
            np.testing.assert_allclose(np.mean(twists[240:], axis=0), (0.0, 0.0, 0.0, 0.0, 0.0, spin), atol=0.03)
            assert arm[2] == pytest.approx(0.3, abs=2e-3)


@pytest.mark.parametrize("tilt", [None, 0.3], ids=["at rest", "on a deck"])
@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: type(shape).__name__)
def test_its_contact_with_the_ground_is_that_of_its_lowest_point(shape: Solid, tilt: float | None) -> None:
    at, turn = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)
    ground: HeightMap | Terrain = level(101)
    if tilt is not None:
        at, turn, ground = (1.0, 2.0, 3.0), (math.sin(0.5 * tilt), 0.0, 0.0, math.cos(0.5 * tilt)), Terrain()
        ground.put("ferry", Deck(level(101), thickness=0.5, position=at, orientation=turn))
    with World(ground) as world:

        def contacts(height: float) -> list[GroundContact]:
            """With the middle of the body so far above the ground."""
            x, y, z = np.add(at, rotate(turn, (0.5, 0.5, height))).tolist()
            world.track("it", shape, BodyState((x, y, z), turn))
            world.update()
            return world.contacts()

        # Touching, and of a ball deep, and with its centre below the ground.
        for depth in (0.02, 0.25, 0.35) if isinstance(shape, Sphere) else (0.02,):
            [contact] = contacts(SHAPES[shape] - depth)
            assert contact.depth == pytest.approx(depth, abs=2e-3)
            assert contact.normal == pytest.approx(rotate(turn, (0.0, 0.0, 1.0)), abs=1e-6)
            _, _, above = rotate(conjugate(turn), np.subtract(contact.position, at).tolist())
            assert above == pytest.approx(0.0, abs=2e-3)
            assert math.isnan(contact.normal_force)
        assert not contacts(SHAPES[shape] + 0.05)
        if tilt is not None:
            assert not contacts(-2.0), "it is below the deck"


ARM = urdfs.robot(
    urdfs.link("base", urdfs.box((0.4, 0.4, 0.2)), 5.0, (0.4, 0.4, 0.2), at="0 0 0.1"),
    urdfs.link("arm", '<cylinder radius="0.05" length="1.0"/>', 1.0, 0.1, at="0.5 0 0", rpy="0 1.5707963267948966 0"),
    urdfs.joint("yaw", "continuous", "base", "arm", xyz="0 0 0.4", axis="0 0 1"),
    urdfs.link("left/hand", urdfs.box((0.1, 0.3, 0.1)), 0.5, (0.1, 0.3, 0.1), at="0.05 0 0"),
    urdfs.joint("reach", "prismatic", "arm", "left/hand", '<limit lower="0" upper="1" effort="1" velocity="1"/>',
                xyz="1.0 0 0", axis="1 0 0"),
)  # fmt: skip


def test_the_parts_of_a_robot_are_where_its_joints_say_with_their_velocities() -> None:
    """Velocities are the differences of the places a moment later, of a root that moves and joints that do."""
    robot, moment = TrackedRobot("rig", ARM), 1e-5
    assert [*robot.joints] == ["yaw", "reach"]
    names = [part.name for part in robot.parts(BodyState())]
    assert names == ["rig.base", "rig.arm", "rig.left.hand"], "names that bodies can have"
    turned = (0.1, -0.2, 0.3, math.sqrt(1.0 - 0.14))
    root = BodyState((1.0, 2.0, 3.0), turned, (0.4, -0.2, 0.1), (0.3, 0.5, -0.4))
    robot.move({"yaw": (0.7, 1.1), "reach": (0.2, -0.5)})
    before = [*robot.parts(root)]
    x, y, z = (moment * w for w in root.angular)
    later = product((0.5 * x, 0.5 * y, 0.5 * z, 1.0), root.orientation)
    place = tuple(a + moment * v for a, v in zip(root.position, root.linear, strict=True))
    robot.move({"yaw": (0.7 + 1.1 * moment, 1.1), "reach": (0.2 - 0.5 * moment, -0.5)})
    for one, other in zip(before, robot.parts(BodyState(place, later, root.linear, root.angular)), strict=True):  # type: ignore[arg-type]
        moved = np.subtract(other.state.position, one.state.position) / moment
        turn = rotation_vector(product(other.state.orientation, conjugate(one.state.orientation)))
        np.testing.assert_allclose(moved, one.state.linear, atol=1e-4)
        np.testing.assert_allclose(np.array(turn) / moment, one.state.angular, atol=1e-4)
    at_rest = [*robot.parts(BodyState())]
    assert at_rest[0].state.position == pytest.approx((0.0, 0.0, 0.1), abs=1e-6)
    assert at_rest[1].state.position == pytest.approx((0.5 * math.cos(0.7), 0.5 * math.sin(0.7), 0.4), abs=1e-4)
    assert at_rest[2].state.position == pytest.approx((1.25 * math.cos(0.7), 1.25 * math.sin(0.7), 0.4), abs=1e-4)
    with pytest.raises(InputError, match="no joint 'roll'; it has yaw, reach"):
        robot.move({"roll": (0.0, 0.0)})


def test_a_mesh_of_a_robot_is_its_convex_hull_where_the_mesh_is(tmp_path: Path) -> None:
    """PyBullet moves vertices of hulls by a tenth of a millimetre."""
    corners = [*("v {} {} {}".format(*corner) for corner in TETRAHEDRON), "f 1 2 3", "f 1 2 4", "f 1 3 4", "f 2 3 4"]
    (tmp_path / "mesh.obj").write_text("\n".join(corners))
    shape = urdfs.mesh(tmp_path / "mesh.obj", 'scale="0.5 0.5 0.5"')
    rig = TrackedRobot("rig", urdfs.robot(urdfs.link("base", shape, at="0.1 0.2 0.3", rpy="0 0 0.7")))
    root = BodyState((1.0, 2.0, 3.0), about_y(0.4))
    [part] = rig.parts(root)
    assert isinstance(part.solid, Hull)
    found = np.array(part.solid.vertices) @ rotation(part.state.orientation).T + part.state.position
    placed = 0.5 * TETRAHEDRON @ rotation(about_z(0.7)).T + (0.1, 0.2, 0.3)
    expected = placed @ rotation(root.orientation).T + root.position
    np.testing.assert_allclose(found[found[:, 2].argsort()], expected[expected[:, 2].argsort()], atol=2e-4)
