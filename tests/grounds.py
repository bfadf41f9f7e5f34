"""Height maps for tests, and maps that come while a world steps."""

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from smartmesh_ros import BodyState, Deck, HeightMap, PhysicsConfig, Soil, SoilType, Terrain, World, WorldConfig
from smartmesh_ros.ground.shapes import Shape
from smartmesh_ros.ground.shown_patches import PatchTable
from smartmesh_ros.terrain.terrain import MainMesh
from tests.bodies import rotation

Soils = SoilType | str | Sequence[SoilType | str]
Form = Callable[[np.ndarray, np.ndarray], ArrayLike]  # heights [m] by x and y [m]


def shaped(form: Form, side: int = 41, resolution: float = 0.1, **options: Any) -> HeightMap:
    """A square map of a form around the origin, of so many samples a side."""
    half = 0.5 * (side - 1) * resolution
    x, y = np.meshgrid(*[resolution * np.arange(side) - half] * 2)
    return HeightMap(np.broadcast_to(form(x, y), x.shape), resolution=resolution, origin=(-half, -half), **options)


def level(side: int = 41, resolution: float = 0.1, **options: Any) -> HeightMap:
    """A square map at height zero around the origin, of so many samples a side."""
    return shaped(lambda x, y: 0.0, side, resolution, **options)


def world_of(ground: MainMesh | Terrain, **physics: Any) -> World:
    """A world with some settings of its physics."""
    return World(ground, WorldConfig(physics=PhysicsConfig(**physics)))


def on_soil(ground: HeightMap | Terrain, soil: Soils, spacing: float = 0.01, **physics: Any) -> World:
    """A world on soil, with samples of a ``spacing`` [m] and some settings of its physics."""
    world = world_of(ground, **physics)
    world.ground.set_soil(Soil(world.terrain, soil, spacing=spacing))
    return world


def terrain_of(**tiles: MainMesh | Deck) -> Terrain:
    """A terrain of several maps, meshes or decks."""
    terrain = Terrain()
    for name, mesh in tiles.items():
        terrain.put(name, mesh)
    return terrain


def add(world: World, name: str, body: Shape | str, start: BodyState, mass: float = 1.0, **options: Any) -> None:
    """Spawn a body of a shape, or the robot of a description."""
    if isinstance(body, str):
        world.spawn_robot(name, body, start, **options)
    else:
        world.spawn(name, body, mass, start, **options)


def end_of(
    ground: MainMesh | Terrain, body: Shape | str, start: BodyState, steps: int, mass: float = 1.0, **physics: Any
) -> BodyState:
    """The state of a body or a robot after so many steps in a world of its own with some settings of its physics."""
    with world_of(ground, **physics) as world:
        add(world, "body", body, start, mass)
        world.step(steps)
        return world.state("body")


def moving(world: World, heights: Callable[[float], ArrayLike], steps: int, every: int = 4) -> Iterator[int]:
    """Step a world on one height map, and yield the number of each step that was made. Before every so many-th one a
    map comes of ``heights`` at its time [m], of one height or (rows, columns)."""
    ground = world.terrain.tiles[""]
    for step in range(steps):
        if step % every == 0:
            ground.replace(np.broadcast_to(heights(world.time), ground.heights.shape), time=world.time)
        world.step()
        yield step


def step_on_moving(world: World, heights: Callable[[float], ArrayLike], steps: int, every: int = 4) -> None:
    """Step a world as `moving` does."""
    for _ in moving(world, heights, steps, every):
        pass


def energy_of(world: World, name: str) -> float:
    """Energy [J] of a body, of which its weight has none at a height of zero."""
    state, (mass, _, inertia, *_) = world.state(name), world.client.getDynamicsInfo(world.bodies[name].uid, -1)
    spin = rotation(state.orientation).T @ state.angular
    moving = mass * np.dot(state.linear, state.linear) + inertia @ spin**2
    return float(0.5 * moving + 9.81 * mass * state.position[2])


def said_by(world: World) -> list[str]:
    """What a world tells its user from now on."""
    said: list[str] = []
    world.say = said.append
    return said


def patch_of(table: PatchTable, index: int) -> tuple[np.ndarray, np.ndarray]:
    """The points (k, 3) [m] and triangles (t, 3) of one patch of a table."""
    columns = ((table.points_w, table.counts), (table.triangles, table.triangle_counts))
    points, triangles = (np.split(values, np.cumsum(counts)[:-1])[index] for values, counts in columns)
    return points, triangles
