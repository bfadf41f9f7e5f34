"""Moving ground and bodies on it, as in the report's Figure 1: circular waves that run inwards."""

import math
from collections.abc import Callable, Iterable
from itertools import cycle
from typing import Any

import numpy as np

from smartmesh_ros import BodyState, GridGeometry, HeightMap, PhysicsConfig, Sphere, WorldConfig
from smartmesh_ros.scenes.moving import FloatGrid, InwardWaves
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.terrain.terrain import MainMesh
from smartmesh_ros.terrain.trimesh import TriangleMesh, grid_triangles
from studies.bench.measure import Bench, Case
from studies.engines.engine import GroundSetup
from studies.report.config import ReportConfig
from studies.report.ground import ReportWorld

RESOLUTION = 0.25
RADIUS = 0.2
FRAME = 1.0 / 60.0  # between two maps [s]
# Distance of the bodies of a crowd [m].
_APART = 1.5
# Samples of ready-made frames that are kept: 32 MB of them.
_SAMPLES = 1 << 23


class Frames:
    """The items of an iterator, one after the other. ``now``: the present one."""

    def __init__(self, items: Iterable[Any]) -> None:
        self._items = iter(items)
        self.next()

    def next(self) -> Any:
        """Go on to the next item; return it."""
        self.now = next(self._items)
        return self.now


class Waves(Frames):
    """Heights (side, side) [m] under a wave, one every `FRAME`, or what ``convert`` makes of them, before anything is
    timed. They are run through forth and back, so that successive ones always follow from one another."""

    def __init__(self, side: int, convert: Callable[[FloatGrid], Any] = np.asarray) -> None:
        self.side = side
        scene = InwardWaves(GridGeometry(rows=side, columns=side, resolution=RESOLUTION))
        count = min(max(_SAMPLES // side**2, 3), 16)
        frames = [convert(scene.heights(index * FRAME)) for index in range(count)]
        super().__init__(cycle([*frames, *frames[-2:0:-1]]))


def height_map(waves: Waves) -> HeightMap:
    """A height map under a wave."""
    return HeightMap(waves.next(), resolution=RESOLUTION)


def grid_vertices(heights: FloatGrid) -> FloatArray:
    """The same ground as vertices (V, 3) [m] of a general mesh."""
    return GroundSetup(heights=heights, resolution=RESOLUTION, dt=FRAME).vertices()


def general_mesh(waves: Waves) -> TriangleMesh:
    """A general mesh under a wave, which does not know that it is a grid."""
    return TriangleMesh(grid_vertices(waves.next()), grid_triangles(waves.side, waves.side))


class Player:
    """Bodies in a world over moving ground; each frame moves the ground and the bodies first."""

    def __init__(self, waves: Waves, mesh: MainMesh, report: ReportConfig, count: int = 1) -> None:
        self._waves = waves
        self._mesh = mesh
        self.world = ReportWorld(mesh, WorldConfig(physics=PhysicsConfig(rate=60.0)), report=report)
        # In a square around the middle of the map, none on a sample.
        rows, extent = math.ceil(math.sqrt(count)), (waves.side - 1) * RESOLUTION
        numbers = np.arange(count)
        offset = np.stack([numbers % rows, numbers // rows], axis=1) - 0.5 * (rows - 1)
        places = 0.5 * extent + min(_APART, 0.8 * extent / rows) * offset + 0.07
        heights = self.world.terrain.at(places, 0.0).heights + RADIUS
        for index, (x, y) in enumerate(places.tolist()):
            self.world.spawn(f"body_{index}", Sphere(RADIUS), 1.0, BodyState((x, y, float(heights[index]))))
        self.world.refresh()

    def time(self, bench: Bench, case: Case) -> None:
        """Measure the refresh of the patches at each frame, and end the world."""
        with self.world as world:
            bench.time(case, world.refresh, self.next_frame)

    def next_frame(self) -> None:
        """Lets the bodies move by physics, and the ground by a frame."""
        self.world.step()
        heights = self._waves.next()
        if isinstance(self._mesh, HeightMap):
            self._mesh.replace(heights, time=self.world.time)
        else:
            self._mesh.move(grid_vertices(heights), time=self.world.time)
