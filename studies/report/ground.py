"""The report's patches and colliders as the ground of a PyBullet world: what studies and benchmarks compare contacts
from the map with."""

from __future__ import annotations

from typing import Any

import numpy as np

from smartmesh_ros import Ground, InputError, Terrain, World, WorldConfig
from smartmesh_ros.terrain.terrain import MainMesh
from studies.report.config import ReportConfig
from studies.report.patch_contacts import PatchContacts
from studies.report.patches import ChosenPatches

# Motion at which PyBullet drops a cached contact point on its own colliders [body sizes]: at its default a rolling body
# is held back by old contact points and hops; far smaller values let boxes creep down slopes.
CONTACT_BREAKING = 2e-4


class ReportGround(Ground):
    """A ground of colliders of PyBullet's own on one main mesh. No body sleeps, no surface moves, and there are neither
    soil nor decks. Raises `InputError` for any other terrain.

    ``chosen``: the patches that the report's search and collecting chose at the last `refresh`.
    """

    contacts: PatchContacts

    def __init__(self, client: Any, terrain: MainMesh | Terrain, config: ReportConfig) -> None:
        self.config = config
        self._left, self._revision = 0, -1  # steps until the next refresh
        super().__init__(client, terrain)

    def _new_contacts(self) -> Any:
        self._main_mesh()
        self.chosen = ChosenPatches(self.config, self.followers)
        return PatchContacts(self._client, self.followers, self.terrain, self.config, self.chosen)

    def _begin(self, time: float, dt: float) -> None:
        """Refresh the colliders for the step of ``dt`` [s] from ``time`` [s] on, with new maps and by their rate."""
        super()._begin(time, dt)
        self._left -= 1
        if self._left <= 0 or self._revision != self.terrain.revision:
            self.refresh(time, dt)

    def refresh(self, time: float, dt: float) -> None:
        """Move bodies with corrections of maps, put bodies below the ground back onto it, and replace the colliders."""
        mesh = self._main_mesh()
        self._left = 0  # until the end: a refresh that failed is made again before the next step
        self.contacts.begin(time, dt)
        self.contacts.core.update()
        steps = max(round(1.0 / (self.config.rate * dt)), 1) if self.config.rate else 1
        self.chosen.refresh(mesh, time, dt * steps, self.contacts.states_of(np.arange(self.followers.capacity)))
        self.contacts.refresh()
        self._left, self._revision = steps, self.terrain.revision

    def wake(self, body: int | None = None) -> None:
        """Refresh the colliders before the next step."""
        self._left = 0

    def attach(self, body: int, *given: Any, **more: Any) -> Any:
        """Attach a body, which gets its colliders before the next step."""
        self._left = 0
        return super().attach(body, *given, **more)

    def _require_exact(self) -> None:
        raise InputError("state", "a state is saved and restored only where contacts come from the map itself")

    def _main_mesh(self) -> MainMesh:
        meshes = self.terrain.meshes
        if self.terrain.decks or len(meshes) != 1:
            raise InputError("terrain", "the report's colliders are those of one main mesh; use Ground")
        return meshes[0]


class ReportWorld(World):
    """A world whose bodies stand on the report's colliders."""

    ground: ReportGround

    def __init__(
        self, terrain: MainMesh | Terrain | None = None, config: WorldConfig | None = None, *, report: ReportConfig
    ) -> None:
        self.report = report
        super().__init__(terrain, config)

    def _new_ground(self, client: Any) -> Ground:
        client.setPhysicsEngineParameter(contactBreakingThreshold=CONTACT_BREAKING)
        return ReportGround(client, self.terrain, self.report)

    def refresh(self) -> None:
        """Refresh the colliders now."""
        self.ground.refresh(self.time, self.dt)
        self._drop_lost()


def world_on(
    terrain: MainMesh | Terrain | None, config: WorldConfig | None = None, report: ReportConfig | None = None
) -> World:
    """Return a world whose contacts come from the map, or from the ``report``'s colliders."""
    return World(terrain, config) if report is None else ReportWorld(terrain, config, report=report)
