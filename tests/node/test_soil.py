"""The node soil and a collider over real DDS: bodies sink, rest and sleep; bad input is refused."""

import math
from typing import Any

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Vector3
from grid_map_msgs.msg import GridMap
from nav_msgs.msg import OccupancyGrid
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from rclpy.serialization import serialize_message
from smartmesh_msgs.msg import (
    BodyDescription,
    BodyDescriptionArray,
    Contact,
    ContactArray,
    HeightmapUpdate,
    TrackedBody,
    TrackedBodyArray,
)
from std_msgs.msg import Header

from smartmesh_ros.errors import InputError
from smartmesh_ros.node.soil.soil_messages import MessageBodies, contacts_from, soil_map_from
from smartmesh_ros.node.soil.soil_node import SoilNode
from smartmesh_ros.node.terrain_collider import TerrainCollider
from smartmesh_ros.patches.shapes import ShapeKind
from smartmesh_ros.scenes import eight
from smartmesh_ros.soil.soils import soil_named
from smartmesh_ros.terrain.grid import GridGeometry
from smartmesh_ros.tools.testing import Probe, pose_message
from smartmesh_ros.tools.testing.messages import heightmap_message
from studies.soil.trials import plate_sinkage
from tests import urdfs
from tests.node.shared import LATCHED, box, made_with, position_of, seconds, set_parameters, show_map, spawn

PLATE = box(0.2, 0.2, 0.1)
RATES = {"publish.contacts": 60.0, "publish.body_states": 60.0}
SIDE = 101
FLAT: dict[str, Any] = {"heights": np.zeros((SIDE, SIDE)), "resolution": 0.04, "origin": (-2.0, -2.0, 0.0)}


def test_a_body_sinks_rests_and_sleeps_and_then_no_update_comes(probe: Probe) -> None:
    updates = probe.listen("/terrain_collider/heightmap_update", HeightmapUpdate, QoSProfile(depth=1000))
    grids = probe.listen("/soil/grid_map", GridMap, LATCHED)
    with (
        probe.running("terrain_collider", RATES),
        probe.running("soil", {"soil": "lunar", "grid_map_rate": 5.0, "load_time": 0.2}),
    ):
        probe.wait_for(lambda: probe.node.count_subscribers("/terrain_collider/heightmap") == 2)
        show_map(probe, **FLAT)
        mass = 5e3 * 0.04 / 9.81
        spawn(probe, "plate", (0.003, 0.007, 0.0505), shape=PLATE, mass=mass)
        probe.wait_for(lambda: bool(updates))

        def rests() -> bool:
            quiet = seconds(probe.latest("body_states").header.stamp) > seconds(updates[-1].header.stamp) + 1.0
            return quiet and probe.diagnostics("bodies")["asleep"] == "1"

        probe.wait_for(rests)
        # Late contacts on a busy machine let the body sink farther, so there is no upper bound here.
        sunk = 0.05 - position_of(probe, "plate")[2]
        assert sunk > 0.7 * plate_sinkage(soil_named("lunar"), 0.2, 5e3)
        probe.wait_for(lambda: bool(grids))
        grid = grids[-1]
        assert list(grid.layers) == ["elevation", "sinkage", "pressure"]
        sinkage = np.array(grid.data[1].data)
        assert sinkage.max() == pytest.approx(sunk, rel=0.5)
        assert np.count_nonzero(sinkage) < 100


def test_bodies_of_a_collider_stand_on_soil_without_another_node(probe: Probe) -> None:
    with probe.running("terrain_collider", {"soil.type": "lunar", "publish.body_states": 60.0}):
        show_map(probe, **FLAT)
        mass = 5e3 * 0.04 / 9.81
        spawn(probe, "plate", (0.003, 0.007, 0.0501), shape=PLATE, mass=mass)
        probe.wait_for(lambda: probe.diagnostics("bodies")["asleep"] == "1")
        sunk = 0.05 - position_of(probe, "plate")[2]
        assert sunk == pytest.approx(plate_sinkage(soil_named("lunar"), 0.2, 5e3), rel=0.1)
        # Who subscribes after the plate sank gets its print, with the map's sample below the plate's middle.
        found = probe.latest("pressed_ground")
        assert 5 <= min(found.width, found.height) <= max(found.width, found.height) <= 7, "samples of 0.2 m"
        print_ = np.reshape(found.heights, (found.height, found.width))
        assert -print_[SIDE // 2 - found.y, SIDE // 2 - found.x] == pytest.approx(sunk, abs=1e-4)
        assert not any(found.velocities)
        set_parameters(probe, {"soil.type": ""})
        # It stands on the map's print, whose samples at the plate's edge are less deep than the soil below it.
        probe.wait_for(lambda: position_of(probe, "plate")[2] > 0.05 - sunk + 1e-4)
        probe.wait_for(lambda: probe.diagnostics("bodies")["asleep"] == "1")
        assert 0.05 - sunk < position_of(probe, "plate")[2] < 0.05


def test_a_map_that_cannot_be_soil_is_taken_without(domain: int) -> None:
    """Its cells are too wide. That is counted with each map, and a finer map is soil again."""
    with made_with(TerrainCollider, {"soil.type": "lunar"}) as node:
        [take] = [found.callback for found in node.session.subscriptions if found.topic_name.endswith("/heightmap")]
        for resolution, refused in ((0.5, 0), (10.0, 1), (0.5, 1), (10.0, 2)):
            take(serialize_message(heightmap_message(np.zeros((9, 9)), resolution=resolution)))
            node.tick()
            assert node.session.world.terrain.tiles[""].geometry.resolution == resolution
            assert node.refusals.counts["soil.type: soil"] == refused == node.refusals.counts.total()
            assert (node.session.world.ground.soil is None) == (resolution == 10.0)
        assert node.set_parameters([Parameter("soil.type", value="clay")])[0].successful
        assert node.refusals.counts["soil.type: soil"] == 3


def soils_message(cells: list[list[int]], *, resolution: float, x: float, y: float) -> OccupancyGrid:
    grid = OccupancyGrid(header=Header(frame_id="map"), data=[cell for row in cells for cell in row])
    grid.info.resolution, grid.info.width, grid.info.height = resolution, len(cells[0]), len(cells)
    grid.info.origin = pose_message((x, y, 0.0))
    return grid


def test_a_map_of_soils_lets_bodies_sink_by_the_soil_under_them(probe: Probe) -> None:
    """Clay beside x = 0 is much harder than the sand that the parameter soil names, before as after the terrain."""
    updates = probe.listen("/terrain_collider/heightmap_update", HeightmapUpdate, QoSProfile(depth=1000))
    soils = probe.node.create_publisher(OccupancyGrid, "/soil/soils", LATCHED)
    soils.publish(soils_message([[-1, 0]], resolution=2.0, x=-2.0, y=-1.0))
    with (
        probe.running("terrain_collider", RATES),
        probe.running("soil", {"soil": "dry_sand", "soils": ["clay"], "load_time": 0.2}) as node,
    ):
        probe.wait_for(lambda: probe.node.count_subscribers("/terrain_collider/heightmap") == 2)
        probe.wait_for(lambda: soils.get_subscription_count() == 1)
        show_map(probe, **FLAT)
        for name, x in (("on_sand", -0.5), ("on_clay", 0.5)):
            spawn(probe, name, (x, 0.0, 0.0505), shape=PLATE, mass=20.0)
        probe.wait_for(lambda: bool(updates))
        probe.wait_for(lambda: position_of(probe, "on_sand")[2] < 0.047)
        assert position_of(probe, "on_clay")[2] > 0.049
        soils.publish(soils_message([[1]], resolution=1.0, x=0.0, y=0.0))
        probe.wait_for(lambda: "cells are 1 to 1; they must be -1" in node.output)


def test_cells_of_soils_go_to_the_samples_inside_them() -> None:
    turned = soils_message([[0, 1], [-1, 2]], resolution=0.5, x=1.0, y=0.0)
    turned.info.origin = pose_message((1.0, 0.0, 0.0), 0.5 * math.pi)  # columns along +y
    found = soil_map_from(turned, 3, 100)
    geometry = GridGeometry(rows=3, columns=3, resolution=0.5, origin=(0.25, 0.25, 0.0))
    assert found.kinds_on(geometry).tolist() == [[0, 1, 0], [3, 2, 0], [0, 0, 0]]


@pytest.mark.parametrize(
    ("cells", "resolution", "words"),
    [([[3]], 0.5, "cells are 3 to 3"), ([[-2]], 0.5, "cells are -2"), ([[0]], 0.0, "resolution is 0")],
)
def test_impossible_maps_of_soils_are_refused(cells: list[list[int]], resolution: float, words: str) -> None:
    with pytest.raises(InputError, match=words):
        soil_map_from(soils_message(cells, resolution=resolution, x=0.0, y=0.0), 3, 100)


def test_a_rover_leaves_ruts_where_it_drove(probe: Probe) -> None:
    """The three nodes of soil.launch.py rover:=true."""
    updates = probe.listen("/terrain_collider/heightmap_update", HeightmapUpdate, QoSProfile(depth=1000))
    with (
        probe.running("terrain_collider", {**RATES, "publish.joint_states": 60.0}),
        probe.running("soil", {"soil": "hit_lss1"}),
        probe.running("rover", {"listeners": 2}),
    ):

        def reach() -> float:
            columns = [side for update in updates for side in (update.x, update.x + update.width)]
            return eight.SPACING * (max(columns) - min(columns)) if columns else 0.0

        probe.wait_for(lambda: reach() > 1.0)
        assert probe.diagnostics("bodies")["put back onto the ground"] == "0"
        [place] = [body.pose.position for body in probe.latest("body_states").bodies if body.id == "rover"]
        assert math.dist((place.x, place.y), eight.PLACE) < 2.5 * eight.LOOP


def test_contacts_of_other_frames_and_unknown_bodies_are_refused(
    domain: int, capfd: pytest.CaptureFixture[str]
) -> None:
    with made_with(SoilNode, {"soil": "lunar"}) as node:
        take = {found.topic_name.rpartition("/")[2]: found.callback for found in node.subscriptions}
        take["heightmap"](serialize_message(heightmap_message(np.zeros((9, 9)), resolution=0.1)))
        contact = Contact(body_id="ghost", normal_force=3.0, normal=Vector3(z=1.0))
        for frame, words in (("mars", "frame is 'mars'; the map's is 'map'"), ("map", "no shape and state of 'ghost'")):
            for tenth in range(3):
                header = Header(stamp=Time(sec=1, nanosec=100_000_000 * tenth), frame_id=frame)
                take["contacts"](ContactArray(header=header, contacts=[contact]))
            assert words in capfd.readouterr().err


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({"soil": "cheese"}, "no soil 'cheese'"),
        ({"soils": ["cheese"]}, "no soil 'cheese'"),
        ({"flow": 2.0}, "flow"),
        ({"soils_file": "/none.yaml"}, "cannot be read"),
    ],
)
def test_the_node_refuses_to_start_with_what_is_impossible(
    domain: int, parameters: dict[str, object], words: str
) -> None:
    with pytest.raises(InputError, match=words), made_with(SoilNode, parameters):
        pass


def test_contacts_that_are_not_finite_are_refused() -> None:
    contact = Contact(body_id="a", normal_force=1.0)
    contact.normal.z = math.nan
    with pytest.raises(InputError, match="'a' has values that are not finite"):
        contacts_from(ContactArray(contacts=[contact]))


SIZE, CYLINDER = (0.4, 0.3, 0.1), '<cylinder radius="0.1" length="0.05"/>'
PARTS = [
    urdfs.link("base", urdfs.box(SIZE), 5.0, SIZE),
    urdfs.link("wheel", CYLINDER, 1.0, (0.1, 0.1, 0.1), rpy="1.5707963 0 0"),
    urdfs.joint("axle", "continuous", "base", "wheel", xyz="0.3 0.2 -0.1"),
]
ROBOT = f'<robot name="bot">{"".join(PARTS)}</robot>'


def test_the_links_of_a_robot_are_where_its_base_and_joints_put_them() -> None:
    bodies = MessageBodies()
    try:
        robot = BodyDescription(id="bot", shape=BodyDescription.ROBOT, urdf=ROBOT)
        broken = BodyDescription(id="wreck", shape=BodyDescription.ROBOT, urdf="<robot/>")
        problems = bodies.take_descriptions(BodyDescriptionArray(bodies=[robot, broken]))
        assert ["'wreck' presses no soil" in str(problem) for problem in problems] == [True]
        pose = pose_message((1.0, 2.0, 3.0), 0.5 * math.pi)
        bodies.take_states(TrackedBodyArray(bodies=[TrackedBody(id="bot", pose=pose)]))
        bodies.take_joints({"axle": 0.3}, {"axle": 2.0})
        (shape, *others), states = bodies.read(["bot/wheel", "bot/nothing", "nobody"])
        assert shape is not None
        assert shape.kind == ShapeKind.CYLINDER
        assert shape.record["half"] == pytest.approx([0.1, 0.1, 0.025], abs=1e-3)
        assert states[0, :3] == pytest.approx([0.8, 2.3, 2.9], abs=1e-4)
        assert np.linalg.norm(states[0, 10:]) == pytest.approx(2.0, abs=1e-3)
        assert others == [None, None]
    finally:
        bodies.close()
