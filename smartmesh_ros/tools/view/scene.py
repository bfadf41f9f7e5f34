"""The three-dimensional part of the page."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray
from smartmesh_msgs.msg import BodyDescription

from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.tools.client.ground import Ground
from smartmesh_ros.tools.client.patch import Patch
from smartmesh_ros.tools.client.sight import DEFAULT_RADIUS, Sight
from smartmesh_ros.tools.view import looks
from smartmesh_ros.tools.view.looks import PatchLook
from smartmesh_ros.tools.view.robots import Robot
from smartmesh_ros.tools.view.terrain_scene import Mesh, Meshes, TerrainScene

# Height at which patches are drawn above the ground [m], and length of the longest arrow, in radii of a body.
LIFT = (0.0, 0.0, 0.006)
ARROW = 2.5
# Light from the sky and from a low sun, whose shading makes slopes visible.
SKY, SUN, SUN_AT = (225, 236, 255), (255, 240, 214), (-3.5, 7.0, 5.5)
# Key of bodies that are drawn as one batch: kind and dimensions of BodyDescription, and whether they are tracked.
Shape = tuple[int, tuple[float, ...], bool]


class Scene:
    """Draws the terrain and a sight in a viser scene."""

    def __init__(self, server: Any) -> None:
        self._server, self._scene = server, server.scene
        self._terrain, self._patches = TerrainScene(server.scene), Meshes(server.scene)
        self._bodies: dict[Shape, Any] = {}
        self._robots: dict[str, Robot] = {}
        self.show_contacts = True
        self.show_sunk = False
        scene = self._scene
        scene.configure_environment_map(None)
        scene.configure_default_lights(enabled=False)
        scene.add_light_hemisphere("/lights/sky", sky_color=SKY, ground_color=(170, 158, 142), intensity=1.7)
        # Far ground fades into the page.
        scene.configure_fog(near=40.0, far=160.0, color=(255, 255, 255))
        self.light(shadows=False)
        self._contacts = scene.add_arrows("/contacts", np.zeros((1, 2, 3)), looks.CONTACT, visible=False)
        self._selected = scene.add_icosphere("/selected", color=looks.SELECTED, wireframe=True, visible=False)

    def show(self, ground: Ground, sight: Sight) -> None:
        """Refresh the whole scene."""
        (positions, radii), patches = sight.bodies, list(sight.patches.values())
        self._terrain.show(ground, positions, radii, patches, sunk=self.show_sunk)
        self._patches.show(patch_meshes(patches, ground))
        self._show_robots(sight)
        self._show_bodies(sight)
        self._show_contacts(sight, float(np.median(radii)) if len(radii) else DEFAULT_RADIUS)

    @property
    def faults(self) -> list[str]:
        """Why robots are drawn as boxes."""
        return [f"{name} is drawn as a box: {robot.fault}" for name, robot in self._robots.items() if robot.fault]

    def mark(self, position: tuple[float, float, float] | None, radius: float = DEFAULT_RADIUS) -> None:
        """Mark a position by a wire ball; None removes it."""
        ball = self._selected
        ball.visible, ball.position, ball.scale = position is not None, position or (0.0, 0.0, 0.0), 1.2 * radius

    def light(self, *, shadows: bool) -> None:
        """Set the sun, with shadows or without."""
        self._scene.add_light_directional("/lights/sun", color=SUN, intensity=2.3, position=SUN_AT, cast_shadow=shadows)

    def _show_bodies(self, sight: Sight) -> None:
        groups: dict[Shape, list[str]] = defaultdict(list)
        for name, known in sight.appearances.items():
            if name in sight.poses and (name not in self._robots or self._robots[name].fault):
                groups[*sight.shape_of(name), known.tracked].append(name)
        for shape in self._bodies.keys() - groups.keys():
            self._bodies.pop(shape).remove()
        for shape, names in groups.items():
            kind, dimensions, tracked = shape
            positions, turns = (values.astype(np.float32) for values in sight.placed(names))
            colours = looks.body_colours(kind, tracked, [name in sight.asleep for name in names])
            batch = self._bodies.get(shape)
            if batch is None or len(batch.batched_positions) != len(names):
                mesh = looks.shape_mesh(kind, dimensions).smooth_shaded  # but for edges, whose vertices are separate
                sizes = "_".join(map(str, dimensions))
                batch = self._bodies[shape] = self._scene.add_batched_meshes_simple(
                    f"/bodies/{kind}_{sizes}{'_tracked' * tracked}", mesh.vertices, mesh.faces, turns,
                    positions, batched_colors=colours, flat_shading=False, lod="off",
                )  # fmt: skip
            batch.batched_positions, batch.batched_wxyzs, batch.batched_colors = positions, turns, colours

    def _show_robots(self, sight: Sight) -> None:
        robots = {name: known for name, known in sight.appearances.items() if known.shape == BodyDescription.ROBOT}
        for name in list(self._robots):
            if self._robots[name].appearance != robots.get(name):
                self._robots.pop(name).remove()
        for name, appearance in robots.items():
            if name not in self._robots:
                self._robots[name] = Robot(self._server, name, appearance)
            self._robots[name].show(sight)

    def _show_contacts(self, sight: Sight, radius: float) -> None:
        points = looks.arrows(sight.contacts, ARROW * radius)
        shown = self._contacts
        shown.visible = self.show_contacts and len(points) > 0
        if shown.visible:
            shown.points = points
            shown.shaft_radius, shown.head_radius, shown.head_length = 0.06 * radius, 0.16 * radius, 0.4 * radius


def patch_meshes(patches: Iterable[Patch], ground: Ground) -> dict[str, Mesh]:
    """Return one mesh of the patches of each look, `LIFT` above the ground, and of each deck, in its frame."""
    groups: dict[tuple[str, PatchLook], list[tuple[FloatArray, NDArray[np.uint32]]]] = defaultdict(list)
    for patch in patches:
        if len(patch.triangles):
            root, vertices = placed(patch, ground)
            groups[root, looks.patch_look(patch.kind, patch.stride)].append((vertices, patch.triangles))
    meshes = {}
    for (root, look), group in groups.items():
        vertices, triangles = trimesh.util.append_faces(*zip(*group, strict=True))
        vertices = np.nan_to_num(vertices + LIFT).astype(np.float32)
        path = f"{root}/patches/{look.name.lower()}"
        meshes[path] = Mesh(vertices, triangles.astype(np.uint32), look.colour, "double")
    return meshes


def placed(patch: Patch, ground: Ground) -> tuple[str, FloatArray]:
    """Return the path of the frame in which a patch is drawn, and its vertices there [m]: on a deck, which may have
    moved since, those of its map."""
    deck, tile = ground.deck_of(patch.tile), ground.tiles.get(patch.tile)
    if deck is None or not isinstance(tile, HeightMap):
        return "", patch.vertices_w
    vertices = ground.frames[deck].inside(patch.vertices_w)
    heights = tile.at(vertices[:, :2], 0.0).heights
    vertices[:, 2] = np.where(np.isnan(heights), vertices[:, 2], heights)
    return f"/decks/{deck}", vertices
