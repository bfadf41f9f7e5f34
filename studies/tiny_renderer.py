"""Pictures of ground and bodies by PyBullet's software renderer, which needs neither a window nor a graphics card."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pybullet as pb
from numpy.typing import NDArray
from pybullet_utils.bullet_client import BulletClient

from smartmesh_ros import HeightMap, World
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.terrain.trimesh import grid_triangles

NEAR, FAR = 0.2, 60.0  # planes of the camera [m]
LIGHT = (-6.0, -3.0, 5.0)  # direction to the light
BACKGROUND = 255
TILE = 100  # rows of a mesh


@dataclass(frozen=True)
class Camera:
    """Where a picture is taken from: ``eye`` and ``target`` [m], the vertical angle of view [degrees], and the size of
    the picture [pixels]."""

    eye: tuple[float, float, float]
    target: tuple[float, float, float]
    angle: float
    width: int
    height: int

    def matrices(self) -> tuple[Any, Any]:
        """Return the view and the projection matrix, as PyBullet takes them: 16 numbers, column by column."""
        view = pb.computeViewMatrix(self.eye, self.target, (0.0, 0.0, 1.0))
        return view, pb.computeProjectionMatrixFOV(self.angle, self.width / self.height, NEAR, FAR)

    def pixels(self, points: FloatArray) -> FloatArray:
        """Return the column and row (N, 2) of the pixels that show ``points`` (N, 3) [m]."""
        view, projection = (np.reshape(matrix, (4, 4)).T for matrix in self.matrices())
        seen = np.column_stack([points, np.ones(len(points))]) @ (projection @ view).T
        x, y = seen[:, 0] / seen[:, 3], seen[:, 1] / seen[:, 3]
        return np.column_stack([0.5 * (1.0 + x) * (self.width - 1), 0.5 * (1.0 - y) * (self.height - 1)])


@dataclass(frozen=True)
class Shot:
    """A picture (H, W, 3), the id of the body in each pixel (H, W), -1 for none, and the point that the pixel shows
    (H, W, 3) [m]."""

    colours: NDArray[np.uint8]
    uids: NDArray[np.int64]
    points: FloatArray


class Stage:
    """A PyBullet client that draws: bodies without physics, and ground that is replaced for each picture."""

    def __init__(self) -> None:
        self.client = BulletClient(pb.DIRECT)
        self.ground: list[int] = []

    def add(self, shape: int, colour: tuple[float, float, float], **settings: Any) -> int:
        """Return the id of a new body with the form ``shape``, such as ``pybullet.GEOM_BOX``."""
        visual = self.client.createVisualShape(shape, rgbaColor=(*colour, 1.0), **settings)
        return int(self.client.createMultiBody(0.0, -1, visual))

    def add_robot(self, world: World, name: str, file: str) -> None:
        """Draw a robot of a world, as it stands there, by the file of its description."""
        uid, robot = self.client.loadURDF(file, useFixedBase=True), world.bodies[name]
        self.client.resetBasePositionAndOrientation(uid, *world.client.getBasePositionAndOrientation(robot.uid))
        for joint in robot.joints.values():
            self.client.resetJointState(uid, joint, world.client.getJointState(robot.uid, joint)[0])

    def replace_ground(self, *surfaces: tuple[FloatArray, tuple[float, float, float]]) -> None:
        """Draw ``surfaces`` from now on: points (rows, columns, 3) [m] and a colour each."""
        for uid in self.ground:
            self.client.removeBody(uid)
        self.ground = []
        for points, colour in surfaces:
            normals = np.cross(np.gradient(points, axis=1), np.gradient(points, axis=0)).reshape(-1, 3)
            normals /= np.linalg.norm(normals, axis=1, keepdims=True)
            triangles = grid_triangles(*points.shape[:2])
            mesh = {"vertices": points.reshape(-1, 3).tolist(), "indices": triangles.ravel().tolist()}
            self.ground.append(self.add(pb.GEOM_MESH, colour, normals=normals.tolist(), **mesh))

    def replace_heights(self, ground: HeightMap, colour: tuple[float, float, float]) -> None:
        """Draw a map from now on, in tiles: PyBullet draws no mesh of all samples."""
        rows, columns = np.indices(ground.heights.shape)
        points = ground.geometry.to_world(rows, columns)
        points = np.dstack([points[..., :2], ground.heights.astype(np.float64)])
        self.replace_ground(*((points[row : row + TILE + 1], colour) for row in range(0, len(points) - 1, TILE)))

    def shoot(self, camera: Camera) -> Shot:
        """Take a picture."""
        view, projection = camera.matrices()
        width, height, colours, depth, uids = self.client.getCameraImage(
            camera.width, camera.height, view, projection, lightDirection=LIGHT, shadow=0,
            renderer=pb.ER_TINY_RENDERER,
        )  # fmt: skip
        picture = np.reshape(colours, (height, width, 4))[:, :, :3].astype(np.uint8)
        shown = np.reshape(uids, (height, width)).astype(np.int64)
        picture[shown < 0] = BACKGROUND
        x, y = np.meshgrid(np.linspace(-1.0, 1.0, width), np.linspace(1.0, -1.0, height))
        seen = np.stack([x, y, 2.0 * np.reshape(depth, (height, width)) - 1.0, np.ones_like(x)], axis=-1)
        turn = np.reshape(projection, (4, 4)).T @ np.reshape(view, (4, 4)).T
        points = seen @ np.linalg.inv(turn).T
        return Shot(picture, shown, points[:, :, :3] / points[:, :, 3:])
