"""The shape of a body, which the core makes and keeps."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.core import CORE

if TYPE_CHECKING:  # what the core has in C++

    class BodyShape:
        """The shape of a body or link about its centre of mass, of convex parts. Lengths in metres.

        Those of one part tell what it is: ``kind``, a `ShapeKind`; ``half`` extents of its core along its axes, grown
        by a ``rounding`` radius; ``offset`` and ``orientation`` (x, y, z, w), its pose; ``vertices`` (n, 3) of a hull
        about its middle. Of several parts they tell the box around them. ``radius``: bounding radius about the centre
        of mass.
        """

        kind: int
        half: tuple[float, float, float]
        rounding: float
        offset: tuple[float, float, float]
        orientation: tuple[float, float, float, float]
        radius: float
        vertices: NDArray[np.float64]
        parts: list[BodyShape]

        @staticmethod
        def ball(radius: float, offset: Sequence[float] = ...) -> BodyShape: ...
        @staticmethod
        def capsule(
            radius: float, height: float, offset: Sequence[float] = ..., orientation: Sequence[float] = ...
        ) -> BodyShape: ...
        @staticmethod
        def cylinder(
            radius: float, height: float, offset: Sequence[float] = ..., orientation: Sequence[float] = ...
        ) -> BodyShape: ...
        @staticmethod
        def box(
            edges: Sequence[float], offset: Sequence[float] = ..., orientation: Sequence[float] = ...
        ) -> BodyShape: ...
        @staticmethod
        def hull(points: NDArray[np.float64], rounding: float = ...) -> BodyShape: ...

else:
    BodyShape = CORE.BodyShape
