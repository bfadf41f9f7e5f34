"""The few PyBullet calls made for every body and step.

A `BulletClient` adds the client to each call as a keyword, which costs as much as the call itself; these pass it by
position. Everything else goes through the client.
"""

from typing import Any

import pybullet as pb

from smartmesh_ros.physics.state import Vector


class BulletCalls:
    """Calls on one client: a connected `BulletClient`, or the module ``pybullet`` itself."""

    def __init__(self, client: Any) -> None:
        self._client: int = getattr(client, "_client", 0)

    def positions(self, bodies: list[int]) -> list[Vector]:
        """Position of each body [m]."""
        get, client = pb.getBasePositionAndOrientation, self._client
        return [get(body, client)[0] for body in bodies]

    def set_positions(self, bodies: list[int], positions: list[list[float]], orientation: Any) -> None:
        """Puts bodies at positions [m], all in one orientation (x, y, z, w). This stops them."""
        reset, client = pb.resetBasePositionAndOrientation, self._client
        for body, position in zip(bodies, positions, strict=True):
            reset(body, position, orientation, client)

    def set_poses(self, bodies: list[int], positions: list[list[float]], orientations: list[list[float]]) -> None:
        """Puts bodies at positions [m] in orientations (x, y, z, w). This stops them."""
        reset, client = pb.resetBasePositionAndOrientation, self._client
        for body, position, orientation in zip(bodies, positions, orientations, strict=True):
            reset(body, position, orientation, client)

    def velocity(self, body: int) -> tuple[float, float, float]:
        """Linear velocity of a body [m/s]."""
        linear: tuple[float, float, float] = pb.getBaseVelocity(body, self._client)[0]
        return linear

    def orientation(self, body: int) -> tuple[float, float, float, float]:
        """Orientation (x, y, z, w) of a body."""
        turn: tuple[float, float, float, float] = pb.getBasePositionAndOrientation(body, self._client)[1]
        return turn

    def add_velocities(self, bodies: list[int], changes: list[list[float]]) -> list[list[float]]:
        """Changes the linear velocities of bodies by so much; returns what they are then, three numbers each [m/s]."""
        get, reset, client = pb.getBaseVelocity, pb.resetBaseVelocity, self._client
        found = []
        for body, (x, y, z) in zip(bodies, changes, strict=True):
            (u, v, w), angular = get(body, client)
            linear = [u + x, v + y, w + z]
            reset(body, linear, angular, client)
            found.append(linear)
        return found

    def set_velocities(self, bodies: list[int], twists: list[list[float]]) -> None:
        """Gives bodies their linear and angular velocities, six numbers each [m/s, rad/s]."""
        reset, client = pb.resetBaseVelocity, self._client
        for body, twist in zip(bodies, twists, strict=True):
            reset(body, twist[:3], twist[3:], client)

    def replace_heightfields(
        self, shapes: list[int], size: int, heights: list[list[float]], filters: list[bool]
    ) -> None:
        """Gives heightfields of ``size`` x ``size`` samples their new heights, and some a filter of their inner edges.

        The filter's flag is passed at every replacement; without it PyBullet drops the edges' data.
        """
        create, client, kind = pb.createCollisionShape, self._client, pb.GEOM_HEIGHTFIELD
        flags = (0, pb.GEOM_CONCAVE_INTERNAL_EDGE)
        for shape, values, filtered in zip(shapes, heights, filters, strict=True):
            create(
                kind,
                flags=flags[filtered],
                heightfieldData=values,
                numHeightfieldRows=size,
                numHeightfieldColumns=size,
                replaceHeightfieldIndex=shape,
                physicsClientId=client,
            )
