"""The material of a height map."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from smartmesh_ros.terrain.grid import GridGeometry
from smartmesh_ros.terrain.material import Material, together


class LaidGround:
    """What a `HeightMap` is made of."""

    geometry: GridGeometry
    core_reader: Any
    _material: Material
    _clocks: NDArray[np.void]

    @property
    def _shape(self) -> tuple[int, int]:
        return self.geometry.rows, self.geometry.columns

    @property
    def material(self) -> Material:
        """What the ground is made of; its layers are numbers, or read-only arrays (rows, columns).

        Assign another to replace it; raises `InputError` and then changes nothing. `give` replaces some layers.
        """
        return self._material

    @material.setter
    def material(self, material: Material) -> None:
        self._lay(together(material).checked(self._shape))

    def give(self, material: Material) -> None:
        """Replace the layers of the ground that a material has; raises `InputError` and then changes nothing."""
        if (laid := together(material)).layers:
            self._lay(laid.checked(self._shape).over(self._material))

    @property
    def friction(self) -> float | NDArray[np.float32]:
        """Coefficient of friction of the `material`, by which that of a body is multiplied; may be assigned."""
        friction: Any = self._material.friction
        return 1.0 if friction is None else friction

    @friction.setter
    def friction(self, friction: float | ArrayLike) -> None:
        self.give(Material(friction=friction))

    @property
    def soil(self) -> NDArray[np.uint8] | None:
        """Which soil each sample is, of the `material`: its place in the list of a `Soil` (rows, columns); None = the
        first everywhere; may be assigned. `Ground.update` tells its `Soil`."""
        soil = self._material.soil
        return None if soil is None else np.asarray(soil, np.uint8)

    @soil.setter
    def soil(self, soil: ArrayLike) -> None:
        self.give(Material(soil=soil))

    def _lay(self, material: Material) -> None:
        """Replace the material by one that was checked."""
        self._material = material
        self._clocks["updates"] += 1  # what rests on the ground looks at it again
        material.tell(self.core_reader)
