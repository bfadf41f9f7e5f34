"""What tracked bodies are: solids, and robots with their parts."""

from __future__ import annotations

from collections.abc import Iterable

from smartmesh_ros.ground.shapes import Sphere
from smartmesh_ros.ground.state import BodyState
from smartmesh_ros.node.inputs.conversions import BodyInput
from smartmesh_ros.node.parameters.entries import ShapeEntry
from smartmesh_ros.world.tracked_robot import TrackedPart, TrackedRobot


class TrackedSolids:
    """The solids and the ``robots`` of the entries of ``bodies.shapes``, by body. Raises `InputError` if a robot is
    refused."""

    def __init__(self, entries: Iterable[ShapeEntry]) -> None:
        entries = [*entries]
        self._solids = {entry.body: entry.solid for entry in entries if entry.solid is not None}
        self.robots = {entry.body: TrackedRobot(entry.body, entry.urdf) for entry in entries if entry.urdf}

    def parts(self, body: BodyInput) -> list[TrackedPart]:
        """Return the tracked bodies that a body is: itself, or the parts of its robot. Without a stated velocity theirs
        is zero, to be estimated from successive poses."""
        robot = self.robots.get(body.name)
        if robot is None:
            solid = body.solid or self._solids.get(body.name) or Sphere(body.radius)
            return [TrackedPart(body.name, solid, body.state)]
        parts = [*robot.parts(body.state)]
        if body.stated or any(body.state.linear) or any(body.state.angular):
            return parts
        return [part._replace(state=BodyState(part.state.position, part.state.orientation)) for part in parts]
