"""Friction of the ground by place, as maps bring it: ice beside gravel, over real topics."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import Twist, Vector3
from grid_map_msgs.msg import GridMap
from numpy.typing import NDArray
from smartmesh_msgs.msg import HeightmapUpdate
from smartmesh_msgs.srv import RemoveBodies, StepPhysics
from std_srvs.srv import SetBool

from smartmesh_ros.tools.testing import Probe, floats
from tests.grid_maps import grid_map_message
from tests.node.shared import box, changed, one_round, require_refused, spawn, stamped

SHARED = {"physics.friction": 1.0, "terrain.input": "grid_map"}
GRAVITY, SPEED = 9.81, 2.0
ROWS, COLUMNS, RESOLUTION, ORIGIN = 41, 201, 0.1, (-10.0, -2.0, 0.0)
PLACE = {"resolution": RESOLUTION, "origin": ORIGIN}
ICE, GRAVEL = 0.1, 0.6
FLAT = np.zeros((ROWS, COLUMNS))
ON_ICE, ON_GRAVEL = -8.0, 2.0


def halves() -> NDArray[np.float32]:
    """Ice where x < 0, gravel elsewhere."""
    friction = np.full((ROWS, COLUMNS), GRAVEL, np.float32)
    friction[:, : COLUMNS // 2] = ICE
    return friction


def ways(probe: Probe, starts: Sequence[float] = (ON_ICE, ON_GRAVEL)) -> list[float]:
    """How far boxes slide that start at `SPEED` at each x [m]."""
    one_round(probe)
    assert probe.call("pause", SetBool, data=True).success
    names = [f"box_{number}" for number in range(len(starts))]
    for name, x in zip(names, starts, strict=True):
        flat = box(0.4, 0.4, 0.1)  # it does not tip
        spawn(probe, name, (x, 0.0, 0.0), shape=flat, on_ground=True, twist=Twist(linear=Vector3(x=SPEED)))
    assert probe.call("step", StepPhysics, steps=600).success
    bodies: dict[str, Any] = {}

    def stopped() -> bool:
        bodies.update({body.id: body for body in probe.latest("body_states").bodies})
        return set(names) <= set(bodies) and all(abs(bodies[name].twist.linear.x) < 1e-4 for name in names)

    probe.wait_for(stopped)
    assert probe.call("remove_bodies", RemoveBodies, ids=names).success
    return [bodies[name].pose.position.x - x for name, x in zip(names, starts, strict=True)]


def expected(*coefficients: float) -> Any:
    return pytest.approx([SPEED**2 / (2.0 * mu * GRAVITY) for mu in coefficients], rel=0.03)


def grid_map(probe: Probe, friction: NDArray[np.float32], start: tuple[int, int] = (0, 0)) -> GridMap:
    """Level ground with a layer of coefficients (rows, columns), whose circular buffer begins at ``start``."""
    return grid_map_message({"elevation": FLAT, "slip": friction}, RESOLUTION, start=start, stamp=probe.now())


def test_boxes_stop_where_the_friction_of_their_place_stops_them(shared: Probe) -> None:
    """Also after maps and regions that say nothing of friction, and one that scrolls on by 4 m to new ground."""
    shared.publish_map(FLAT, friction=halves(), **PLACE)
    assert ways(shared) == expected(ICE, GRAVEL)
    shared.publish_map(FLAT, **PLACE)
    update = HeightmapUpdate(x=0, y=0, width=COLUMNS, height=ROWS, heights=floats(FLAT.astype(np.float32)))
    shared.publishers["heightmap_update"].publish(stamped(shared, update))
    shared.publish_map(FLAT, resolution=RESOLUTION, origin=(ORIGIN[0] + 4.0, *ORIGIN[1:]))
    assert ways(shared, (-4.0, 2.0, 11.0)) == expected(ICE, GRAVEL, 1.0)


def test_one_coefficient_is_that_of_the_whole_map_and_unknown_ones_are_1(shared: Probe) -> None:
    shared.publish_map(FLAT, friction=0.2, **PLACE)
    assert ways(shared) == expected(0.2, 0.2)
    shared.publish_map(FLAT, friction=np.nan, **PLACE)
    assert ways(shared) == expected(1.0, 1.0)
    shared.publish_map(FLAT, friction=np.where(halves() == ICE, np.nan, GRAVEL), **PLACE)
    assert ways(shared) == expected(1.0, GRAVEL)


def test_a_layer_of_a_grid_map_holds_the_friction(shared: Probe) -> None:
    maps = shared.publisher(GridMap, "grid_map")
    maps.publish(grid_map(shared, halves()))
    assert ways(shared) == expected(1.0, 1.0)
    with changed(shared, {"terrain.friction_layer": "slip"}):
        for start in ((0, 0), (3, 17)):
            maps.publish(grid_map(shared, halves(), start))
            assert ways(shared) == expected(ICE, GRAVEL)
        require_refused(shared, [(maps, "friction", lambda: grid_map(shared, -halves()))])
    with changed(shared, {"terrain.friction_layer": "grip"}):
        require_refused(shared, [(maps, "layer", lambda: grid_map(shared, halves()))])
    assert ways(shared) == expected(ICE, GRAVEL)


def test_the_publisher_on_the_page_makes_ice_beside_gravel(probe: Probe) -> None:
    """docs/friction.md; bodies have the friction 0.5."""
    page = (Path(__file__).parents[2] / "docs" / "friction.md").read_text()
    [code] = [code for code in re.findall(r"```python\n(.*?)```", page, re.DOTALL) if "rclpy" in code]
    with probe.running(), subprocess.Popen([sys.executable, "-c", code]) as publisher:
        try:
            probe.wait_for(lambda: probe.diagnostics("terrain")["tiles"] == "1")
            assert ways(probe) == expected(0.5 * 0.2, 0.5 * 1.2)
        finally:
            publisher.kill()
