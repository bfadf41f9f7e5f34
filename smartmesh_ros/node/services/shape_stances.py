"""How bodies of a single shape stand on the ground, found in parts between which the world steps."""

from __future__ import annotations

from typing import Any

import pybullet as pb
from pybullet_utils.bullet_client import BulletClient

from smartmesh_ros.errors import InputError
from smartmesh_ros.ground.limits import require_possible
from smartmesh_ros.ground.shapes import Shape
from smartmesh_ros.ground.state import BodyState
from smartmesh_ros.world.bodies import BodyFactory
from smartmesh_ros.world.standing import NO_TERRAIN, Parts, Stance, stance_of
from smartmesh_ros.world.world import World


class ShapeStances:
    """Measures shapes as `Population.stance_of_robot` does robots, in one PyBullet beside the world's: to make one for
    each shape would take longer than to measure it. It is made for the first shape, and takes 30 MB."""

    def __init__(self) -> None:
        self._client: Any = None
        self._factory: BodyFactory | None = None

    def of(self, world: World, name: str, shape: Shape, mass: float, state: BodyState, *, align: bool) -> Parts[Stance]:
        """Find how a shape would stand on the ground of a world. Raises `InputError` as of `World.spawn`."""
        require_possible(name, state)
        if world.terrain.empty:
            raise InputError("no_map", NO_TERRAIN)
        yield
        if self._factory is None:
            self._client = BulletClient(pb.DIRECT)
            self._factory = BodyFactory(self._client, world.config.physics)
        body = self._factory.simulated(name, shape, mass, state)
        try:
            return (yield from stance_of(self._client, body, state, world.ground_at, align=align))
        finally:
            self._client.removeBody(body.uid)

    def close(self) -> None:
        """Give up PyBullet, once no work is under way."""
        if self._client is not None:
            self._client.disconnect()
            self._client = self._factory = None
