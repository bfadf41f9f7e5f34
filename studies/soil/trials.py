"""Plates and wheels pressed into soil by given loads, without physics, and the closed forms of what follows."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from smartmesh_ros.patches.shapes import box, cylinder
from smartmesh_ros.soil.bodies import GivenBodies
from smartmesh_ros.soil.config import SoilConfig, SoilType
from smartmesh_ros.soil.soil import Load, Soil
from smartmesh_ros.soil.soils import soil_named
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.terrain.heightmap import HeightMap

# Time between updates [s].
DT = 1.0 / 60.0
# Settings without a filter of loads, which are exact here, and nearly without a limit of speed at rest.
EXACT = SoilConfig(load_time=0.0, lean_time=0.0, still=1e-4)
# Elastic stiffness that recovers next to nothing, as the closed form of the wheel assumes [Pa/m].
RIGID = 1e11
# Way of a towed wheel between updates [m].
STEP = 5e-4
# Rotation of a cylinder that lies along y.
LYING = (math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))


@dataclass(frozen=True, kw_only=True)
class Wheel:
    """A rigid wheel: ``radius`` [m], ``width`` [m] and vertical ``load`` [N]."""

    radius: float
    width: float
    load: float


TOWED = Wheel(radius=0.125, width=0.1, load=100.0)


def modulus_of(soil: SoilType, width: float) -> float:
    """Return Bekker's modulus under a contact patch of a ``width`` b [m]."""
    return soil.Bekker_Kc / width + soil.Bekker_Kphi


def plate_sinkage(soil: SoilType, width: float, pressure: float) -> float:
    """Return the sinkage [m] of a plate under a ``pressure`` [Pa]."""
    return float((pressure / modulus_of(soil, width)) ** (1.0 / soil.Bekker_n))


def wheel_sinkage(soil: SoilType, wheel: Wheel) -> float:
    """Return the sinkage [m] of a towed wheel, whose pressures are those of plates at the same depth; by bisection."""
    low, high = 0.0, wheel.radius
    for _ in range(60):
        middle = 0.5 * (low + high)
        x = np.linspace(0.0, math.sqrt(2.0 * wheel.radius * middle - middle**2), 4001)
        depth = np.maximum(np.sqrt(wheel.radius**2 - x**2) - wheel.radius + middle, 0.0)
        pressure = modulus_of(soil, wheel.width) * depth**soil.Bekker_n
        if wheel.width * float(np.trapezoid(pressure, x)) < wheel.load:
            low = middle
        else:
            high = middle
    return high


def wheel_work(soil: SoilType, wheel: Wheel, sinkage: float) -> float:
    """Return the work [J/m = N] of pressing a rut of a ``sinkage`` [m] along the way: the wheel's resistance."""
    n = soil.Bekker_n
    return float(wheel.width * modulus_of(soil, wheel.width) * sinkage ** (n + 1.0) / (n + 1.0))


def sled_shear(soil: SoilType, pressure: float, pulled: float) -> float:
    """Return the shear stress [Pa] under a ``pressure`` [Pa] after a displacement ``pulled`` [m]."""
    strength = soil.Mohr_cohesion + pressure * math.tan(math.radians(soil.Mohr_friction))
    return strength * (1.0 - math.exp(-pulled / soil.Janosi_shear))


class PlateTrial:
    """A square plate of 0.1 m on flat ground, or on heights ``rough`` (rows, columns) [m]."""

    edge = 0.1

    def __init__(
        self,
        soil: Any,
        *,
        spacing: float,
        place: tuple[float, float] = (0.3137, 0.2971),
        yaw: float = 0.0,
        side: float = 0.6,
        rough: FloatArray | None = None,
        kinds: Any = None,
        config: SoilConfig = EXACT,
    ) -> None:
        samples = round(side / spacing) + 1
        heights = np.zeros((samples, samples) if kinds is None else np.shape(kinds)) if rough is None else rough
        self.map = HeightMap(heights, resolution=spacing)
        self.place, self.time, self.pulled = place, 0.0, 0.0
        self._bodies = GivenBodies()
        self.soil = Soil(self.map, soil, self._bodies, config, kinds=kinds)
        self._turn = (0.0, 0.0, math.sin(0.5 * yaw), math.cos(0.5 * yaw))
        self.sinkage, self.shear = 0.0, 0.0  # of the plate [m], and the stress under it [Pa]

    def press(self, pressure: float, seconds: float, *, pull: float = 0.0, aside: float = math.nan) -> None:
        """Press for some ``seconds`` with a ``pressure`` [Pa], while the plate shears the soil at the speed ``pull``
        [m/s]; ``aside`` [m]: of the load along x."""
        shape = box((self.edge, self.edge, 0.05))
        for _ in range(round(seconds / DT)):
            x, y = self.place
            height = float(np.nanmax([self.map.heights.max(), 0.0])) if self.sinkage == 0.0 else -self.sinkage
            state = (x, y, height + 0.025, *self._turn, pull, 0.0, 0.0, 0.0, 0.0, 0.0)
            self._bodies.put("plate", shape, state)
            load = Load(pressure * self.edge**2, x + aside, y + 0.0 * aside)
            for region in self.soil.press({"plate": load}, DT, self.time):
                self.map.update_region(*region[:3], time=self.time, velocities=region.velocities)
            self.time += DT
            self.pulled += pull * DT
            found = self.soil.results().get("plate")
            if found is not None and found.load > 0.0:
                self.sinkage, self.shear = 0.025 - found.seat, found.grip * pressure

    @property
    def rut(self) -> float:
        """Depth of the ground under the middle of the plate [m]."""
        return -float(self.map.at([self.place], self.time).heights[0])


class TowedWheel:
    """A wheel that a constant load presses into flat ground while it is moved along x by `STEP` an update.

    ``slip``: share of the wheel's rim speed that is lost; the shear stresses follow from it. Damping is left out,
    because the closed forms are those of slow wheels. ``sinkage`` [m]: mean of the wheel's lowest point;
    ``resistance`` [N]: mean horizontal force of the pressures against the motion; ``pull`` [N]: mean horizontal force
    on the wheel along its motion, thrust less resistance.
    """

    def __init__(
        self, soil: SoilType | str, wheel: Wheel = TOWED, *, spacing: float, slip: float = 0.0, elastic: float = RIGID
    ) -> None:
        known = soil_named(soil) if isinstance(soil, str) else soil
        self._type = replace(known, elastic_K=elastic, damping_R=0.0)
        self.wheel, self._slip, self._spacing = wheel, slip, spacing
        self._x, self._y = 2.0 * wheel.radius, 0.5 * wheel.width + 0.021
        shape = (round((2.0 * self._y + 0.02) / spacing) + 2, round((4.0 * wheel.radius + 1.2) / spacing) + 1)
        self.map = HeightMap(np.zeros(shape), resolution=spacing)
        self._bodies = GivenBodies()
        self.soil = Soil(self.map, self._type, self._bodies, SoilConfig(load_time=0.0, still=0.0, grip=False))
        self._seat, self._time = wheel.radius, 0.0
        self._normal = wheel.load  # part of the load that pressures carry [N]

    def roll(self, distance: float) -> None:
        """Roll by a ``distance`` [m], and measure on its second half."""
        rows = []
        for _ in range(round(distance / STEP)):
            forces = self._advance()
            rows.append((self.wheel.radius - self._seat, *forces))
        self.sinkage, self.resistance, thrust = np.mean(rows[len(rows) // 2 :], axis=0).tolist()
        self.pull = thrust - self.resistance

    def _advance(self) -> tuple[float, float]:
        """Make one step; return resistance and thrust [N]."""
        wheel, speed = self.wheel, STEP / DT
        spin = speed / (1.0 - self._slip) / wheel.radius if self._slip < 1.0 else 0.0
        state = (self._x, self._y, self._seat, *LYING, speed, 0.0, 0.0, 0.0, spin, 0.0)
        self._bodies.put("wheel", cylinder(wheel.radius, wheel.width), state)
        for region in self.soil.press({"wheel": Load(self._normal)}, DT, self._time):
            self.map.update_region(*region[:3], time=self._time, velocities=region.velocities)
        self._seat = self.soil.results()["wheel"].seat
        resistance, thrust, lift = self._forces()
        self._normal = max(wheel.load - lift, 0.1 * wheel.load)
        self._time += DT
        self._x += STEP
        return resistance, thrust

    def _forces(self) -> tuple[float, float, float]:
        """Return the horizontal force of the pressures against the motion, and the horizontal and vertical force of the
        shear stresses [N]; without slip only the first."""
        layer, wheel = self.soil.layer, self.wheel
        rows, columns = np.nonzero(layer.pressed == self.soil.number)
        ahead = columns * self._spacing - self._x
        beside, half = rows * self._spacing - self._y, 0.5 * self._spacing
        widths = np.minimum(beside + half, 0.5 * wheel.width) - np.maximum(beside - half, -0.5 * wheel.width)
        area = np.maximum(widths, 0.0) * self._spacing
        slope = ahead / np.sqrt(wheel.radius**2 - ahead**2)
        pressure = layer.pressure[rows, columns].astype(np.float64)
        resistance = float((area * pressure * slope).sum())
        if not self._slip:
            return resistance, 0.0, 0.0
        moved = -layer.shear_x[rows, columns]
        soil = self._type
        strength = soil.Mohr_cohesion + pressure * math.tan(math.radians(soil.Mohr_friction))
        share = -np.expm1(-np.abs(moved) / soil.Janosi_shear) * np.sign(moved)
        stress = np.where(pressure > 0.0, strength * share, 0.0)
        return resistance, float((area * stress).sum()), float((area * stress * slope).sum())


class Measured(NamedTuple):
    """A run of the smooth wheel of robomechanics/3d-terramechanics: pull, load [N] and sinkage [m] at a slip."""

    slip: float
    pull: float
    load: float
    sinkage: float


SMOOTH = (
    Measured(-0.5, -17.2, 23.2, 23.7e-3), Measured(-0.2, -7.3, 23.7, 15.1e-3), Measured(0.0, -1.3, 24.6, 14.4e-3),
    Measured(0.23, 0.7, 24.6, 17.9e-3), Measured(0.5, 1.0, 25.3, 22.7e-3), Measured(0.75, 0.8, 24.0, 25.4e-3),
    Measured(0.9, 1.5, 25.7, 25.7e-3),
)  # fmt: skip
K10 = Wheel(radius=0.058, width=0.05, load=24.6)
