"""Materials and soils of the ground by place, as maps bring them: ice beside gravel, mats, sand into which bodies sink.
What materials do: tests/ground."""

import math
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import Twist, Vector3
from grid_map_msgs.msg import GridMap
from numpy.typing import NDArray
from smartmesh_msgs.msg import HeightmapUpdate
from smartmesh_msgs.srv import StepPhysics
from std_srvs.srv import SetBool

from smartmesh_ros.scenes import eight
from smartmesh_ros.soil.config import soil_named
from smartmesh_ros.tools.testing import Probe, floats, heightmap_message, layer_message
from studies.soil.trials import plate_sinkage
from tests.grid_maps import grid_map_message
from tests.node.shared import Fed, blocks, box, fed, position_of, running, set_parameters, show_map, spawn, stamped

ROWS, COLUMNS, RESOLUTION = 41, 201, 0.1
ICE, GRAVEL = 0.1, 0.6
FLAT = np.zeros((ROWS, COLUMNS))
SOILS = FLAT + np.where(np.arange(COLUMNS) % 2, 1.0, np.nan)  # NaN: not known, which is the first one


def halves() -> NDArray[np.float32]:
    """Ice where x < 0, gravel elsewhere."""
    friction = np.full((ROWS, COLUMNS), GRAVEL, np.float32)
    friction[:, : COLUMNS // 2] = ICE
    return friction


def coefficients(node: Fed) -> NDArray[np.float32]:
    """Of the samples of the node's map (rows, columns)."""
    return np.broadcast_to(node.world.terrain.tiles[""].friction, FLAT.shape)


def test_materials_and_soils_come_with_maps_and_regions_and_stay_where_later_ones_say_nothing() -> None:
    """What becomes of them on a map that scrolls: tests/terrain/test_scrolling.py."""
    soils = np.indices(FLAT.shape).sum(axis=0) % 2
    with fed({"soil.type": ["lunar", "clay"]}) as node:

        def a_map(**material: Any) -> Any:
            return stamped(node, heightmap_message(FLAT, resolution=RESOLUTION, **material))

        def give(**material: Any) -> None:
            node.give("heightmap", a_map(**material))

        give(friction=halves(), soil=soils)
        give()
        region = HeightmapUpdate(x=0, y=0, width=COLUMNS, height=ROWS, heights=floats(FLAT.astype(np.float32)))
        node.give("heightmap_update", stamped(node, region))
        np.testing.assert_array_equal(coefficients(node), halves())
        layers = {"stiffness": np.where(halves() > 0.5, 2e5, np.nan), "damping": 2e4}
        give(layers=layers)
        changes = [layer_message("damping", 1e3), layer_message("rolling", np.arange(6.0) / 60.0)]
        region = HeightmapUpdate(x=2, y=1, width=3, height=2, heights=floats(np.zeros(6)), layers=changes)
        node.give("heightmap_update", stamped(node, region))
        given = node.world.terrain.tiles[""].material
        np.testing.assert_array_equal(given.stiffness, np.float32(layers["stiffness"]))
        np.testing.assert_array_equal(given.damping[:3, :6], [[2e4] * 6, *[[2e4] * 2 + [1e3] * 3 + [2e4]] * 2])
        np.testing.assert_array_equal(given.rolling[1:3, 2:5], np.float32(np.arange(6.0).reshape(2, 3) / 60.0))
        region = HeightmapUpdate(width=1, height=1, heights=[0.0], layers=[layer_message("soil", 2.0)])
        node.require_refused("heightmap_update", [("soil", stamped(node, region))])
        short = a_map()
        short.soil = [1, 0]
        node.require_refused("heightmap", [("soil", a_map(soil=soils + 1)), ("length", short)])
        np.testing.assert_array_equal(node.world.terrain.tiles[""].soil, soils)


def test_layers_of_a_grid_map_hold_the_material() -> None:
    with fed({"terrain.input": "grid_map", "terrain.changes": "motion", "soil.type": ["lunar", "clay"]}) as node:

        def grid_map(friction: NDArray[np.float32], start: tuple[int, int] = (0, 0), soil: float = 1.0) -> GridMap:
            """Level ground with a layer of coefficients, whose circular buffer begins at ``start``."""
            layers = {"elevation": FLAT, "slip": friction, "rolling": 0.1 * halves(), "kind": soil * SOILS}
            return grid_map_message(layers, RESOLUTION, start=start, stamp=node.now())

        node.give("grid_map", grid_map(halves()))
        assert (coefficients(node) == 1.0).all() and node.node.settings.motion.changes == "motion"
        assert not node.set("raster.material_layers", ["friction=slip", "rolling", "soil=kind"])
        for start in ((0, 0), (3, 17)):
            node.give("grid_map", grid_map(halves(), start))
            np.testing.assert_array_equal(coefficients(node), halves())
            np.testing.assert_array_equal(node.world.terrain.tiles[""].material.rolling, np.float32(0.1) * halves())
            np.testing.assert_array_equal(node.world.terrain.tiles[""].soil, np.nan_to_num(SOILS))
        bad = [("friction", grid_map(-halves())), ("soil", grid_map(halves(), soil=0.5))]
        node.require_refused("grid_map", bad)
        assert "may be one of" in node.set("raster.material_layers", ["grip=slip"])
        assert "once" in node.set("raster.material_layers", ["friction", "friction=slip"])
        assert not node.set("raster.material_layers", ["friction=grip"])
        node.require_refused("grid_map", [("layer", grid_map(halves()))])
        np.testing.assert_array_equal(coefficients(node), halves())


def test_the_publisher_on_the_page_makes_ice_beside_gravel(probe: Probe) -> None:
    """docs/materials.md; bodies have the friction 0.5."""
    [code] = [code for code in blocks("docs/materials.md", "python") if "rclpy" in code]
    with probe.running(), running(code):
        probe.wait_for(lambda: probe.diagnostics("terrain")["tiles"] == "1")
        assert probe.call("pause", SetBool, data=True).success
        sliding = {"shape": box(0.4, 0.4, 0.1), "on_ground": True, "twist": Twist(linear=Vector3(x=2.0))}
        starts = {"on_ice": (-8.0, 0.5 * 0.2), "on_gravel": (2.0, 0.5 * 1.2)}
        for name, (x, _) in starts.items():
            spawn(probe, name, (x, 0.0, 0.0), **sliding)
        assert probe.call("step", StepPhysics, steps=600).success
        for name, (x, friction) in starts.items():
            way = pytest.approx(2.0**2 / (2.0 * friction * 9.81), rel=0.03)
            probe.wait_for(lambda name=name, x=x, way=way: position_of(probe, name)[0] - x == way)


PLATE, MASS = box(0.2, 0.2, 0.1), 5e3 * 0.04 / 9.81
SAMPLES = 101
# A soil of one's own, as soft as that of this name.
LUNAR = "{Bekker_Kphi: 8.2e5, Bekker_Kc: 1400, Bekker_n: 1, Mohr_cohesion: 170, Mohr_friction: 35, Janosi_shear: 0.018}"
SAND: dict[str, Any] = {"heights": np.zeros((SAMPLES, SAMPLES)), "resolution": 0.04, "origin": (-2.0, -2.0, 0.0)}


def test_bodies_of_a_collider_stand_on_soil(probe: Probe) -> None:
    grids = probe.listen("sinkage", GridMap)
    with probe.running("terrain_collider", {"soil.type": [LUNAR], "publish.body_states": 60.0}):
        show_map(probe, **SAND)
        spawn(probe, "plate", (0.003, 0.007, 0.0501), shape=PLATE, mass=MASS)
        probe.wait_for(lambda: probe.diagnostics("bodies")["asleep"] == "1")
        sunk = 0.05 - position_of(probe, "plate")[2]
        assert sunk == pytest.approx(plate_sinkage(soil_named("lunar"), 0.2, 5e3), rel=0.05)
        # Who subscribes after the plate sank gets its print, with the map's sample below the plate's middle.
        found = probe.latest("pressed_ground")
        assert 5 <= min(found.width, found.height) <= max(found.width, found.height) <= 7, "samples of 0.2 m"
        print_ = np.reshape(found.heights, (found.height, found.width))
        assert -print_[SAMPLES // 2 - found.y, SAMPLES // 2 - found.x] == pytest.approx(sunk, abs=1e-4)
        assert not any(found.velocities)
        probe.wait_for(lambda: bool(grids) and max(grids[-1].data[1].data) == pytest.approx(sunk, rel=0.05))
        assert list(grids[-1].layers) == ["elevation", "sinkage"]
        assert np.count_nonzero(grids[-1].data[1].data) < 100
        set_parameters(probe, {"soil.type": [""]})
        # It stands on the map's print, whose samples at the plate's edge are less deep than the soil below it.
        probe.wait_for(lambda: position_of(probe, "plate")[2] > 0.05 - sunk + 1e-4)
        probe.wait_for(lambda: probe.diagnostics("bodies")["asleep"] == "1")
        assert 0.05 - sunk < position_of(probe, "plate")[2] < 0.05


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
    pressed = probe.listen("pressed_ground", HeightmapUpdate, 1000)
    soil = {"soil.type": ["hit_lss1"], "soil.slip_sinkage": False, "publish.patches": 5.0}
    with probe.running("terrain_collider", soil), probe.running("rover", {}):

        def reach() -> float:
            columns = [side for update in pressed for side in (update.x, update.x + update.width)]
            return eight.SPACING * (max(columns) - min(columns)) if columns else 0.0

        probe.wait_for(lambda: reach() > 1.0)
        assert probe.diagnostics("bodies")["put back onto the ground"] == "0"
        [place] = [body.pose.position for body in probe.latest("body_states").bodies if body.id == "rover"]
        assert math.dist((place.x, place.y), eight.PLACE) < 2.5 * eight.LOOP
