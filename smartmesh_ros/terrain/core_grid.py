"""The height maps and meshes that the C++ core reads."""

from __future__ import annotations

from typing import Any

from smartmesh_ros.core import CORE, as_bytes


def core_grid_of(heightmap: Any) -> Any:
    """Return the core's reader of a height map, which shares its arrays."""
    heights, velocities, clocks, offsets = heightmap.arrays
    grid = CORE.Grid(heights, velocities, offsets, as_bytes(clocks))
    update_core_grid(grid, heightmap)
    tell_friction(grid, heightmap.friction)
    return grid


def tell_friction(grid: Any, friction: Any) -> None:
    """Tell the core the coefficient of friction, one number or (rows, columns)."""
    if isinstance(friction, float):
        grid.set_friction(None, friction)
    else:
        grid.set_friction(friction, 1.0)


def update_core_grid(grid: Any, heightmap: Any) -> None:
    """Tell the core the pose, the motion and the settings of a height map."""
    geometry, track, motion = heightmap.geometry, heightmap.track, heightmap.motion
    grid.place(*geometry.origin, geometry.yaw, geometry.resolution)
    grid.move(track.time, track.interval, *track.motion)
    grid.set_motion(motion.code, motion.max_velocity, motion.settle, heightmap.noise, heightmap.shown)


def core_mesh_of(mesh: Any) -> Any:
    """Return the core's reader of a general mesh, which shares its arrays."""
    now, velocities, clock = mesh.arrays
    made = CORE.Mesh(now, velocities, as_bytes(clock), mesh.triangles)
    made.set_motion(mesh.motion.code, mesh.motion.max_velocity)
    return made
