"""Colliders that follow bodies: the whole product for a PyBullet user."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from smartmesh_ros.errors import InputError
from smartmesh_ros.patches.batch import GridBatch, PatchBatch, PlaneBatch
from smartmesh_ros.patches.config import PatchConfig
from smartmesh_ros.patches.lively import OFTEN
from smartmesh_ros.patches.moving import reach_of
from smartmesh_ros.patches.tracker import PatchTracker
from smartmesh_ros.physics.bounds import bounding_radius, is_ball
from smartmesh_ros.physics.colliders import FIELD, MESH, PLANE, Colliders
from smartmesh_ros.physics.fields import Fields, base_over_holes, groups
from smartmesh_ros.physics.follower import Follower
from smartmesh_ros.physics.movement import Movement
from smartmesh_ros.physics.prediction import Ahead, Prediction
from smartmesh_ros.physics.usable import require_usable
from smartmesh_ros.physics.whole_mesh import WholeMesh
from smartmesh_ros.stopwatch import Stopwatch
from smartmesh_ros.terrain.grid import FloatArray, IntArray
from smartmesh_ros.terrain.heightmap import Samples
from smartmesh_ros.terrain.terrain import MainMesh, Terrain

# A body may go farther than a patch was made for by this share of its radius: it touches ground nearer than that.
SLACK = 0.2


class Ground:
    """Keeps one small collider of a deforming terrain under each attached body of a PyBullet world.

    ``client`` is a connected `pybullet_utils.bullet_client.BulletClient` or the module ``pybullet`` itself. `attach`
    bodies, and call `update` before each ``stepSimulation``, or before some of them and `go_on` before the others.
    Nothing else in the world collides with the terrain.
    """

    def __init__(
        self,
        client: Any,
        terrain: MainMesh | Terrain,
        config: PatchConfig | None = None,
        stopwatch: Stopwatch | None = None,
    ) -> None:
        self.config = config or PatchConfig()
        self.terrain = Terrain.of(terrain)
        self.stopwatch = stopwatch or Stopwatch()
        self.followers: list[Follower] = []
        self._client = client
        self._movement = Movement(client)
        self._tracker = PatchTracker(self.terrain, self.config, self.stopwatch)
        self._colliders = Colliders(client)
        self._prediction = Prediction()
        self._whole = WholeMesh(client, self.terrain)
        self._applied: list[tuple[PatchBatch, IntArray]] = []  # batches as of the last update, and whom they carry
        self._radii = np.empty(0)
        self._solid = np.empty(0, bool)
        # As of the last update: how far bodies get until the next one, where they were, how far from there they may go,
        # and for how many steps it was made.
        self._reach = np.empty(0)
        self._from_w = np.empty((0, 3))
        self._farthest = np.empty(0)
        self._steps = 1
        self.stale = True  # whether the next step needs an update, whatever the last one was made for
        self._together: list[Follower] | None = None  # what is attached within `together`

    @property
    def batches(self) -> list[PatchBatch]:
        """Patches as of the last update; their bodies are indices into `followers`."""
        return self._tracker.batches

    @property
    def carrying(self) -> list[PatchBatch]:
        """Those of them that have colliders."""
        return self._tracker.of_solid

    @property
    def positions_w(self) -> FloatArray:
        """Positions of the followers at the last update (N, 3) [m]."""
        return self._movement.positions_w

    @property
    def radii(self) -> FloatArray:
        """Their bounding radii (N,) [m]."""
        return self._radii

    @property
    def moved_w(self) -> FloatArray:
        """How far the followers moved in the last step (N, 3) [m]."""
        return self._movement.moved_w

    def will_move(self, indices: list[int], moved_w: FloatArray) -> None:
        """Says how far followers (n,) will move in the next step (n, 3) [m] where the last one does not tell."""
        self._movement.tell(indices, moved_w)

    def placed(self, body: int | None = None) -> None:
        """Says that a body (None = every body) was put somewhere: how it got there is no motion that goes on."""
        chosen = [index for index, follower in enumerate(self.followers) if body is None or follower.body == body]
        self._movement.placed(chosen)
        self._colliders.fields.renew(chosen)
        self.stale = True

    @property
    def replacements(self) -> int:
        """Colliders whose surface was changed so far."""
        return self._colliders.fields.replacements + self._colliders.meshes.built

    @property
    def leaked(self) -> int:
        """Colliders that were built anew so far; PyBullet keeps some KiB of each."""
        return self._colliders.meshes.built

    def attach(
        self, body: int, link: int = -1, *, radius: float | None = None, solid: bool = True, ball: bool | None = None
    ) -> Follower:
        """Puts a patch under ``body`` (or its ``link``), whose sphere around its centre of mass has ``radius`` [m].

        Without a radius it is read off the body's bounds. ``solid=False`` computes the patch without a collider.
        ``ball``: whether it is a sphere, None = PyBullet is asked. Spheres roll over inner edges without a filter.
        """
        attached = self.followers if self._together is None else self._together
        if any(follower.body == body and follower.link == link for follower in attached):
            raise InputError("duplicate_id", f"body {body}, link {link} is attached already; detach it first")
        size = bounding_radius(self._client, body, link) if radius is None else radius
        if not (np.isfinite(size) and size > 0.0):
            raise InputError("geometry", f"the radius of body {body}, link {link} is {size} m; it must be above zero")
        follower = Follower(body, link, size, solid, is_ball(self._client, body, link) if ball is None else ball)
        if self._together is None:
            self._adopt([*self.followers, follower])
        else:
            self._together.append(follower)
        return follower

    @contextmanager
    def together(self) -> Iterator[None]:
        """Takes on at its end, in one pass, the patches that are attached and detached in the block."""
        self._together = [*self.followers]
        try:
            yield
        finally:
            followers, self._together = self._together, None
            self._adopt(followers)

    def detach(self, body: int) -> None:
        """Takes the patches of ``body`` and its links away. Call it before the body is removed from PyBullet."""
        for index, follower in enumerate(self.followers):
            if follower.body == body:
                self._colliders.release(index)
        if self._together is None:
            self._adopt([follower for follower in self.followers if follower.body != body])
        else:
            self._together = [follower for follower in self._together if follower.body != body]

    def configure(self, config: PatchConfig) -> None:
        """Takes other settings for patches, from the next update on; bodies may rest on them meanwhile. Raises
        `InputError` and changes nothing where the terrain does not allow them."""
        for mesh in self.terrain.tiles.values():
            require_usable(config, mesh)
        if config.edge_filter != self.config.edge_filter:
            self._colliders.fields.forget_heights()
        self._applied = []
        self.stale = True
        self.config = config
        self._tracker.configure(config)

    def update(self, time: float, dt: float, steps: int = 1) -> None:
        """Brings every patch to where its body and the ground are at ``time`` [s], before ``steps`` of ``dt`` [s]."""
        self._read_bodies(dt)
        self._bring_up_to_date(time, dt, steps)

    def go_on(self, time: float, dt: float) -> bool:
        """Leaves the patches to move on as they do, before a further step of ``dt`` [s] that the last `update` was made
        for; but brings them up to date if a body goes farther than they reach, because something has hit it. Returns
        whether it did."""
        if self.stale:
            self.update(time, dt, self._steps)
            return True
        self._read_bodies(dt)
        went = self.positions_w - self._from_w + self.moved_w
        outran = (np.einsum("ij,ij->i", went, went) > self._farthest**2) & ~self._movement.too_fast
        if outran.any():
            self._bring_up_to_date(time, dt, self._steps)
            return True
        return False

    def stand_still(self, duration: float) -> None:
        """Says that for a ``duration`` [s] time went on without a step; the next one needs an `update`."""
        self._colliders.stand_still(duration)
        self.stale = True

    def close(self) -> None:
        """Takes all colliders away."""
        for index in range(len(self.followers)):
            self._colliders.release(index)
        self._whole.release()
        self._adopt([])

    def _bring_up_to_date(self, time: float, dt: float, steps: int) -> None:
        """Makes the patches those of the bodies as they were read, and of the ground at ``time`` [s]."""
        self.stale, self._steps = False, steps
        dt *= steps
        moved = self.moved_w * steps
        self._reach = reach_of(self._radii, moved)
        self._from_w = self.positions_w
        self._farthest = np.where(self._solid, self._reach - (1.0 - SLACK) * self._radii, np.inf)
        lively = not self._colliders.fields.keeps(time)
        batches = self._tracker.update(self.positions_w, moved, time, dt, lively=lively)
        with self.stopwatch.stage("collider"):
            kind = self.config.kind
            if kind == "whole_trimesh" or kind == "whole_heightfield":
                self._whole.update(kind, time)
                self._carry([], time, dt)
            else:
                self._whole.release()
                self._carry(batches, time, dt)

    def _adopt(self, followers: list[Follower]) -> None:
        """Makes ``followers`` the attached ones; what is known of those that stay is kept."""
        before = {follower: index for index, follower in enumerate(self.followers)}
        kept = np.array([before.get(follower, -1) for follower in followers], np.int64)
        self.followers = followers
        self._applied = []
        self.stale = True
        self._radii = np.array([follower.radius for follower in followers])
        self._movement.adopt(followers, kept)
        self._colliders.adopt(followers, kept)
        self._prediction.adopt(kept)
        self._solid = np.array([follower.solid for follower in followers], bool)
        self._tracker.set_bodies(self._radii, kept, self._solid)

    def _read_bodies(self, dt: float) -> None:
        with self.stopwatch.stage("bodies"):
            self._movement.read(dt)

    def _carry(self, batches: list[PatchBatch], time: float, dt: float) -> None:
        """Makes the colliders those of the batches. A batch that was there already has not changed."""
        before = {id(batch): bodies for batch, bodies in self._applied}
        kept = {id(batch) for batch in batches if id(batch) in before and not self._outrun(batch)}
        if batches and len(batches) == len(before) == len(kept):
            return
        supported = np.zeros(len(self.followers), bool)
        applied = [(batch, before[id(batch)]) for batch in batches if id(batch) in kept]
        fields = []
        for batch in batches:
            if id(batch) in kept:
                continue
            if batch.kind == "heightfield" and isinstance(batch, GridBatch):
                fields.append(batch)
            else:
                applied.append((batch, self._apply(batch, time, dt)))
        for group in groups(fields):
            applied += zip(group, self._apply_fields(group, time, dt), strict=True)
        for _, carried in applied:
            supported[carried] = True
        self._applied = applied
        self._colliders.put_away(supported)

    def _outrun(self, batch: PatchBatch) -> bool:
        """Whether a body may leave its box before the next update, although its plane has not changed."""
        if not isinstance(batch, PlaneBatch):
            return False
        bodies = batch.bodies
        return bool(self._colliders.planes.outrun(bodies, self.positions_w[bodies], self._reach[bodies]).any())

    def _apply(self, batch: PatchBatch, time: float, dt: float) -> IntArray:
        """Gives the colliders of a batch what changed; returns the followers that have ground under them."""
        if isinstance(batch, PlaneBatch):
            return self._apply_planes(batch, time, dt)
        bodies, base = batch.bodies, batch.centres_w
        rows = np.arange(len(bodies))
        if batch.may_have_holes:
            base, grounded = base_over_holes(base, batch.vertices_w()[..., 2])
            rows = np.flatnonzero(grounded)
        if rows.size:
            self._colliders.make_room(bodies[rows], MESH)
            twist, ahead = None, Ahead.nothing(len(bodies))
            if self.config.carry_velocity:
                ahead = self._prediction.ahead(batch, time, dt)
                twist = np.concatenate([batch.linear_w, batch.angular_w], axis=1)
                twist[:, 2] += ahead.faster
            self._colliders.meshes.apply_batch(
                batch, rows, base, ahead.higher, twist, self.followers, edge_filter=self.config.edge_filter
            )
        return bodies[rows]

    def _apply_planes(self, batch: PlaneBatch, time: float, dt: float) -> IntArray:
        """The same for a batch of planes."""
        bodies, carry_velocity = batch.bodies, self.config.carry_velocity
        ahead, due = Ahead.nothing(len(bodies)), np.arange(len(bodies))
        if carry_velocity:
            ahead = self._prediction.ahead(batch, time, dt)
            held = self._colliders.planes.held(batch, self.positions_w[bodies], self._reach[bodies], time)
            due = np.flatnonzero(~held)
            if due.size < len(bodies):
                self._colliders.planes.go_on(bodies[held], ahead.faster[held], time)
        if due.size:
            self._colliders.make_room(bodies[due], PLANE)
            positions_w, reach = self.positions_w[bodies[due]], self._reach[bodies[due]]
            self._colliders.planes.apply(
                batch, due, positions_w, reach, ahead.of(due), time, carry_velocity=carry_velocity
            )
        return bodies

    def _apply_fields(self, batches: list[GridBatch], time: float, dt: float) -> list[IntArray]:
        """The same for batches of heightfields, in one pass; for each the followers that have ground under them."""
        fields = Fields.of(batches)
        holes = fields.holes
        carried, touching = [batch.bodies for batch in batches], fields.touching(self.positions_w, self._radii)
        ahead, due, keeping = Ahead.nothing(len(fields.bodies)), np.arange(len(fields.bodies)), False
        if self.config.carry_velocity:
            ahead = self._prediction.ahead(fields, time, dt)
            # Worth it only where there are steps between maps.
            keeping = not holes and fields.heightmap.lifetime > OFTEN * dt and fields.heightmap.slide_w == (0.0, 0.0)
            keeping = keeping and self._colliders.fields.keeps(time)
        if keeping:
            held = self._colliders.fields.held(fields, time)
            due = np.flatnonzero(~held)
            if due.size < len(held):
                self._colliders.fields.go_on(fields.bodies[held], ahead.faster[held], touching[held], time)
        if not due.size:
            return carried
        if due.size < len(fields.bodies):
            fields = fields.of_rows(due)
        samples, base = fields.read(velocities=keeping), fields.centres_w.copy()
        if holes:
            base, grounded = base_over_holes(base, samples.heights)
            carried = [fields.bodies[grounded & (fields.which == which)] for which in range(len(batches))]
            due = np.flatnonzero(grounded)
            fields, base, samples = fields.of_rows(due), base[due], Samples(samples.heights[due], None)
        if due.size:
            self._colliders.make_room(fields.bodies, FIELD)
            self._colliders.fields.apply(fields, samples, base, ahead.of(due), touching[due], time, self.config)
            if keeping:
                self._colliders.fields.judge(fields.bodies, time, dt)
        return carried
