"""Names of the joints and links of robots, as the node publishes them and takes them in commands."""

from __future__ import annotations

from smartmesh_ros.world.world import World


class RobotNames:
    """Puts ``<robot>/`` before the names of a robot's joints and links, or nothing.

    A robot's prefix stays while the robot is there, whatever robots come and go. ``always``: every robot has a prefix;
    else a robot that is added while no other is without prefix has none, so that the names of a robot that is alone are
    those of its URDF, as robot_state_publisher expects.
    """

    def __init__(self, world: World, *, always: bool) -> None:
        self._world, self._always = world, always
        self._prefixes: dict[str, str] = {}

    def prefixes(self) -> dict[str, str]:
        """Return the prefix of each robot, in order of spawning."""
        robots = [body.name for body in self._world.bodies.values() if body.is_robot]
        kept = {robot: self._prefixes[robot] for robot in robots if robot in self._prefixes}
        for robot in robots:
            if robot not in kept:
                kept[robot] = f"{robot}/" if self._always or "" in kept.values() else ""
        self._prefixes = {robot: kept[robot] for robot in robots}
        return self._prefixes
