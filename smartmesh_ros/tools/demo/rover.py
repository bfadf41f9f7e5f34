"""The node ``rover``: publishes an elevation model, spawns a wheeled robot on it, and drives an eight.

The robot is spawned again whenever it is gone. Started beside a terrain_collider with soil, as ``soil.launch.py
rover:=true`` does, it leaves ruts.
"""

from __future__ import annotations

from collections.abc import Sequence
from time import monotonic
from typing import Any

from sensor_msgs.msg import JointState
from smartmesh_msgs.msg import Heightmap, TrackedBodyArray
from smartmesh_msgs.srv import SpawnBody

from smartmesh_ros.node.parameters.declaring import ParameterNode
from smartmesh_ros.node.parameters.helping import answer
from smartmesh_ros.node.refusals import GRACE, LOG_PERIOD
from smartmesh_ros.node.running import spin
from smartmesh_ros.node.transport import LATCHED
from smartmesh_ros.scenes import eight
from smartmesh_ros.tools.demo.terrain_source import map_of

NAME, ROBOT = "rover", "rover"
SPECS = ()
# Period of the checks for a subscriber of the map and for the spawn service [s].
PERIOD = 0.2
# Time after which a call without an answer is repeated [s]: the collider may have been killed while it had the call.
PATIENCE = 10.0


class Rover(ParameterNode):
    """Publishes the ground when a node subscribes, spawns the robot on it, and steers the robot at each body state."""

    def __init__(self, **node_options: Any) -> None:
        super().__init__(NAME, SPECS, **node_options)
        self._ground = eight.ground()
        self._maps = self.create_publisher(Heightmap, "terrain_collider/heightmap", LATCHED)
        self._commands = self.create_publisher(JointState, "terrain_collider/joint_commands", 10)
        self._spawner = self.create_client(SpawnBody, "terrain_collider/spawn_body")
        self.create_subscription(TrackedBodyArray, "terrain_collider/body_states", self._steer, 10)
        self._heard_at = monotonic()  # when the map had a subscriber [s]
        self._call_at = 0.0  # not before then [s]
        self._there = False  # the robot, also if another run of this node has spawned it
        self._way = 0.0
        self.create_timer(PERIOD, self._start)

    def _start(self) -> None:
        """Publish the ground and spawn the robot if it is not there."""
        now = monotonic()
        if not self._maps.get_subscription_count():
            if now - self._heard_at > GRACE:
                words = f"nobody subscribes to {self._maps.topic_name}; start terrain_collider, or remap the topic"
                self.get_logger().warning(words, throttle_duration_sec=LOG_PERIOD)
            return
        self._heard_at = now
        if not self._there and now >= self._call_at and self._spawner.service_is_ready():
            self._call_at = now + PATIENCE
            stamp = self.get_clock().now().to_msg()
            self._maps.publish(map_of(self._ground.geometry, self._ground.heights, stamp))
            request = SpawnBody.Request(id=ROBOT, urdf=str(eight.robot_file()), on_ground=True, align=True)
            request.pose.position.x, request.pose.position.y = eight.PLACE
            self._spawner.call_async(request).add_done_callback(self._spawned)

    def _spawned(self, future: Any) -> None:
        """Try again at once if the robot was refused, such as before the collider has its map."""
        if not future.result().success:
            self._call_at = 0.0
            self.get_logger().info(f"waits to spawn {ROBOT}: {future.result().message}", throttle_duration_sec=2.0)

    def _steer(self, message: TrackedBodyArray) -> None:
        robots = [body for body in message.bodies if body.id == ROBOT]
        if self._there and not robots:
            self.get_logger().warning(f"{ROBOT} is gone; it is spawned again")
            self._way = 0.0
        self._there = bool(robots)
        for body in robots:
            place, turn = body.pose.position, body.pose.orientation
            self._way, speeds = eight.steered((place.x, place.y), (turn.x, turn.y, turn.z, turn.w), self._way)
            names = [f"{ROBOT}/{joint}" for joint in speeds]
            self._commands.publish(JointState(name=names, velocity=list(speeds.values())))


def main(args: Sequence[str] | None = None) -> None:
    """Run the node until SIGINT or SIGTERM."""
    answer(NAME, __doc__, SPECS, args)
    spin(Rover, args)
