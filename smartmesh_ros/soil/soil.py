"""Soil under the bodies of a terrain: it gives way under contact forces and keeps what was pressed."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike

from smartmesh_ros.errors import InputError
from smartmesh_ros.soil.bodies import PressingBodies
from smartmesh_ros.soil.config import SoilConfig, SoilType
from smartmesh_ros.soil.feet import FOOT
from smartmesh_ros.soil.flowing import Flow, finish_all, no_blocks, write_changes
from smartmesh_ros.soil.layer import Bytes, Floats, SoilLayer, untouched_layer
from smartmesh_ros.soil.pressing import NOWHERE, Press, press_all
from smartmesh_ros.soil.soils import soil_named
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.moving_grid import MovingGrid
from smartmesh_ros.terrain.terrain import MainMesh, Terrain


class Contact(Protocol):
    """A contact of a body with the ground, such as `World.contacts` returns."""

    @property
    def body(self) -> str:
        """Name of the body or link."""

    @property
    def position(self) -> Sequence[float]:
        """Place of the contact in the terrain's frame [m] (3,)."""

    @property
    def normal(self) -> Sequence[float]:
        """Unit normal, from the ground into the body (3,)."""

    @property
    def normal_force(self) -> float:
        """Force along the normal [N]; NaN = unknown."""


class Load(NamedTuple):
    """Vertical ``force`` [N] of a body on the soil, and its place ``x``, ``y`` [m] in the terrain's frame; NaN =
    unknown, then the soil does not change how the body leans."""

    force: float
    x: float = math.nan
    y: float = math.nan


class Region(NamedTuple):
    """A changed rectangle of the map: its first ``row`` and ``column``, new ``heights`` (h, w) [m] relative to the
    map's z, and ``velocities`` (h, w) [m/s]."""

    row: int
    column: int
    heights: Floats
    velocities: Floats


class FootResult(NamedTuple):
    """What the soil does to a body.

    ``sinkage`` [m]: the deepest. ``area`` [m^2]: pressed. ``carried`` [N]: by the soil's pressure, without damping.
    ``grip``: largest shear force over pressing force. ``load`` [N]: filtered contact force. ``seat`` [m]: height of the
    shape's middle, without the map's z, at which the soil carries the load; NaN = without load.
    """

    sinkage: float
    area: float
    carried: float
    grip: float
    load: float
    seat: float


NO_LOAD = Load(0.0, 0.0, 0.0)


class Soil:
    """Soil on a height map, driven by contact forces.

    At each update the samples under each body in contact take the form of its underside, so far down that the pressures
    of the samples carry the body's vertical contact force. `apply` then gives the map a velocity, with which the
    samples reach that depth at the end of the update; the map must be `extrapolate`d (the default) for that, else its
    samples jump. ::

        with World(HeightMap(np.zeros((201, 201)), resolution=0.02)) as world:
            world.spawn("box", Box(0.2, 0.2, 0.2), 20.0, BodyState((2.0, 2.0, 0.12)))
            soil = Soil(world.terrain, "dry_sand", BulletBodies(world.client, world))
            for _ in range(240):
                world.step(4)
                soil.apply(world.contacts(), 4 * world.dt, world.time)
            print(soil.results()["box"].sinkage)

    ``terrain``: a height map, or a terrain whose ``tile`` is one. ``soil``: a soil, its name in ``soils.yaml``, or
    several of either; ``kinds`` (rows, columns) then tells which one each sample is, by its place in the list.
    ``bodies``: shapes, places and velocities of the bodies, see `BulletBodies` and `GivenBodies`. Raises `InputError`.
    """

    def __init__(
        self,
        terrain: MainMesh | Terrain,
        soil: SoilType | str | Sequence[SoilType | str],
        bodies: PressingBodies,
        config: SoilConfig | None = None,
        *,
        kinds: ArrayLike | None = None,
        tile: str = "",
    ) -> None:
        self.config = config or SoilConfig()
        self.bodies = bodies
        self.soils = _soils_of(soil)
        mesh = Terrain.of(terrain).tile(tile)
        if not isinstance(mesh, HeightMap):
            raise InputError("terrain", "soil needs a height map; general meshes do not give way")
        self.map = mesh
        shape = (mesh.geometry.rows, mesh.geometry.columns)
        self.layer: SoilLayer = untouched_layer(shape, self.soils, _kinds_of(kinds, shape, len(self.soils)))
        self._names: list[str] = []
        self._feet: Any = np.zeros(0, FOOT)
        self.number = 0  # of the last update
        self._dirty = no_blocks(shape)

    def apply(self, contacts: Iterable[Contact], dt: float, time: float | None = None) -> int:
        """Press the soil by the contacts of the last step, for the next ``dt`` [s]; return the number of changed
        rectangles of the map. ``time`` [s]: the instant on the terrain's clock; None = the map's newest time + ``dt``.

        Raises `InputError` for a contact of an unknown body, and then changes nothing.
        """
        if not (math.isfinite(dt) and dt > 0.0):
            raise InputError("time", f"dt is {dt} s; it must be above zero")
        now = self.map.time + dt if time is None else time
        regions = self.press(loads_of(contacts), dt, now)
        for region in regions:
            self.map.update_region(*region[:3], time=now, velocities=region.velocities)
        if self.config.grip:
            carried, grips = self._feet["carried"].tolist(), self._feet["grip"].tolist()
            for name, force, grip in zip(self._names, carried, grips, strict=True):
                if force > 0.0:
                    self.bodies.set_grip(name, grip)
        return len(regions)

    def press(self, loads: dict[str, Load], dt: float, time: float) -> list[Region]:
        """Press the soil by the ``loads`` of bodies; return the changes of the map, which the caller must
        give it at ``time`` [s] before the next call. Raises `InputError` for an unknown body."""
        self._read_bodies(loads)
        self.number += 1
        config = self.config
        grid = self.map.moved_to(time)
        press = Press(time, dt, self.number, config.load_time, config.lean_time, config.fastest)
        extrapolates = self.map.motion.mode == "extrapolate" and not self.map.motion.corrects
        carried = config.carried_speed * dt if extrapolates else 0.0
        drop = math.tan(math.radians(config.repose)) * grid.resolution
        flow = Flow(config.flow, config.rim, config.slides, drop, config.still * dt, config.flow_speed * dt, carried)
        press_all(grid, self.layer, self._feet, press)
        finish_all(grid, self.layer, self._feet, press, flow, self._dirty)
        return self._changes(grid, press, flow)

    def _changes(self, grid: MovingGrid, press: Press, flow: Flow) -> list[Region]:
        """Return the changed rectangles of the map."""
        rectangles = self._dirty[self._dirty[:, :, 2] >= 0]
        shapes = rectangles[:, 2:] - rectangles[:, :2] + 1
        ends = np.cumsum(shapes[:, 0] * shapes[:, 1])
        heights, speeds = np.empty((2, ends[-1] if len(ends) else 0), np.float32)
        write_changes(grid, self.layer, rectangles, press, flow, heights, speeds)
        found, start = [], 0
        for (row, column, *_), shape, end in zip(rectangles.tolist(), shapes.tolist(), ends.tolist(), strict=True):
            found.append(Region(row, column, heights[start:end].reshape(shape), speeds[start:end].reshape(shape)))
            start = end
        return found

    def results(self) -> dict[str, FootResult]:
        """Return what the soil did to each body in the last update."""
        fields = ("sinkage", "area", "carried", "grip", "load", "seat")
        return {
            name: FootResult(*(float(foot[field]) for field in fields))
            for name, foot in zip(self._names, self._feet, strict=True)
        }

    def sinkage(self) -> FloatArray:
        """Return how far the ground lies below the level of its soil (rows, columns) [m], zero where nobody touched
        it."""
        touched = self.layer.touched == 1
        return np.where(touched, self.layer.level - self.layer.target, 0.0)

    def reset(self) -> None:
        """Take the ground as it is now for soil that nobody has touched."""
        for values in self.layer[:-2]:
            values[...] = 0
        self._names, self._feet = [], self._feet[:0]

    def _read_bodies(self, loads: dict[str, Load]) -> None:
        """Read the bodies with contact, and those whose soil still moves. Raises `InputError`, and changes nothing."""
        busy = ((self._feet["load"] > 0.0) | (self._feet["seen_last"][:, 0] >= 0)).tolist()
        kept = [row for row, name in enumerate(self._names) if busy[row] or name in loads]
        names = list(dict.fromkeys([*(self._names[row] for row in kept), *loads]))
        feet = _with_room(self._feet[kept], len(names))
        states, forces, places = feet["state"].tolist(), [], []
        for row, name in enumerate(names):
            body = self.bodies.read(name)
            if body is not None:
                body.shape.write(feet[row])
                states[row] = body.state
            elif name in loads:
                raise InputError("unknown_body", f"there is a contact of {name!r}, which is no known body")
            else:
                feet["load"][row] = 0.0
            force, x, y = loads.get(name, NO_LOAD)
            forces.append(force)
            places.append((x - states[row][0], y - states[row][1]))
        if names:
            feet["state"], feet["force"], feet["place"] = states, forces, places
        self._names, self._feet = names, feet


def _with_room(feet: Any, count: int) -> Any:
    """Return ``count`` records of ``FOOT``, the first of which are ``feet``."""
    more = np.zeros(count - len(feet), FOOT)
    more["last"] = more["seen_last"] = -1
    more["seen_first"], more["seat"] = NOWHERE, math.nan
    return np.concatenate((feet, more))


def loads_of(contacts: Iterable[Contact]) -> dict[str, Load]:
    """Return the load of each body; contacts without a force are left out."""
    sums: dict[str, list[float]] = {}
    for contact in contacts:
        force = contact.normal_force * contact.normal[2]
        if force > 0.0:  # not NaN
            x, y, _ = contact.position
            total = sums.setdefault(contact.body, [0.0, 0.0, 0.0])
            total[0] += force
            total[1] += force * x
            total[2] += force * y
    return {body: Load(force, x / force, y / force) for body, (force, x, y) in sums.items()}


def _soils_of(soil: SoilType | str | Sequence[SoilType | str]) -> list[SoilType]:
    chosen = [soil] if isinstance(soil, SoilType | str) else list(soil)
    if not 1 <= len(chosen) <= 255:
        raise InputError("soil", f"{len(chosen)} soils; a map can have 1 to 255")
    return [soil_named(each) if isinstance(each, str) else each for each in chosen]


def _kinds_of(kinds: ArrayLike | None, shape: tuple[int, int], count: int) -> Bytes:
    """Return the map of soils; raises `InputError`."""
    if kinds is None:
        return np.zeros(shape, np.uint8)
    array = np.asarray(kinds)
    if array.shape != shape or array.dtype.kind not in "iub":
        raise InputError("soil", f"kinds are {array.shape} of type {array.dtype}; they must be {shape} integers")
    if array.min() < 0 or array.max() >= count:
        raise InputError("soil", f"kinds are {array.min()} to {array.max()}; there are soils 0 to {count - 1}")
    return array.astype(np.uint8)
