"""The three-dimensional part of the page."""

from __future__ import annotations

from collections import defaultdict
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.tools.client.patch import Patch
from smartmesh_ros.tools.view import looks
from smartmesh_ros.tools.view.ground import Ground
from smartmesh_ros.tools.view.looks import PatchLook
from smartmesh_ros.tools.view.robots import Robot
from smartmesh_ros.tools.view.sight import Appearance, Sight
from smartmesh_ros.tools.view.terrain_scene import TerrainScene

# Height at which patches are drawn above the ground [m], and length of the longest arrow, in radii of a body.
LIFT = 0.006
ARROW = 2.5
# Light from the sky and from a low sun, whose shading makes slopes visible.
SKY, SUN, TOWARDS_SUN = (225, 236, 255), (255, 240, 214), (-3.5, 7.0, 5.5)
# Radius of bodies of unknown size [m].
DEFAULT_RADIUS = 0.25


class Shape(NamedTuple):
    """Key of bodies that are drawn as one batch."""

    kind: int
    dimensions: tuple[float, ...]
    tracked: bool


class Scene:
    """Draws the terrain and a sight in a viser scene."""

    def __init__(self, server: Any) -> None:
        self._server, self._scene = server, server.scene
        self._terrain = TerrainScene(server.scene)
        self._bodies: dict[Shape, Any] = {}
        self._patches: dict[PatchLook, Any] = {}
        self._robots: dict[str, Robot] = {}
        self._contacts: Any = None
        self.show_contacts = True
        self.show_sunk = False
        self._selected: Any = None
        scene = self._scene
        scene.set_up_direction("+z")
        scene.configure_environment_map(None)
        scene.configure_default_lights(enabled=False)
        scene.add_light_hemisphere("/lights/sky", sky_color=SKY, ground_color=(170, 158, 142), intensity=1.7)
        # Far ground fades into the page.
        scene.configure_fog(near=40.0, far=160.0, color=(255, 255, 255))
        self.light(shadows=False)

    def show(self, ground: Ground, sight: Sight) -> None:
        """Refresh the whole scene."""
        positions, radii = bodies_of(sight)
        with self._server.atomic():
            self._terrain.show(ground, positions, radii, sunk=self.show_sunk)
            self._show_patches(sight.patches)
            self._show_robots(sight)
            self._show_bodies(sight)
            self._show_contacts(sight, float(np.median(radii)) if len(radii) else DEFAULT_RADIUS)

    def mark(self, position: tuple[float, float, float] | None, radius: float = DEFAULT_RADIUS) -> None:
        """Mark a position by a ring; None removes the ring."""
        if self._selected is None:
            ring = looks.ring()
            self._selected = self._scene.add_mesh_simple(
                "/selected", ring.vertices, ring.faces, color=looks.SELECTED, cast_shadow=False, side="double"
            )
        self._selected.visible = position is not None
        if position is not None:
            self._selected.position, self._selected.scale = position, 1.4 * radius

    def light(self, *, shadows: bool) -> None:
        """Set the sun, with shadows or without."""
        self._scene.add_light_directional(
            "/lights/sun", color=SUN, intensity=2.3, position=TOWARDS_SUN, cast_shadow=shadows
        )

    def _show_patches(self, patches: list[Patch]) -> None:
        groups: dict[PatchLook, list[Patch]] = defaultdict(list)
        for patch in patches:
            if len(patch.triangles):
                groups[looks.patch_look(patch.kind, patch.stride)].append(patch)
        for look in PatchLook:
            self._show_patches_of(look, groups.get(look, []))

    def _show_patches_of(self, look: PatchLook, patches: list[Patch]) -> None:
        known = self._patches.get(look)
        if not patches:
            if known is not None:
                known.visible = False
            return
        vertices, triangles = merged(patches)
        if known is not None and np.array_equal(known.faces, triangles):
            known.vertices = vertices
            known.visible = True
        else:
            self._patches[look] = self._scene.add_mesh_simple(
                f"/patches/{look.name.lower()}",
                vertices,
                triangles,
                color=look.colour,
                side="double",
                cast_shadow=False,
            )

    def _show_bodies(self, sight: Sight) -> None:
        groups: dict[Shape, list[str]] = defaultdict(list)
        for name, appearance in sight.appearances.items():
            robot = self._robots.get(name)
            if name in sight.poses and (not appearance.urdf or (robot is not None and not robot.readable)):
                groups[_shape_of(appearance)].append(name)
        for shape in set(self._bodies) - set(groups):
            self._bodies.pop(shape).remove()
        for shape, names in groups.items():
            poses = [sight.poses[name] for name in names]
            positions = np.array([pose.position for pose in poses], np.float32)
            turns = np.array([pose.wxyz for pose in poses], np.float32)
            colours = np.array([_colour_of(shape, asleep=name in sight.asleep) for name in names], np.uint8)
            known = self._bodies.get(shape)
            if known is not None and len(known.batched_positions) == len(names):
                known.batched_positions, known.batched_wxyzs = positions, turns
                if not np.array_equal(known.batched_colors, colours):
                    known.batched_colors = colours
            else:
                self._bodies[shape] = self._add_bodies(shape, positions, turns, colours)

    def _add_bodies(
        self, shape: Shape, positions: NDArray[np.float32], turns: NDArray[np.float32], colours: NDArray[np.uint8]
    ) -> Any:
        mesh = looks.with_edges(looks.shape_mesh(shape.kind, shape.dimensions))
        sizes = "_".join(f"{value:g}" for value in shape.dimensions)
        return self._scene.add_batched_meshes_simple(
            f"/bodies/{shape.kind}_{sizes}{'_tracked' * shape.tracked}", mesh.vertices, mesh.faces, turns, positions,
            batched_colors=colours, flat_shading=False, lod="off",
        )  # fmt: skip

    def _show_robots(self, sight: Sight) -> None:
        robots = {name: known for name, known in sight.appearances.items() if known.urdf}
        for name in list(self._robots):
            if self._robots[name].appearance != robots.get(name):
                self._robots.pop(name).remove()
        for name, appearance in robots.items():
            if name not in self._robots:
                self._robots[name] = Robot(self._server, name, appearance)
            if (base := self._robots[name].base_in(sight)) is not None:
                self._robots[name].place(base, sight.joints)

    def _show_contacts(self, sight: Sight, radius: float) -> None:
        points = looks.arrows(*sight.contacts, ARROW * radius) if self.show_contacts else np.zeros((0, 2, 3))
        if not len(points):
            if self._contacts is not None:
                self._contacts.visible = False
            return
        if self._contacts is None:
            self._contacts = self._scene.add_arrows(
                "/contacts", points, looks.CONTACT, shaft_radius=0.06 * radius, head_radius=0.16 * radius,
                head_length=0.4 * radius,
            )  # fmt: skip
        else:
            self._contacts.points = points.astype(np.float32)
            self._contacts.visible = True


def bodies_of(sight: Sight) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return positions (B, 3) and radii (B,) [m] of all bodies."""
    names = list(sight.poses)
    positions = np.array([sight.poses[name].position for name in names]).reshape(-1, 3)
    return positions, np.array([radius_of(sight, name) for name in names])


def radius_of(sight: Sight, name: str) -> float:
    """Return the radius of a body [m]; robots have a common default."""
    known = sight.appearances.get(name)
    if known is None or known.urdf or not known.dimensions:
        return DEFAULT_RADIUS if known is None else 2.0 * DEFAULT_RADIUS
    return looks.radius_of(known.kind, known.dimensions)


def merged(patches: list[Patch]) -> tuple[NDArray[np.float32], NDArray[np.uint32]]:
    """Return one mesh of several patches: vertices (V, 3) [m], `LIFT` above the ground, and triangles (T, 3)."""
    starts = np.cumsum([0] + [len(patch.vertices_w) for patch in patches])
    triangles = [patch.triangles + start for patch, start in zip(patches, starts[:-1].tolist(), strict=True)]
    vertices = np.concatenate([patch.vertices_w for patch in patches])
    vertices = np.nan_to_num(vertices + (0.0, 0.0, LIFT)).astype(np.float32)
    return vertices, np.concatenate(triangles).astype(np.uint32)


def _colour_of(shape: Shape, *, asleep: bool) -> looks.Colour:
    """Return the colour of a body; a sleeping one is greyed."""
    colour = looks.TRACKED if shape.tracked else looks.BODY_COLOURS.get(shape.kind, looks.TRACKED)
    return looks.greyed(colour) if asleep else colour


def _shape_of(appearance: Appearance) -> Shape:
    if appearance.urdf:
        return Shape(0, (2.0 * DEFAULT_RADIUS,), tracked=True)
    return Shape(appearance.kind, appearance.dimensions, appearance.tracked)
