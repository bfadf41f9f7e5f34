"""The child process of `Workshop`: reads meshes, makes hulls of them, and loads robots, as the simulation will."""

from __future__ import annotations

import math
import tempfile
from contextlib import suppress
from dataclasses import replace
from multiprocessing.connection import Connection
from pathlib import Path

import numpy as np
import pybullet as pb

from smartmesh_ros.core import CORE
from smartmesh_ros.errors import InputError
from smartmesh_ros.ground.bullet import own_client
from smartmesh_ros.ground.config import PhysicsConfig
from smartmesh_ros.ground.state import BodyState
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.world.bodies import BodyFactory
from smartmesh_ros.world.robots.meshes import mesh_parts
from smartmesh_ros.world.robots.prepared import Mesh, PreparedRobot
from smartmesh_ros.world.robots.workshop import IDLE

# Most vertices of all hulls of a robot, beyond which each hull keeps those that hold the others but for a millimetre.
# PyBullet loads some 700 vertices in a millisecond.
MOST_VERTICES = 8000
# Distance from the hull of the vertices that are kept, up to which others are left out [m].
MOST_OUTSIDE = 1e-3
# Directions that are tried at once.
TRIED = 64
# Steps of the trial. A robot that crashes PyBullet does so in its first.
STEPS = 2


def main(pipe: int) -> None:
    """Make the robots that arrive on a connection, given by its file descriptor, until it ends or is idle."""
    with Connection(pipe) as robots, suppress(EOFError):
        while robots.poll(IDLE):
            robot = robots.recv()
            try:
                robots.send(make(robot))
            except InputError as error:
                robots.send(error)


def make(robot: PreparedRobot) -> dict[str, bytes]:
    """Return the mesh files of a robot, after a trial of them. Raises `InputError`."""
    parts = {mesh: _hulls(mesh) for mesh in robot.meshes}
    allowed = MOST_VERTICES // max(sum(len(parts[mesh]) for mesh in robot.meshes), 1)
    files = {mesh.name: _obj([fewer_vertices(hull, allowed) for hull in hulls]) for mesh, hulls in parts.items()}
    with own_client() as client:
        factory = BodyFactory(client, PhysicsConfig())
        factory.robot("robot", replace(robot, files=files), BodyState())
        for _ in range(STEPS):
            client.stepSimulation()
    return files


def _hulls(mesh: Mesh) -> list[FloatArray]:
    """Return the vertices (n, 3) [m] of the convex hulls that PyBullet makes of a mesh's parts."""
    hulls = []
    try:
        with own_client() as client, tempfile.TemporaryDirectory() as folder:
            for number, points in enumerate(mesh_parts(mesh.path, mesh.scale)):
                file = Path(folder) / f"{number}.obj"
                file.write_bytes(_obj([points]))
                shape = client.createCollisionShape(pb.GEOM_MESH, fileName=str(file))
                body = client.createMultiBody(1.0, shape)
                count, vertices = client.getMeshData(body, -1)
                hulls.append(np.array(vertices, np.float64) if count else points)
    except pb.error as error:
        raise InputError("asset", f"collision mesh {str(mesh.path)!r} has no convex hull: {error}") from None
    return hulls


def _obj(parts: list[FloatArray]) -> bytes:
    """Return an OBJ file with an object for each part. Its facets have no meaning, but use every point."""
    lines, first = [], 1
    for number, points in enumerate(parts):
        lines.append(f"o part{number}")
        lines += [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in points.tolist()]
        last = first + len(points) - 1
        lines += [f"f {k} {min(k + 1, last)} {min(k + 2, last)}" for k in range(first, last + 1, 3)]
        first = last + 1
    return "\n".join([*lines, ""]).encode()


def fewer_vertices(vertices: FloatArray, count: int) -> FloatArray:
    """Return vertices (k, 3) [m] of a hull (n, 3): those farthest along ``count`` directions, and enough others that
    none is farther than a millimetre outside their hull."""
    if len(vertices) <= count:
        return vertices
    kept, others = _extreme(vertices, _directions(count)), vertices
    while True:
        others = others[CORE.distances_outside(kept, np.ascontiguousarray(others)) > MOST_OUTSIDE]
        if not len(others):
            return kept
        kept = np.concatenate([kept, _extreme(others, _directions(TRIED))])


def _directions(count: int) -> FloatArray:
    """Return unit directions (count, 3), evenly spread (a Fibonacci lattice)."""
    k = np.arange(count) + 0.5
    z, angle = 1.0 - 2.0 * k / count, math.pi * (1.0 + math.sqrt(5.0)) * k
    aside = np.sqrt(1.0 - z * z)
    return np.column_stack([aside * np.cos(angle), aside * np.sin(angle), z])


def _extreme(vertices: FloatArray, along: FloatArray) -> FloatArray:
    """Return the vertices that are farthest along one of some directions (d, 3), after scaling all to equal extents
    along each axis, so that thin parts keep as many as others."""
    extents = np.ptp(vertices, axis=0)
    evened = vertices / np.where(extents > 0.0, extents, 1.0)
    farthest = [(evened @ part.T).argmax(axis=0) for part in np.array_split(along, -(-len(along) // TRIED))]
    return np.ascontiguousarray(vertices[np.unique(np.concatenate(farthest))])
