"""Soil under the bodies of a collider over DDS: they sink, rest and sleep; which soil is where comes with the map."""

import math
from typing import Any

import numpy as np
import pytest
from grid_map_msgs.msg import GridMap
from rclpy.qos import QoSProfile
from smartmesh_msgs.msg import HeightmapUpdate

from smartmesh_ros.scenes import eight
from smartmesh_ros.soil.config import soil_named
from smartmesh_ros.tools.testing import Probe
from smartmesh_ros.tools.testing.messages import heightmap_message
from studies.soil.trials import plate_sinkage
from tests.grid_maps import grid_map_message
from tests.node.shared import box, fed, position_of, set_parameters, show_map, spawn, stamped

PLATE, MASS = box(0.2, 0.2, 0.1), 5e3 * 0.04 / 9.81
SIDE = 101
FLAT: dict[str, Any] = {"heights": np.zeros((SIDE, SIDE)), "resolution": 0.04, "origin": (-2.0, -2.0, 0.0)}


def test_bodies_of_a_collider_stand_on_soil(probe: Probe) -> None:
    grids = probe.listen("/terrain_collider/sinkage", GridMap, QoSProfile(depth=10))
    with probe.running("terrain_collider", {"soil.type": ["lunar"], "publish.body_states": 60.0}):
        show_map(probe, **FLAT)
        spawn(probe, "plate", (0.003, 0.007, 0.0501), shape=PLATE, mass=MASS)
        probe.wait_for(lambda: probe.diagnostics("bodies")["asleep"] == "1")
        sunk = 0.05 - position_of(probe, "plate")[2]
        assert sunk == pytest.approx(plate_sinkage(soil_named("lunar"), 0.2, 5e3), rel=0.05)
        # Who subscribes after the plate sank gets its print, with the map's sample below the plate's middle.
        found = probe.latest("pressed_ground")
        assert 5 <= min(found.width, found.height) <= max(found.width, found.height) <= 7, "samples of 0.2 m"
        print_ = np.reshape(found.heights, (found.height, found.width))
        assert -print_[SIDE // 2 - found.y, SIDE // 2 - found.x] == pytest.approx(sunk, abs=1e-4)
        assert not any(found.velocities)
        probe.wait_for(lambda: bool(grids) and max(grids[-1].data[1].data) == pytest.approx(sunk, rel=0.05))
        assert list(grids[-1].layers) == ["elevation", "sinkage"]
        assert np.count_nonzero(grids[-1].data[1].data) < 100
        set_parameters(probe, {"soil.type": [""]})
        # It stands on the map's print, whose samples at the plate's edge are less deep than the soil below it.
        probe.wait_for(lambda: position_of(probe, "plate")[2] > 0.05 - sunk + 1e-4)
        probe.wait_for(lambda: probe.diagnostics("bodies")["asleep"] == "1")
        assert 0.05 - sunk < position_of(probe, "plate")[2] < 0.05


def test_soils_come_with_maps_and_layers_and_stay_where_later_ones_say_nothing() -> None:
    with fed({"soil.type": ["lunar", "clay"], "terrain.input": "grid_map", "terrain.changes": "motion"}) as node:

        def give(soil: Any = None, x: float = 0.0) -> Any:
            return stamped(node, heightmap_message(np.zeros((9, 9)), origin=(x, 0.0, 0.0), soil=soil))

        soils = np.arange(81).reshape(9, 9) % 2
        for soil, x, wanted in (
            (soils, 0.0, soils), (None, 0.0, soils), (None, 0.3, np.hstack([soils[:, 3:], np.zeros((9, 3))])),
        ):  # fmt: skip
            node.give("heightmap", give(soil, x))
            np.testing.assert_array_equal(node.world.terrain.tiles[""].soil, wanted)
        node.require_refused("heightmap", [("soil", give(soils + 1, 0.3)), ("soil", give(np.full((9, 9), 255), 0.3))])
        short = give(x=0.3)
        short.soil = [1, 0]
        node.require_refused("heightmap", [("length", short)])
        assert not node.set("raster.material_layers", ["soil=kind"])

        def grid_map(kind: Any) -> GridMap:
            return grid_map_message({"elevation": np.zeros((9, 9)), "kind": kind}, 0.1, stamp=node.now())

        node.give("grid_map", grid_map(np.where(soils, 1.0, np.nan)))
        np.testing.assert_array_equal(node.world.terrain.tiles[""].soil, soils)
        node.require_refused("grid_map", [("soil", grid_map(0.5 * soils)), ("soil", grid_map(-1.0 * soils))])


def test_a_map_that_cannot_be_soil_is_taken_without() -> None:
    """Its cells are too wide. That is counted with each map, and a finer map is soil again."""
    with fed({"soil.type": ["lunar"]}) as node:
        counts = node.node.refusals.counts
        for resolution, refused in ((0.5, 0), (10.0, 1), (0.5, 1), (10.0, 2)):
            node.give("heightmap", heightmap_message(np.zeros((9, 9)), resolution=resolution), steps=1)
            assert node.world.terrain.tiles[""].geometry.resolution == resolution
            assert counts["soil.type: soil"] == refused == counts.total()
            assert (node.world.ground.soil is None) == (resolution == 10.0)
        assert not node.set("soil.type", ["clay"])
        assert counts["soil.type: soil"] == 3


def test_a_rover_leaves_ruts_where_it_drove(probe: Probe) -> None:
    """The two nodes of soil.launch.py rover:=true."""
    pressed = probe.listen("/terrain_collider/pressed_ground", HeightmapUpdate, QoSProfile(depth=1000))
    soil = {"soil.type": ["hit_lss1"], "soil.slip_sinkage": False, "publish.body_states": 60.0}
    with probe.running("terrain_collider", soil), probe.running("rover", {}):

        def reach() -> float:
            columns = [side for update in pressed for side in (update.x, update.x + update.width)]
            return eight.SPACING * (max(columns) - min(columns)) if columns else 0.0

        probe.wait_for(lambda: reach() > 1.0)
        assert probe.diagnostics("bodies")["put back onto the ground"] == "0"
        [place] = [body.pose.position for body in probe.latest("body_states").bodies if body.id == "rover"]
        assert math.dist((place.x, place.y), eight.PLACE) < 2.5 * eight.LOOP
