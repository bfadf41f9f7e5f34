"""Materials of the ground by place, as maps bring them: ice beside gravel, mats. What they do: tests/ground."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from geometry_msgs.msg import Twist, Vector3
from grid_map_msgs.msg import GridMap
from numpy.typing import ArrayLike, NDArray
from smartmesh_msgs.msg import HeightmapUpdate
from smartmesh_msgs.srv import StepPhysics
from std_srvs.srv import SetBool

from smartmesh_ros.tools.testing import Probe, floats, heightmap_message, layer_message
from tests.grid_maps import grid_map_message
from tests.node.shared import Fed, box, fed, position_of, spawn, stamped

ROWS, COLUMNS, RESOLUTION, ORIGIN = 41, 201, 0.1, (-10.0, -2.0, 0.0)
ICE, GRAVEL = 0.1, 0.6
FLAT = np.zeros((ROWS, COLUMNS))


def halves() -> NDArray[np.float32]:
    """Ice where x < 0, gravel elsewhere."""
    friction = np.full((ROWS, COLUMNS), GRAVEL, np.float32)
    friction[:, : COLUMNS // 2] = ICE
    return friction


def coefficients(node: Fed) -> NDArray[np.float32]:
    """Of the samples of the node's map (rows, columns); 1 where none is known."""
    return np.nan_to_num(np.broadcast_to(node.world.terrain.tiles[""].friction, FLAT.shape), nan=1.0)


def test_friction_comes_with_maps_and_stays_where_later_ones_say_nothing() -> None:
    """Also after regions, and with the ground of a map that scrolls on by 4 m to new ground."""
    with fed({}) as node:

        def give(friction: ArrayLike | None = None, x: float = 0.0) -> None:
            origin = (ORIGIN[0] + x, *ORIGIN[1:])
            message = heightmap_message(FLAT, resolution=RESOLUTION, origin=origin, friction=friction)
            node.give("heightmap", stamped(node, message))

        give(halves())
        np.testing.assert_array_equal(coefficients(node), halves())
        give()
        region = HeightmapUpdate(x=0, y=0, width=COLUMNS, height=ROWS, heights=floats(FLAT.astype(np.float32)))
        node.give("heightmap_update", stamped(node, region))
        np.testing.assert_array_equal(coefficients(node), halves())
        give(x=4.0)
        np.testing.assert_array_equal(coefficients(node), np.hstack([halves()[:, 40:], np.ones((ROWS, 40))]))
        for friction in (0.2, np.nan, np.where(halves() > 0.5, halves(), np.nan)):
            give(friction, x=4.0)
            known = np.nan_to_num(np.broadcast_to(np.float32(friction), FLAT.shape), nan=1.0)
            np.testing.assert_array_equal(coefficients(node), known)
        # Layers by their names, in maps and regions.
        layers = {"stiffness": np.where(halves() > 0.5, 2e5, np.nan), "damping": 2e4}
        node.give("heightmap", stamped(node, heightmap_message(FLAT, resolution=RESOLUTION, layers=layers)))
        changes = [layer_message("damping", 1e3), layer_message("rolling", np.arange(6.0) / 60.0)]
        region = HeightmapUpdate(x=2, y=1, width=3, height=2, heights=floats(np.zeros(6)), layers=changes)
        node.give("heightmap_update", stamped(node, region))
        given = node.world.terrain.tiles[""].material
        np.testing.assert_array_equal(given.stiffness, np.float32(layers["stiffness"]))
        np.testing.assert_array_equal(given.damping[:3, :6], [[2e4] * 6, *[[2e4] * 2 + [1e3] * 3 + [2e4]] * 2])
        np.testing.assert_array_equal(given.rolling[1:3, 2:5], np.float32(np.arange(6.0).reshape(2, 3) / 60.0))


def test_a_layer_of_a_grid_map_holds_the_friction() -> None:
    with fed({"terrain.input": "grid_map"}) as node:

        def grid_map(friction: NDArray[np.float32], start: tuple[int, int] = (0, 0)) -> GridMap:
            """Level ground with a layer of coefficients, whose circular buffer begins at ``start``."""
            layers = {"elevation": FLAT, "slip": friction, "rolling": 0.1 * halves()}
            return grid_map_message(layers, RESOLUTION, start=start, stamp=node.now())

        node.give("grid_map", grid_map(halves()))
        assert (coefficients(node) == 1.0).all()
        assert not node.set("raster.material_layers", ["friction=slip", "rolling"])
        for start in ((0, 0), (3, 17)):
            node.give("grid_map", grid_map(halves(), start))
            np.testing.assert_array_equal(coefficients(node), halves())
            np.testing.assert_array_equal(node.world.terrain.tiles[""].material.rolling, np.float32(0.1) * halves())
        node.require_refused("grid_map", [("friction", grid_map(-halves()))])
        assert "may be one of" in node.set("raster.material_layers", ["grip=slip"])
        assert "once" in node.set("raster.material_layers", ["friction", "friction=slip"])
        assert not node.set("raster.material_layers", ["friction=grip"])
        node.require_refused("grid_map", [("layer", grid_map(halves()))])
        np.testing.assert_array_equal(coefficients(node), halves())


def test_the_publisher_on_the_page_makes_ice_beside_gravel(probe: Probe) -> None:
    """docs/materials.md; bodies have the friction 0.5."""
    page = (Path(__file__).parents[2] / "docs" / "materials.md").read_text()
    [code] = [code for code in re.findall(r"```python\n(.*?)```", page, re.DOTALL) if "rclpy" in code]
    with probe.running(), subprocess.Popen([sys.executable, "-c", code]) as publisher:
        try:
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
        finally:
            publisher.kill()
