"""Ground that gives way: soil whose law is the law of contacts, in each step of PyBullet."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from smartmesh_ros.core import CORE
from smartmesh_ros.errors import InputError, as_float, require, require_flag
from smartmesh_ros.soil.config import SoilType, soil_table, soils_from
from smartmesh_ros.terrain.grid import FloatArray, Region
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.material import checked_soil
from smartmesh_ros.terrain.prints import NO_PLACES, corners
from smartmesh_ros.terrain.terrain import MainMesh, Terrain

# Fewest samples of a soil along a cell of its map that are too many.
MOST_ACROSS = 1000
# Most samples of a soil, whose table of blocks then takes half a gigabyte.
MOST_SAMPLES = 2**34


class Soil:
    """Soil that bodies stand on in the steps of PyBullet, where contacts come from the map itself.

    The pressures of the soil under a body are its contacts: in the same step it carries the body, gives way, and holds
    it by its shear strength. ::

        with World(HeightMap(np.zeros((201, 201)), resolution=0.02)) as world:
            soil = Soil(world.terrain, "dry_sand")
            world.ground.set_soil(soil)
            world.spawn("box", Box(0.2, 0.2, 0.2), 20.0, BodyState((2.0, 2.0, 0.1)))
            world.step(240)
            print(world.ground.on_soil()["box"].sinkage)

    ``terrain``: a height map, or a terrain whose ``tile`` is one. ``soil``: a soil, its name in ``soils.yaml``, or
    several of either; ``kinds`` (rows, columns) then tells which one each sample is, by its place in the list. By
    default that is in the map (`HeightMap.soil`), whose places beyond the list count as the last.
    ``spacing`` [m]: largest distance of the samples of the soil, which is finer than the map; halving it makes short
    contacts, as on clay, more exact, and costs four times as much. ``slip_sinkage``: wheels that slip dig themselves
    in, by Lyasko's law (2010). Raises `InputError`.
    """

    def __init__(
        self,
        terrain: MainMesh | Terrain,
        soil: SoilType | str | Sequence[SoilType | str],
        *,
        kinds: ArrayLike | None = None,
        tile: str = "",
        spacing: float = 0.01,
        slip_sinkage: bool = True,
    ) -> None:
        require(1e-3 <= as_float(spacing) <= 10.0, "soil", "spacing", spacing, "0.001 to 10 m")
        self.soils = soils_from(soil)
        mesh = Terrain.of(terrain).tile(tile)
        if not isinstance(mesh, HeightMap):
            raise InputError("terrain", "soil needs a height map; general meshes do not give way")
        self.map = mesh
        cell = self.map.geometry.resolution
        if not cell < MOST_ACROSS * spacing:
            least = f"it must be above {cell / MOST_ACROSS:g} m there, or the map finer"
            raise InputError("soil", f"spacing is {spacing:g} m on cells of {cell:g} m; {least}")
        if (count := self.map.size * max(cell / spacing, 1.0) ** 2) > MOST_SAMPLES:
            most = f"at most {MOST_SAMPLES:.2g} are possible: raise spacing, {spacing:g} m"
            raise InputError("soil", f"the soil of this map has {count:.2g} samples; {most}")
        if self.map.motion.corrects:
            raise InputError("soil", "the map takes changes for corrections, so it cannot keep ruts; let it be exact")
        places = checked_soil(_kinds_of(self.map) if kinds is None else kinds, self.map.heights.shape)
        if kinds is not None and places.max() >= len(self.soils):
            last = len(self.soils) - 1
            raise InputError("soil", f"kinds are up to {places.max()}; they must be places in the list, 0 to {last}")
        self.spacing = spacing
        self.core: Any = CORE.Soil(self.map.core_reader, places, soil_table(self.soils), spacing)
        self.slip_sinkage = slip_sinkage
        self.map.soil = places
        self._kinds = self.map.soil  # that the core knows
        self._changed = NO_PLACES  # corners (2, 2) of what `show` wrote since the last `changes`

    def __getstate__(self) -> None:
        raise InputError("soil", "soil cannot be copied; make a Soil anew on the copied map, with its ruts as ground")

    def state(self) -> dict[str, Any]:
        """Return all that the soil goes on from beside its map, as a tree for `state_file.to_bytes`."""
        return {
            "soils": [asdict(soil) for soil in self.soils], "spacing": self.spacing, "slip_sinkage": self.slip_sinkage,
            "memory": self.core.memory(), "changed": self._changed,
        }  # fmt: skip

    @classmethod
    def from_state(cls, terrain: MainMesh | Terrain, state: dict[str, Any], tile: str) -> Soil:
        """Return the soil of such a state, on a map that was restored with it. Raises `InputError` if it is none."""
        soils = [SoilType(**soil) for soil in state["soils"]]
        made = cls(terrain, soils, tile=tile, spacing=state["spacing"], slip_sinkage=bool(state["slip_sinkage"]))
        if state["memory"] is not None:  # else nobody has touched it
            try:
                made.core.recall(*state["memory"])
            except (TypeError, ValueError) as error:
                raise InputError("state", f"a saved soil is none of this map: {error}") from None
            made._changed = state["changed"]
        return made

    def become(self, terrain: MainMesh | Terrain, state: dict[str, Any], tile: str) -> None:
        """Be the soil of such a state, as `from_state`."""
        vars(self).update(vars(Soil.from_state(terrain, state, tile)))

    def take_kinds(self) -> bool:
        """Take which soil each sample of the map is now; return True if that was assigned since. Soil of another kind
        keeps its sinkage, and is pressed anew. `Ground.update` does it."""
        if self._kinds is self.map.soil:
            return False
        self._kinds = self.map.soil
        self.core.set_kinds(_kinds_of(self.map))
        return True

    @property
    def slip_sinkage(self) -> bool:
        """True if wheels that slip dig themselves in; may be set at any time."""
        return bool(self.core.sinks_by_slip)

    @slip_sinkage.setter
    def slip_sinkage(self, on: bool) -> None:
        require_flag(on, "soil", "slip_sinkage")
        self.core.sinks_by_slip = bool(on)

    def show(self) -> int:
        """Write what bodies pressed since the last call into the map: the mean of the soil around each sample. Returns
        the number of samples that changed. `Ground.update` does it, for rays, patches and messages; bodies on the soil
        do not need it."""
        places, heights = self.core.take_pressed()
        if len(places):
            self.map.press(places, heights)
            self._changed = corners(places, self._changed)
        return len(places)

    def changes(self, time: float, *, everything: bool = False) -> Region | None:
        """Return the rectangle of the map that `show` changed since the last call, or, of ``everything``, that bodies
        ever pressed; None if there is none, or while the ground there moves at ``time`` [s]."""
        prints = self.map.prints
        pressed = prints.corners if everything and prints else self._changed
        if not len(pressed):
            return None
        (row, column), (last_row, last_column) = pressed.tolist()
        place = slice(row, last_row + 1), slice(column, last_column + 1)
        if self.map.moving(time) and self.map.arrays[1][:, *place].any():
            return None
        self._changed = NO_PLACES
        return Region(row, column, self.map.heights[place])

    def sinkage(self) -> FloatArray:
        """Return how far the ground lies below the level of its soil (rows, columns) [m], zero where nobody touched
        it."""
        found = np.zeros(self.map.heights.shape)
        self.core.sinkage(found)
        return found

    def reset(self) -> None:
        """Take the ground as it is now in the map for soil that nobody has touched."""
        self.core.reset()


def _kinds_of(heightmap: HeightMap) -> NDArray[np.uint8]:
    """Return which soil each sample of a map is (rows, columns): the first one if the map does not say."""
    return np.zeros(heightmap.heights.shape, np.uint8) if heightmap.soil is None else heightmap.soil
