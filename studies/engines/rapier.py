"""Rapier with one height field of the whole map, whose shape is replaced by every map."""

import math
from typing import Any

import numpy as np
import rapier3d as rapier

from smartmesh_ros import Sphere
from smartmesh_ros.terrain.grid import FloatArray
from studies.engines.engine import Engine, EngineBody, Setup

# Rapier's height fields rise along y; with this turn about x [rad] they rise along z, and its rows run along -y.
UPRIGHT = (0.5 * math.pi, 0.0, 0.0)


class RapierHeightfield(Engine):
    """The ground has no velocity in contacts, and inner edges are not filtered, because the package offers that for
    triangle meshes only. Bodies never sleep. Numbers are 32 bit.

    A ball that slides from triangle to triangle loses a tenth of its friction, because Rapier clusters contacts;
    without clusters boxes that land tip over. Contacts do not tell their impulses, only pairs of bodies their sum.
    ``stiff``: the contacts' spring has a natural frequency of a quarter of the steps' rate, and contacts may overlap by
    0.1 mm; False = Rapier's defaults, 60 Hz and 5 mm.
    """

    def __init__(self, setup: Setup, *, stiff: bool = True) -> None:
        self._setup = setup
        self._steps = 0
        self._world = world = rapier.PhysicsWorld(gravity=setup.gravity)
        world.set_num_threads(1)
        parameters = world.integration_parameters
        parameters.dt = setup.dt
        parameters.friction_model = rapier.FrictionModel.COULOMB
        if stiff:
            spring = rapier.SpringCoefficients(0.25 / setup.dt, 5.0)
            parameters.contact_softness = parameters.static_contact_softness = spring
            parameters.normalized_allowed_linear_error = 1e-4
        self._handles = [self._add(body) for body in setup.bodies]
        width, length = setup.size
        self._scale = (width, 1.0, length)
        # The coefficients of a contact are those of the body: the ground has the smallest ones.
        if setup.plane:
            ground = rapier.Collider.halfspace((0.0, 0.0, 1.0))
        else:
            ground = rapier.Collider.heightfield(self._flipped(setup.heights), self._scale).rotation(UPRIGHT)
        self._ground = world.add_collider(ground.friction(0.0).restitution(0.0))
        if not setup.plane:
            self._move_ground()

    def set_ground(self, ready: FloatArray) -> None:
        self._world.colliders[self._ground].shape = rapier.SharedShape.heightfield(self._flipped(ready), self._scale)
        if self._setup.slides:
            self._move_ground()

    def step(self) -> None:
        self._world.step()
        self._steps += 1

    def poses(self) -> FloatArray:
        frames = [(body.translation, body.rotation) for body in self._bodies()]
        return np.array([(*place, turn.i, turn.j, turn.k, turn.w) for place, turn in frames]).reshape(-1, 7)

    def velocities(self) -> FloatArray:
        return np.array([(*body.linvel, *body.angvel) for body in self._bodies()]).reshape(-1, 6)

    def close(self) -> None:
        self._world.clear()

    @staticmethod
    def _flipped(heights: FloatArray) -> Any:
        return np.ascontiguousarray(heights[::-1], np.float32)

    def _move_ground(self) -> None:
        (width, length), (x, y) = self._setup.size, self._setup.offset(self._steps * self._setup.dt)
        self._world.colliders[self._ground].translation = rapier.Vec3(0.5 * width + x, 0.5 * length + y, 0.0)

    def _bodies(self) -> list[Any]:
        return [self._world.rigid_bodies[handle] for handle in self._handles]

    def _add(self, body: EngineBody) -> Any:
        shape, state = body.shape, body.state
        if isinstance(shape, Sphere):
            collider = rapier.Collider.ball(shape.radius)
        else:
            collider = rapier.Collider.cuboid(0.5 * shape.x, 0.5 * shape.y, 0.5 * shape.z)
        rule = rapier.CoefficientCombineRule.MAX
        collider = collider.mass(body.mass).friction(body.friction).restitution(body.restitution)
        collider = collider.friction_combine_rule(rule).restitution_combine_rule(rule)
        x, y, z, w = state.orientation
        pose = rapier.Isometry3(rapier.Vec3(*state.position), rapier.Rotation3(w, x, y, z))
        part = rapier.RigidBody.dynamic().position(pose).linvel(state.linear).angvel(state.angular)
        return self._world.add_body(part.can_sleep(False), [collider])
