"""Starts the node, gives it flat ground, drops a ball on it, and prints the bodies that it says there are."""

import numpy as np
from geometry_msgs.msg import Point, Pose
from shape_msgs.msg import SolidPrimitive
from smartmesh_msgs.srv import SpawnBody

from smartmesh_ros.testing import Probe, isolated


def main() -> None:
    with isolated(), Probe() as probe, probe.running("terrain_collider"):
        probe.publish_map(np.zeros((50, 50)))
        ball = SolidPrimitive(type=SolidPrimitive.SPHERE, dimensions=[0.2])
        pose = Pose(position=Point(x=2.0, y=2.0, z=0.5))
        answer = probe.call("spawn_body", SpawnBody, id="ball", mass=1.0, shape=ball, pose=pose)
        assert answer.success, answer.message
        probe.wait_for(lambda: probe.latest("body_states").bodies)
        print("bodies:", [body.id for body in probe.latest("body_states").bodies])
