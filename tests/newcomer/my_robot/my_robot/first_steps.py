"""What a user of the node does first: starts it, gives it ground and drops a body on it, beside a node of his own."""

import numpy as np
from geometry_msgs.msg import Point, Pose
from shape_msgs.msg import SolidPrimitive
from smartmesh_msgs.srv import SpawnBody

from smartmesh_ros.tools.testing import Probe, isolated


def main() -> None:
    with isolated(), Probe() as probe, probe.running("terrain_collider") as node:
        print("start:", *node.output.splitlines())
        probe.publish_map(np.zeros((50, 50)))
        ball = SolidPrimitive(type=SolidPrimitive.SPHERE, dimensions=[0.2])
        pose = Pose(position=Point(x=2.0, y=2.0, z=0.5))
        assert probe.call("spawn_body", SpawnBody, id="ball", mass=1.0, shape=ball, pose=pose).success
        states = probe.wait_for(lambda: probe.latest("body_states").bodies)
        print("bodies:", [body.id for body in states])
        with probe.running("idle", package="my_robot") as idle:
            assert idle.process.poll() is None
        print("ended:", idle.process.poll() is not None)
