"""What a user of the node does first: starts it, gives it ground, drops bodies on it, asks it for what it cannot do."""

import numpy as np
from geometry_msgs.msg import Point, Pose
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters
from shape_msgs.msg import SolidPrimitive
from smartmesh_msgs.msg import BodySpecification
from smartmesh_msgs.srv import RemoveBodies, SpawnBodies, SpawnBody

from smartmesh_ros.tools.testing import Probe, isolated

BALL = SolidPrimitive(type=SolidPrimitive.SPHERE, dimensions=[0.2])


def pose(x: float) -> Pose:
    return Pose(position=Point(x=x, y=2.0, z=0.5))


def refusal(probe: Probe, name: str) -> str:
    """What the node says to a change of a parameter."""
    value = ParameterValue(type=ParameterType.PARAMETER_STRING, string_value="auto")
    answer = probe.call("set_parameters", SetParameters, parameters=[Parameter(name=name, value=value)])
    return str(answer.results[0].reason)


def bodies(probe: Probe, count: int) -> list[str]:
    """Names of the bodies that there are, once there are so many."""
    states = probe.wait_for(lambda: len(found := probe.latest("body_states").bodies) == count and found)
    return sorted(body.id for body in states)


def main() -> None:
    with isolated(), Probe() as probe, probe.running("terrain_collider") as node:
        print("start:", *node.output.splitlines())
        probe.publish_map(np.zeros((50, 50)))
        assert probe.call("spawn_body", SpawnBody, id="ball", mass=1.0, shape=BALL, pose=pose(2.0)).success
        more = [BodySpecification(id=f"more_{i}", mass=1.0, shape=BALL, pose=pose(2.5 + i)) for i in range(2)]
        assert probe.call("spawn_bodies", SpawnBodies, bodies=more).success
        print("bodies:", bodies(probe, 3))
        failed = probe.call("remove_bodies", RemoveBodies, ids=["ball", "nobody"]).failures
        print("not removed:", [failure.id for failure in failed])
        assert probe.call("remove_bodies", RemoveBodies, ids=["ball", "more_0"]).success
        print("left:", bodies(probe, 1))
        print("unknown:", refusal(probe, "terrain.motoin"))
        print("fixed:", refusal(probe, "frame_id"))
        with probe.running("idle", package="my_robot") as idle:
            assert idle.process.poll() is None
        print("ended:", idle.process.poll() is not None)
