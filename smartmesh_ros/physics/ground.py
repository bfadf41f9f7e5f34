"""Colliders that follow bodies: the whole product for a PyBullet user."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cached_property
from typing import Any

import numpy as np

from smartmesh_ros.errors import InputError
from smartmesh_ros.patches.batch import PatchBatch
from smartmesh_ros.patches.carry_over import carried_over, kept_rows
from smartmesh_ros.patches.config import SELECTION, PatchConfig
from smartmesh_ros.patches.selector import Selector
from smartmesh_ros.patches.shapes import BODY_COLUMNS, SHAPE
from smartmesh_ros.physics.body_shapes import shape_of
from smartmesh_ros.physics.colliders.driver import Colliders
from smartmesh_ros.physics.correction_transport import CorrectionTransport
from smartmesh_ros.physics.follower import Follower, roles_of
from smartmesh_ros.physics.follower_reader import FollowerReader
from smartmesh_ros.physics.leaving import leaves_support
from smartmesh_ros.physics.shapes import Shape
from smartmesh_ros.physics.stepper import Stepper, physics_of
from smartmesh_ros.physics.usable import require_usable
from smartmesh_ros.physics.waking import Waking
from smartmesh_ros.physics.whole_mesh import WholeMesh
from smartmesh_ros.stopwatch import Stopwatch
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.terrain import MainMesh, Terrain

# Index of a tile that no support refers to yet.
NEW_TILE = -2


class Ground:
    """Keeps one small collider of a deforming terrain under each attached body of a PyBullet world.

    ``client`` is a connected `pybullet_utils.bullet_client.BulletClient` or the module ``pybullet`` itself. `attach`
    bodies, and call `step` in place of ``stepSimulation``. To call ``stepSimulation`` yourself, call `update` before
    each step, or `update` before some steps and `go_on` before the others. Fast bodies are then not clamped before
    impact, and bodies below the ground are not put back. Bodies that are not attached do not collide with the terrain.
    ``gravity`` [m/s^2]: acceleration that predicts the motion of falling bodies; `step` reads it from PyBullet.
    """

    def __init__(
        self,
        client: Any,
        terrain: MainMesh | Terrain,
        config: PatchConfig | None = None,
        stopwatch: Stopwatch | None = None,
        *,
        gravity: float = 9.81,
    ) -> None:
        self.config = config or PatchConfig()
        self.terrain = Terrain.of(terrain)
        self.stopwatch = stopwatch or Stopwatch()
        self.followers: list[Follower] = []
        self.colliders = Colliders(client)
        self.stale = True  # the next step needs an update, even if the last one has not expired
        self.time = 0.0  # of the last update [s]
        self._client = client
        self._reader = FollowerReader(client)
        self._selector = Selector(self.terrain, self.config, self.stopwatch)
        self._selector.gravity = gravity
        self._transport = CorrectionTransport(client)
        self._waking = Waking(client)
        self._whole = WholeMesh(client, self.terrain)
        self._steps = 1  # lifetime of the last update [steps]
        self.shapes = np.zeros(0, SHAPE).view(np.recarray)
        self._roles = roles_of([])
        self.states = np.empty((0, BODY_COLUMNS))  # of the attached bodies at the last update
        self.positions_w = np.empty((0, 3))  # of the attached bodies before the current step [m]
        self.moved_w = np.empty((0, 3))  # their motion in one step [m]
        self._expected_moves: list[tuple[list[int], FloatArray]] = []
        self._together: list[Follower] | None = None  # attached bodies at the end of `together`

    @property
    def supports(self) -> Any:
        """Supports of the attached bodies as of the last update: records of ``SUPPORT`` (N,)."""
        return self._selector.supports

    @property
    def batches(self) -> list[PatchBatch]:
        """Patches as of the last update; their bodies are indices into `followers`."""
        return self._selector.batches()

    @property
    def radii(self) -> FloatArray:
        """Bounding radii of the attached bodies (N,) [m]."""
        return np.asarray(self.shapes["radius"])

    def colliders_of(self, follower: Follower) -> list[int]:
        """Return the PyBullet bodies that are ground to a follower: its own collider, or those of the whole terrain."""
        return self._whole.bodies if follower.collider is None else [follower.collider]

    def will_move(self, indices: list[int], moved_w: FloatArray) -> None:
        """Set the motion of attached bodies (n,) in the next step (n, 3) [m] if it differs from their motion in the
        last one."""
        self._expected_moves.append((indices, moved_w))

    def placed(self, body: int | None = None) -> None:
        """Note that a body (None = every body) was teleported, so that this jump does not count as its motion."""
        self.colliders.renew(
            [index for index, follower in enumerate(self.followers) if body is None or follower.body == body]
        )
        self.stale = True

    @property
    def replacements(self) -> int:
        """Number of colliders whose surface was changed so far."""
        return self.colliders.replacements + self.colliders.meshes.built

    @property
    def leaked(self) -> int:
        """Number of colliders that were rebuilt so far; PyBullet leaks a few KiB for each."""
        return self.colliders.meshes.built

    def attach(
        self,
        body: int,
        link: int = -1,
        *,
        radius: float | None = None,
        solid: bool = True,
        shape: Shape | None = None,
    ) -> Follower:
        """Put a patch under ``body`` (or its ``link``).

        The shape is read from PyBullet, unless it is given: as a ``shape`` about the centre of mass, or as the
        ``radius`` [m] of a bounding sphere. ``solid=False`` computes the patch without a collider.
        """
        attached = self.followers if self._together is None else self._together
        if any(follower.body == body and follower.link == link for follower in attached):
            raise InputError("duplicate_id", f"body {body}, link {link} is attached already; detach it first")
        record = shape_of(self._client, body, link, shape, radius)
        follower = Follower(body, link, record, solid)
        follower.read_mobility(self._client)
        if self._together is None:
            self._adopt([*self.followers, follower])
        else:
            self._together.append(follower)
        return follower

    @contextmanager
    def together(self) -> Iterator[None]:
        """Collect the bodies attached and detached in the block, and apply the changes in one pass at its end."""
        self._together = [*self.followers]
        try:
            yield
        finally:
            followers, self._together = self._together, None
            self._adopt(followers)

    def detach(self, body: int) -> None:
        """Remove the patches of ``body`` and its links. Call it before the body is removed from PyBullet."""
        for index, follower in enumerate(self.followers):
            if follower.body == body:
                self.colliders.release(index)
        if self._together is None:
            self._adopt([follower for follower in self.followers if follower.body != body])
        else:
            self._together = [follower for follower in self._together if follower.body != body]

    def configure(self, config: PatchConfig, *, gravity: float | None = None) -> None:
        """Replace the settings of patches, and ``gravity`` [m/s^2] unless it is None, from the next update on. Bodies
        may rest on patches meanwhile. Raises `InputError` and changes nothing if the terrain does not allow the
        settings."""
        for mesh in self.terrain.tiles.values():
            require_usable(config, mesh)
        if config.edge_filter != self.config.edge_filter:
            self.colliders.replace_all()
        self.stale = True
        self.config = config
        self._selector.configure(config)
        if gravity is not None:
            self._selector.gravity = gravity

    def step(self, time: float, dt: float) -> None:
        """Run one ``stepSimulation`` of ``dt`` [s] from ``time`` [s] on, as `World` does.

        Refreshes the patches when they are due, puts bodies that are below the ground back onto it, and clamps fast
        bodies before impact. Raises `InputError` if ``dt`` is not PyBullet's time step.
        """
        physics = physics_of(self._client, dt)
        self._selector.gravity = math.hypot(*physics.gravity)
        self._stepper.prepare(time, physics)
        self._stepper.step(time, physics, self._client.stepSimulation)

    @property
    def rescues(self) -> int:
        """Number of bodies that `step` found below the ground and put back onto it so far."""
        return self._stepper.counts.rescues

    def update(self, time: float, dt: float, steps: int = 1) -> None:
        """Refresh every patch at ``time`` [s], for the next ``steps`` steps of ``dt`` [s]."""
        with self.stopwatch.stage("bodies"):
            self._correct(time)
            self._read_states(dt)
            if time != self.time:
                self._waking.wake(self.followers, self.states)
        self.stale, self._steps, self.time = False, steps, time
        self._selector.update(self.states, time, dt * steps)
        with self.stopwatch.stage("collider"):
            self._apply(time)

    def go_on(self, time: float, dt: float) -> bool:
        """Let the patches of the last `update` move on for a further step of ``dt`` [s]. If a body leaves the ground
        that its patch covers, for example because another body hit it, refresh the patches. Returns True if they were
        refreshed."""
        if self.stale:
            self.update(time, dt, self._steps)
            return True
        with self.stopwatch.stage("bodies"):
            before, self.positions_w = self.positions_w, self._reader.positions()
            self.moved_w = self.positions_w - before
            self._apply_expected_moves()
            left = leaves_support(
                self.positions_w, self.moved_w, self.states, self.supports, self.shapes, SELECTION.slack,
                SELECTION.fastest * dt,
            )  # fmt: skip
        if left:
            self.update(time, dt, self._steps)
        return bool(left)

    def stand_still(self, duration: float) -> None:
        """Note that time advanced by ``duration`` [s] without a step; the next step needs an `update`."""
        self.colliders.stand_still(duration)
        self.time += duration
        self.stale = True

    def close(self) -> None:
        """Remove all colliders."""
        for index in range(len(self.followers)):
            self.colliders.release(index)
        self._whole.release()
        self._adopt([])

    @cached_property
    def _stepper(self) -> Stepper:
        """The stepper of `step`; created on first use, because a `World` has its own."""
        return Stepper(self._client, self, lambda: self._roles)

    def _correct(self, time: float) -> None:
        """Apply corrections of the ground up to ``time`` [s], and move the bodies on or near the corrected ground with
        them."""
        moves = []
        numbers = {name: number for number, name in enumerate(self._selector.names)}  # the supports' tile indices
        for name, mesh in self.terrain.tiles.items():
            if isinstance(mesh, HeightMap) and mesh.motion.corrects:
                correcting, before = mesh.correcting, mesh.moved_to(time)
                mesh.show(time)
                if correcting:
                    moves.append((numbers.get(name, NEW_TILE), before, mesh.moved_to(time)))
        self.colliders.exact = bool(moves)
        if moves and self.followers:
            self._read_states(0.0)
            self._transport.move_bodies(moves, self.followers, self.shapes, self.states, self.supports)

    def _apply(self, time: float) -> None:
        """Set the colliders to the current supports."""
        config = self.config
        if config.kind == "whole_trimesh" or config.kind == "whole_heightfield":
            self._whole.update(config.kind, time)
        else:
            self._whole.release()
        meshes = config.grid_kind in ("trimesh", "hull", "prisms") or bool(self._selector.mesh_patches)
        batches = self.batches if meshes else []
        self.colliders.release_meshes(batches)
        self.colliders.apply(self._selector, self.shapes, time, config)
        self.colliders.apply_meshes(batches, self.supports, config)
        self._waking.note(self.colliders.changed)

    def _adopt(self, followers: list[Follower]) -> None:
        """Replace the list of attached bodies; the data of those that stay is kept."""
        kept = kept_rows(self.followers, followers)
        count = len(followers)
        self.followers = followers
        self.stale = True
        self._reader.adopt(followers)
        shapes = np.array([follower.shape for follower in followers], SHAPE)
        self.shapes = shapes.view(np.recarray)
        self.states = carried_over(self.states, kept, np.full((count, BODY_COLUMNS), np.nan))
        self.positions_w = carried_over(self.positions_w, kept, np.full((count, 3), np.nan))
        self.moved_w = carried_over(self.moved_w, kept, np.zeros((count, 3)))
        self._expected_moves.clear()
        self._roles = roles_of(followers)
        self.colliders.adopt(followers, kept)
        self._waking.adopt(kept)
        solid = np.array([follower.solid for follower in followers], bool)
        self._selector.adopt(self.shapes, solid, kept)

    def _read_states(self, dt: float) -> None:
        self.states = self._reader.states()
        self.positions_w = np.ascontiguousarray(self.states[:, :3])  # one array type for compiled functions
        self.moved_w = self.states[:, 7:10] * dt
        self._expected_moves.clear()

    def _apply_expected_moves(self) -> None:
        for indices, moved_w in self._expected_moves:
            self.moved_w[indices] = moved_w
        self._expected_moves.clear()
