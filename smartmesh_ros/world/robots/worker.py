"""The child process of `Workshop`: reads meshes, makes hulls of them, and loads robots, as the simulation will."""

from __future__ import annotations

import tempfile
from contextlib import suppress
from dataclasses import replace
from multiprocessing.connection import Connection
from pathlib import Path

import numpy as np
import pybullet as pb

from smartmesh_ros.errors import InputError
from smartmesh_ros.ground.bullet import own_client
from smartmesh_ros.ground.config import PhysicsConfig
from smartmesh_ros.ground.state import BodyState
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.world.bodies import BodyFactory
from smartmesh_ros.world.robots.hull_vertices import fewer_vertices
from smartmesh_ros.world.robots.meshes import mesh_parts
from smartmesh_ros.world.robots.prepared import Mesh, PreparedRobot
from smartmesh_ros.world.robots.workshop import IDLE

# Most vertices of all hulls of a robot, beyond which each hull keeps those that hold the others but for a millimetre.
# PyBullet loads some 700 vertices in a millisecond.
MOST_VERTICES = 8000
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
