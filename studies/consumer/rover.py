"""A four-wheeled rover in MuJoCo, and the height fields that its wheels stand on."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.tools.client import TrackedLink

WHEELS = ("front_left", "front_right", "rear_left", "rear_right")
_PLACES = ((0.5, 0.4), (0.5, -0.4), (-0.5, 0.4), (-0.5, -0.4))  # of the wheels on the chassis [m]
RADIUS = 0.25  # of the wheels, which are spheres [m]
STEP = 0.002  # [s]
# Time constant of contacts, the least that MuJoCo takes [s].
CONTACT = 2.0 * STEP
# The lowest and highest ground of a field, from its body [m]; MuJoCo keeps heights as shares of it.
RANGE = 40.0


@dataclass(frozen=True, kw_only=True)
class FieldSpec:
    """A height field of at most ``rows`` x ``columns`` samples. ``wheels``: those that collide with it."""

    name: str
    rows: int
    columns: int
    wheels: tuple[int, ...]


@dataclass(frozen=True, kw_only=True)
class RoverConfig:
    """``speed`` [m/s]; masses [kg]; ``stiffness`` [N/m] and ``damping`` [N s/m] of each wheel's suspension."""

    speed: float = 0.6
    chassis: float = 24.0
    wheel: float = 3.0
    stiffness: float = 400.0
    damping: float = 60.0


class Rover:
    """Four spheres on a chassis with a suspension each, driven along +x; every wheel collides with its fields only."""

    def __init__(self, fields: list[FieldSpec], config: RoverConfig | None = None) -> None:
        self._config = config or RoverConfig()
        spec = mujoco.MjSpec()
        spec.option.timestep = STEP
        for field in fields:
            self._add_field(spec, field)
        self._add_rover(spec)
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        self._wheels = [self.model.body(name).id for name in WHEELS]
        self.data.ctrl[:] = self._config.speed / RADIUS
        mujoco.mj_forward(self.model, self.data)

    def place(self, x: float, y: float, z: float) -> None:
        """Puts the rover at rest with its wheels' centres at height ``z`` [m] around (x, y) [m]."""
        self.data.qpos[:] = 0.0
        self.data.qpos[:4] = x, y, z, 1.0
        self.data.qvel[:] = 0.0
        mujoco.mj_forward(self.model, self.data)

    def step(self) -> None:
        """One step of `STEP`."""
        mujoco.mj_step(self.model, self.data)

    def wheels(self) -> FloatArray:
        """Centres of the wheels (4, 3) [m]."""
        return np.array(self.data.xpos[self._wheels])

    def links(self) -> list[TrackedLink]:
        """The wheels as tracked bodies."""
        return [self._link(name, body) for name, body in zip(WHEELS, self._wheels, strict=True)]

    def _link(self, name: str, body: int) -> TrackedLink:
        twist = np.empty(6)  # angular, then linear
        mujoco.mj_objectVelocity(self.model, self.data, mujoco.mjtObj.mjOBJ_BODY, body, twist, 0)
        w, x, y, z = self.data.xquat[body].tolist()
        position, angular, linear = self.data.xpos[body].tolist(), twist[:3].tolist(), twist[3:].tolist()
        return TrackedLink(
            name=name, position=tuple(position), radius=RADIUS, orientation=(x, y, z, w), linear=tuple(linear),
            angular=tuple(angular),
        )  # fmt: skip

    def _add_field(self, spec: mujoco.MjSpec, field: FieldSpec) -> None:
        # Wide, so that MuJoCo's bounding volumes hold whatever is written later.
        spec.add_hfield(
            name=field.name,
            nrow=field.rows,
            ncol=field.columns,
            size=[50.0, 50.0, RANGE, 1.0],
            userdata=np.zeros(field.rows * field.columns, np.float32),
        )
        holder = spec.worldbody.add_body(name=field.name, mocap=True, pos=[0.0, 0.0, -RANGE])
        bits = sum(1 << wheel for wheel in field.wheels)
        holder.add_geom(type=mujoco.mjtGeom.mjGEOM_HFIELD, hfieldname=field.name, condim=3, contype=0, conaffinity=bits)

    def _add_rover(self, spec: mujoco.MjSpec) -> None:
        config = self._config
        chassis = spec.worldbody.add_body(name="chassis", pos=[0.0, 0.0, 1.0])
        chassis.add_freejoint()
        # Above the wheels; it collides with nothing.
        chassis.add_geom(
            type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.6, 0.3, 0.1], pos=[0.0, 0.0, 0.15], mass=config.chassis,
            contype=0, conaffinity=0,
        )  # fmt: skip
        for index, (name, (x, y)) in enumerate(zip(WHEELS, _PLACES, strict=True)):
            wheel = chassis.add_body(name=name, pos=[x, y, 0.0])
            wheel.add_joint(
                name=f"{name}_spring", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0, 0, 1],
                **_spring(config.stiffness, config.damping),
            )  # fmt: skip
            wheel.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, 1, 0])
            wheel.add_geom(
                type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[RADIUS, 0, 0], mass=config.wheel, friction=[0.9, 0.0, 0.0],
                condim=3, priority=1, solref=[CONTACT, 1.0], contype=1 << index, conaffinity=0,
            )  # fmt: skip
            motor = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
            motor.set_to_velocity(kv=20.0)


def _spring(stiffness: float, damping: float) -> dict[str, list[float]]:
    return {"stiffness": [stiffness, 0.0, 0.0], "damping": [damping, 0.0, 0.0]}
