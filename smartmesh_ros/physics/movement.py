"""Where followers are, and how far they will move in the coming step."""

from __future__ import annotations

from typing import Any

import numpy as np

from smartmesh_ros.patches.bodies import carry_over
from smartmesh_ros.physics.bullet import BulletCalls
from smartmesh_ros.physics.follower import Follower
from smartmesh_ros.terrain.grid import FloatArray, IntArray

# Faster bodies do not get larger patches; a teleport is not a speed [m/s].
FASTEST = 50.0


class Movement:
    """Of N followers at the last reading: ``positions_w`` (N, 3) [m], how far they move in a step, ``moved_w`` (N, 3)
    [m], and who is ``too_fast`` (N,) for that to be all of it."""

    def __init__(self, client: Any) -> None:
        self.positions_w = np.empty((0, 3))
        self.moved_w = np.empty((0, 3))
        self.too_fast = np.empty(0, bool)
        self._client = client
        self._calls = BulletCalls(client)
        self._followers: list[Follower] = []
        self._bodies: list[int] = []
        self._links: list[int] = []
        self._told: list[tuple[list[int], FloatArray]] = []
        self._placed: set[int] = set()

    def adopt(self, followers: list[Follower], kept: IntArray) -> None:
        """Makes ``followers`` the ones there are; ``kept`` (N,): each one's index before, -1 = new."""
        carry_over(self, {"positions_w": np.nan}, kept)
        self._followers = followers
        self._bodies = [follower.body for follower in followers]
        self._links = [index for index, follower in enumerate(followers) if follower.link >= 0]
        self._told.clear()
        self._placed.clear()

    def tell(self, indices: list[int], moved_w: FloatArray) -> None:
        """Says how far followers (n,) will move in the next step (n, 3) [m] where the last one does not tell."""
        self._told.append((indices, moved_w))

    def placed(self, indices: list[int]) -> None:
        """Says that followers were put somewhere: how they got there is no motion that goes on."""
        self._placed.update(indices)

    def read(self, dt: float) -> None:
        """Reads where followers are, before a step of ``dt`` [s]."""
        positions = self._read_positions()
        self.moved_w = self._motion(positions, dt)
        self.positions_w = positions

    def _read_positions(self) -> FloatArray:
        positions = self._calls.positions(self._bodies)
        for index in self._links:
            follower = self._followers[index]
            positions[index] = self._client.getLinkState(follower.body, follower.link)[0]
        return np.array(positions, np.float64).reshape(-1, 3)

    def _motion(self, positions: FloatArray, dt: float) -> FloatArray:
        """How far bodies will move in a step: as far as in the last one, or as their velocity says if they are new."""
        moved = positions - self.positions_w
        for indices, told in self._told:
            moved[indices] = told
        self._told.clear()
        if self._placed:
            moved[list(self._placed)] = np.nan
            self._placed.clear()
        for index in np.flatnonzero(np.isnan(moved[:, 0])).tolist():
            moved[index] = np.multiply(self._calls.velocity(self._followers[index].body), dt)
        travel = np.sqrt(np.einsum("ij,ij->i", moved, moved))
        self.too_fast = far = ~(travel <= FASTEST * dt)
        if far.any():
            moved[far] = np.nan_to_num(moved[far] * np.nan_to_num(FASTEST * dt / travel[far])[:, None])
        return moved
