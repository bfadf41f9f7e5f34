"""Poses of frames in one another."""

from __future__ import annotations

from typing import NamedTuple

from smartmesh_ros.ground.quaternions import conjugate, product, rotate
from smartmesh_ros.ground.state import BodyState, Quaternion, Vector


class Transform(NamedTuple):
    """Pose of a frame in another: translation [m] and rotation (x, y, z, w)."""

    translation: Vector = (0.0, 0.0, 0.0)
    rotation: Quaternion = (0.0, 0.0, 0.0, 1.0)

    @classmethod
    def of(cls, state: BodyState) -> Transform:
        """Return the pose of a state."""
        return cls(state.position, state.orientation)

    def then(self, inner: Transform) -> Transform:
        """Return ``inner``, given in this frame, as a transform in the outer frame."""
        (x, y, z), (dx, dy, dz) = self.translation, rotate(self.rotation, inner.translation)
        return Transform((x + dx, y + dy, z + dz), product(self.rotation, inner.rotation))

    def inverse(self) -> Transform:
        """Return the outer frame's pose in this frame."""
        back = conjugate(self.rotation)
        x, y, z = rotate(back, self.translation)
        return Transform((-x, -y, -z), back)

    def apply(self, state: BodyState) -> BodyState:
        """Return a body's state in the outer frame. The twist is rotated only, as if the frames were at rest."""
        position, orientation = self.then(Transform.of(state))
        return BodyState(
            position, orientation, rotate(self.rotation, state.linear), rotate(self.rotation, state.angular)
        )


IDENTITY = Transform()


def fixed_to(frame: BodyState, place: Transform) -> BodyState:
    """Return the state of what is fixed to a ``frame`` at a ``place`` in it."""
    arm = rotate(frame.orientation, place.translation)
    (wx, wy, wz), (x, y, z) = frame.angular, arm
    linear = added(frame.linear, (wy * z - wz * y, wz * x - wx * z, wx * y - wy * x))
    return BodyState(added(frame.position, arm), product(frame.orientation, place.rotation), linear, frame.angular)


def added(a: Vector, b: Vector) -> Vector:
    """Return the sum of two vectors."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]
