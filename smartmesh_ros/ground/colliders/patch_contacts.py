"""Contacts with colliders of PyBullet's own, where they cannot come from the map or the settings ask for them."""

from __future__ import annotations

from typing import Any

from smartmesh_ros.ground.colliders.driver import Colliders
from smartmesh_ros.ground.colliders.follower_reader import FollowerReader
from smartmesh_ros.ground.colliders.whole_mesh import WholeMesh
from smartmesh_ros.ground.followers import Follower, Followers
from smartmesh_ros.ground.shown_patches import ShownPatches
from smartmesh_ros.patches.config import PatchConfig, is_whole
from smartmesh_ros.terrain.grid import BoolArray, FloatArray, IntArray
from smartmesh_ros.terrain.terrain import Terrain


class PatchContacts:
    """Contacts of the followers in one client with the colliders of their patches, or with one of the whole terrain;
    the same calls as those of `MapContacts`."""

    exact = False

    def __init__(
        self, client: Any, followers: Followers, terrain: Terrain, config: PatchConfig, patches: ShownPatches
    ) -> None:
        self._config = config
        self._followers = followers
        self._patches = patches
        self._reader = FollowerReader(client, followers)
        self._colliders = Colliders(client, followers, terrain)
        self._whole = WholeMesh(client, terrain)
        self._time = 0.0

    @property
    def replacements(self) -> int:
        """Number of colliders whose surface was changed so far."""
        return self._colliders.replacements + self._colliders.built

    @property
    def leaked(self) -> int:
        """Number of colliders that were rebuilt so far; PyBullet leaks a few KiB for each."""
        return self._colliders.built

    def configure(self, config: PatchConfig) -> None:
        """Take settings from the next `refresh` on."""
        self._config = config

    def attach(self, follower: Follower) -> None:
        """A follower gets its collider in the next `refresh`."""

    def detach(self, slots: list[int]) -> None:
        """Remove the colliders of followers. If PyBullet fails, the next `refresh` makes those that are missing."""
        self._release(slots)

    def set_time(self, time: float, dt: float) -> None:
        """Set the time [s] at the start of the next step of ``dt`` [s]."""
        self._time = time

    def refresh(self) -> None:
        """Set the colliders to the patches of the followers that are awake."""
        if not self._followers.awake.size:
            return
        batches, supports = self._patches.batches, self._patches.supports
        with self._patches.stopwatch.stage("collider"):
            if is_whole(self._config.kind):
                self._whole.update(self._config.kind, self._time)
            else:
                self._whole.release()
            self._colliders.apply(batches, supports, carry=self._config.carry_velocity)

    def hold(self, stopped: BoolArray) -> None:
        """Colliders wake nobody."""

    def let_go(self, slots: IntArray) -> None:
        """Remove the colliders of followers that fell asleep."""
        self._release(slots.tolist())

    def read_states(self, dt: float) -> None:
        """Update ``states``, ``positions_w`` and ``moved_w`` of the awake followers; ``dt`` [s] is the time step."""
        self._reader.read_states(dt)

    def read_positions(self, dt: float) -> None:
        """Update ``positions_w`` and ``moved_w`` of the awake followers after a step of ``dt`` [s]."""
        self._reader.read_positions(dt)

    def states_of(self, slots: IntArray) -> FloatArray | None:
        """None: PyBullet's calls read bodies one by one."""
        return None

    def close(self) -> None:
        """Remove all colliders."""
        for follower in self._followers:
            self._colliders.release(follower)
        self._whole.release()

    def _release(self, slots: list[int]) -> None:
        for slot in slots:
            self._colliders.release(self._followers[slot])
