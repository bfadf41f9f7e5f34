"""Whether a collider with the node soil beside it holds its rate: real-time factor and missed deadlines over DDS."""

from __future__ import annotations

from contextlib import ExitStack

import numpy as np
from shape_msgs.msg import SolidPrimitive
from smartmesh_msgs.msg import Heightmap
from smartmesh_msgs.srv import SpawnBody

from smartmesh_ros.startup.dds import isolated
from smartmesh_ros.tools.testing.messages import heightmap_message, pose_message
from smartmesh_ros.tools.testing.process import Process
from studies.load.processes import COLLIDER, Watcher
from studies.markdown import table

RATE = 240.0
RATES = {f"publish.{topic}": 60.0 for topic in ("contacts", "body_states", "joint_states")}
BOX = SolidPrimitive(type=SolidPrimitive.BOX, dimensions=[0.2, 0.2, 0.2])
# Each run settles before it is measured [s].
SETTLE, SECONDS = 5.0, 15.0


def rates() -> str:
    """Return the table of the rate that the nodes hold: the collider alone, and with soil beside it."""
    found = []
    for what, boxes in (("a rover that drives", 0), ("20 boxes of 0.2 m", 20)):
        figures = [_figures(boxes, soil=soil) for soil in (False, True)]
        found.append([what, *(f"{factor:.3f}, {missed:.2f} %" for factor, missed in figures)])
    return table(["physics at 240 Hz", "collider alone: real-time factor, late steps", "with the node soil"], found)


def _figures(boxes: int, *, soil: bool) -> tuple[float, float]:
    """Run the nodes of a scene; return the mean real-time factor, and the share of steps that started late [%]."""
    with isolated(), ExitStack() as stack:
        node = stack.enter_context(Watcher())
        stack.enter_context(Process("terrain_collider", RATES))
        if soil:
            stack.enter_context(Process("soil", {"soil": "hit_lss1"}))
        listeners = 2 if soil else 1
        if boxes:
            _place(node, boxes, listeners)
        else:
            stack.enter_context(Process("rover", {"listeners": listeners}))
        node.wait_for(lambda: len(node.windows) > 2, "timing")
        node.spin(SETTLE)
        node.windows.clear()
        node.spin(SECONDS)
        length = sum(window.window_s for window in node.windows)
        factor = sum(window.window_s * window.real_time_factor for window in node.windows) / length
        return factor, 100.0 * sum(window.deadline_misses for window in node.windows) / (RATE * length)


def _place(node: Watcher, boxes: int, listeners: int) -> None:
    """Publish flat ground, and spawn boxes on it."""
    maps = node.create_publisher(Heightmap, f"{COLLIDER}/heightmap", 1)
    spawn = node.create_client(SpawnBody, f"{COLLIDER}/spawn_body")
    node.wait_for(lambda: maps.get_subscription_count() == listeners and spawn.service_is_ready(), "nodes")
    maps.publish(heightmap_message(np.zeros((301, 301), np.float32), resolution=0.02))
    node.spin(1.0)
    for index in range(boxes):
        pose = pose_message((1.0 + 0.8 * (index % 5), 1.0 + 0.8 * (index // 5), 0.11))
        answer = node.call(spawn, SpawnBody.Request(id=f"box{index}", shape=BOX, mass=20.0, pose=pose))
        assert answer.success, answer.message
