"""``~/body_descriptions`` tells what every body looks like, also to whoever listens late."""

from pathlib import Path
from typing import Any

import numpy as np
import pybullet_data
from shape_msgs.msg import SolidPrimitive
from smartmesh_msgs.msg import BodyDescription, BodyDescriptionArray
from smartmesh_msgs.srv import RemoveBody

from smartmesh_ros.tools.testing import Probe
from tests.node.shared import LATCHED, box, spawn

ROVER = Path(__file__).parents[1] / "data" / "rover.urdf"
CAPSULE = "{id: pill, shape: capsule, size: [0.1, 0.4], mass: 1.0, xyz: [3, 0, 1]}"


def described(messages: list[Any]) -> dict[str, BodyDescription]:
    return {body.id: body for body in messages[-1].bodies} if messages else {}


def test_every_body_is_described_while_it_is_there(probe: Probe) -> None:
    file = Path(pybullet_data.getDataPath()) / "r2d2.urdf"
    with probe.running(parameters={"bodies.spawn": [CAPSULE, f"{{id: robot, urdf: {file}, xyz: [0, 4, 1]}}"]}):
        probe.publish_map(np.zeros((41, 41)), resolution=0.25, origin=(-5.0, -5.0, 0.0))
        messages = probe.listen("body_descriptions", BodyDescriptionArray, LATCHED)
        can = SolidPrimitive(type=SolidPrimitive.CYLINDER, dimensions=[0.8, 0.3])  # height first, there
        spawn(probe, "box", (0, 0, 2), shape=box(0.2, 0.4, 0.6))
        spawn(probe, "can", (0, 0, 2), shape=can)
        text = ROVER.read_text()
        spawn(probe, "rover", (-2, 0, 1), urdf=text)

        def all_are_described() -> bool:
            probe.publish_bodies({"guest": (2.0, 2.0, 1.0)}, radius=0.7)  # it goes if no pose comes for a second
            return described(messages).keys() == {"pill", "robot", "box", "can", "rover", "guest"}

        probe.wait_for(all_are_described)
        found = described(messages)
        assert (found["box"].shape, list(found["box"].dimensions)) == (BodyDescription.BOX, [0.2, 0.4, 0.6])
        assert (found["can"].shape, list(found["can"].dimensions)) == (BodyDescription.CYLINDER, [0.3, 0.8])
        assert (found["pill"].shape, list(found["pill"].dimensions)) == (BodyDescription.CAPSULE, [0.1, 0.4])
        rover = found["rover"]
        assert (rover.shape, rover.urdf, rover.urdf_file) == (BodyDescription.ROBOT, text, "")
        assert (found["robot"].urdf, found["robot"].urdf_file) == (file.read_text(), str(file))
        assert found["guest"].tracked
        assert np.allclose(found["guest"].dimensions, 0.7)
        with Probe() as late:
            seen = late.listen(probe.topic("body_descriptions"), BodyDescriptionArray, LATCHED)
            late.wait_for(lambda: {"box", "rover"} <= described(seen).keys())
        assert probe.call("remove_body", RemoveBody, id="box").success
        probe.wait_for(lambda: described(messages) and "box" not in described(messages))
