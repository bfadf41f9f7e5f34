"""Soil under the bodies of a terrain: it gives way under contact forces and keeps what was pressed."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from itertools import chain
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from smartmesh_ros.core import CORE, as_bytes
from smartmesh_ros.errors import InputError
from smartmesh_ros.patches.shapes import SHAPE, BodyShape
from smartmesh_ros.soil.bodies import PressingBodies
from smartmesh_ros.soil.config import SoilConfig, SoilType
from smartmesh_ros.soil.layer import LAYER_SAMPLE, Floats, Region, soil_table
from smartmesh_ros.soil.soils import kinds_from, map_from, soils_from
from smartmesh_ros.terrain.grid import FloatArray, IntArray
from smartmesh_ros.terrain.terrain import MainMesh, Terrain

# First row and column of no samples; their last row and column are -1.
NOWHERE = 2**31 - 1

# A body that presses the soil. ``shape``: a record of ``SHAPE``. ``state``: position, quaternion, linear and
# angular velocity of the body's frame in the world. ``force`` [N]: vertical contact force of the last update, at the
# distance ``place`` (2,) [m] from the body's position along x and y of the world, NaN = unknown; ``load`` [N],
# ``centre_of_load`` (2,): the same, filtered. ``seat`` [m]: height of the shape's middle without the map's z, at which
# the soil carries the load; ``slope`` (2,): of the pressed plane, along columns and rows. ``pressed``, ``seen``: first
# row and column, last row and column of the samples that it pressed last, and of those that the next update must look
# at. Results: ``sinkage`` [m], the deepest; ``area`` [m^2]; ``carried`` [N], by the soil's pressure; ``grip``, shear
# force over pressing force; ``displaced`` [m^3], in the last update.
FOOT = np.dtype(
    [
        ("shape", SHAPE), ("state", np.float64, 13), ("force", np.float64), ("place", np.float64, 2),
        ("load", np.float64), ("centre_of_load", np.float64, 2), ("seat", np.float64), ("slope", np.float64, 2),
        ("pressed", np.int32, 4), ("seen", np.int32, 4), ("sinkage", np.float64), ("area", np.float64),
        ("carried", np.float64), ("grip", np.float64), ("displaced", np.float64),
    ]
)  # fmt: skip


def with_room(feet: Any, count: int) -> Any:
    """Return ``count`` records of ``FOOT``, the first of which are ``feet``."""
    more = np.zeros(count - len(feet), FOOT)
    more["pressed"] = more["seen"] = NOWHERE, NOWHERE, -1, -1
    more["seat"] = math.nan
    return np.concatenate((feet, more))


# A contact of a body with the ground, such as `World.contacts` returns: with the name of the ``body``, its ``position``
# [m] (3,), ``normal`` (3,), unit and into the body, and ``normal_force`` [N], NaN = unknown.
Contact = Any


class Load(NamedTuple):
    """Vertical ``force`` [N] of a body on the soil, and its place ``x``, ``y`` [m] in the terrain's frame; NaN =
    unknown, then the soil does not change how the body leans."""

    force: float
    x: float = math.nan
    y: float = math.nan


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
            for _ in range(960):
                world.step()
                soil.apply(world.contacts(), world.dt, world.time)
            print(soil.results()["box"].sinkage)

    To update at a lower rate than physics, `note` the contacts of the steps between.

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
        self.soils = soils_from(soil)
        self.map = map_from(terrain, tile)
        shape = (self.map.geometry.rows, self.map.geometry.columns)
        self._kinds = kinds_from(kinds, shape, len(self.soils))
        samples = np.zeros(shape, LAYER_SAMPLE)  # memory is allocated when it is written
        self.layer = samples.view(np.recarray)
        self._core = CORE.Soil(as_bytes(samples), self._kinds, soil_table(self.soils))
        self._names: list[str] = []
        self._feet: Any = np.zeros(0, FOOT)
        self._shapes: list[BodyShape | None] = []  # of the feet
        self.number = 0  # of the last update
        self._contacts: list[Contact] = []  # since the last update, of a number of steps
        self._steps = 0

    def note(self, contacts: Iterable[Contact]) -> None:
        """Add the contacts of a step. The next `apply` takes the mean over all steps since the one before, because
        contact forces of single steps fluctuate, and soil keeps the sinkage of the highest load. The ``dt`` of `apply`
        is then that of all these steps together."""
        self._contacts.extend(contacts)
        self._steps += 1

    def apply(self, contacts: Iterable[Contact], dt: float, time: float | None = None) -> int:
        """Press the soil by the contacts of the last step, and of steps that were noted, for the next ``dt`` [s];
        return the number of changed rectangles of the map. ``dt`` is the time until the next `apply`: the step of
        physics, times the number of steps from one `apply` to the next if you `note` those between. ``time`` [s]: the
        instant on the terrain's clock; None = the map's newest time + ``dt``.

        Raises `InputError` for a contact of an unknown body: the soil then stays as it is, and the contacts since the
        last update are discarded.
        """
        if not (math.isfinite(dt) and dt > 0.0):
            raise InputError("time", f"dt is {dt} s; it must be above zero")
        now = self.map.time + dt if time is None else time
        self.note(contacts)
        loads = loads_of(self._contacts, self._steps)
        self._contacts, self._steps = [], 0
        rectangles, heights, speeds = self._press(loads, dt, now)
        if len(rectangles):
            self.map.take_rectangles(rectangles, heights, speeds, now)
        if self.config.grip:
            carried, grips = self._feet["carried"].tolist(), self._feet["grip"].tolist()
            for name, force, grip in zip(self._names, carried, grips, strict=True):
                if force > 0.0:
                    self.bodies.set_grip(name, grip)
        return len(rectangles)

    def press(self, loads: dict[str, Load], dt: float, time: float) -> list[Region]:
        """Press the soil by the ``loads`` of bodies; return the changes of the map, which the caller must
        give it at ``time`` [s] before the next call. Raises `InputError` for an unknown body."""
        rectangles, heights, speeds = self._press(loads, dt, time)
        found, start = [], 0
        for top, left, bottom, right in rectangles.tolist():
            shape = bottom - top + 1, right - left + 1
            end = start + shape[0] * shape[1]
            found.append(Region(top, left, heights[start:end].reshape(shape), speeds[start:end].reshape(shape)))
            start = end
        return found

    def _press(self, loads: dict[str, Load], dt: float, time: float) -> tuple[IntArray, Floats, Floats]:
        """Press the soil; return changed rectangles, heights and velocities as `HeightMap.take_rectangles` takes
        them."""
        self._read_bodies(loads)
        self.number += 1
        changes: tuple[IntArray, Floats, Floats] = self._core.update(
            self.map.core_reader, as_bytes(self._feet), time, dt, self.number, self.config
        )
        return changes

    def set_kinds(self, kinds: ArrayLike) -> None:
        """Change which soil each sample is, as ``kinds`` at the start; sinkages stay. Raises `InputError`."""
        self._kinds[...] = kinds_from(kinds, self._kinds.shape, len(self.soils))

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
        self.layer[...] = 0
        self._names, self._shapes, self._feet, self._contacts, self._steps = [], [], self._feet[:0], [], 0

    def _read_bodies(self, loads: dict[str, Load]) -> None:
        """Read the bodies with contact, and those whose soil still moves. Raises `InputError`, and changes nothing."""
        busy = ((self._feet["load"] > 0.0) | (self._feet["seen"][:, 2] >= 0)).tolist()
        kept = [row for row, name in enumerate(self._names) if busy[row] or name in loads]
        names = list(dict.fromkeys([*(self._names[row] for row in kept), *loads]))
        shapes, states = self.bodies.read(names)
        gone = [row for row, shape in enumerate(shapes) if shape is None]
        for row in gone:
            if names[row] in loads:
                raise InputError("unknown_body", f"there is a contact of {names[row]!r}, which is no known body")
        if len(kept) != len(self._names) or len(kept) != len(names):
            self._feet = with_room(self._feet[kept], len(names))
            self._shapes = [self._shapes[row] for row in kept] + [None] * (len(names) - len(kept))
        self._names, feet = names, self._feet
        for row, shape in enumerate(shapes):
            if shape is not self._shapes[row] and shape is not None:
                feet["shape"][row], self._shapes[row] = shape.record, shape
        if gone:
            states[gone], feet["load"][gone] = feet["state"][gone], 0.0
        feet["state"] = states
        pressing = chain.from_iterable([loads.get(name, NO_LOAD) for name in names])
        given = np.fromiter(pressing, np.float64, 3 * len(names)).reshape(-1, 3)
        feet["force"], feet["place"] = given[:, 0], given[:, 1:] - states[:, :2]


def loads_of(contacts: Iterable[Contact], steps: int = 1) -> dict[str, Load]:
    """Return the load of each body, the mean over the ``steps`` that the contacts are of; contacts without a force are
    left out."""
    sums: dict[str, tuple[float, float, float]] = {}
    for contact in contacts:
        force = contact.normal_force * contact.normal[2]
        if force > 0.0:  # not NaN
            x, y, _ = contact.position
            total, total_x, total_y = sums.get(contact.body, NO_LOAD)
            sums[contact.body] = total + force, total_x + force * x, total_y + force * y
    return {body: Load(force / steps, x / force, y / force) for body, (force, x, y) in sums.items()}
