"""MuJoCo's ground from served patches: one small height field a wheel, rewritten and moved for each new patch."""

from __future__ import annotations

from smartmesh_ros.tools.client import PatchClient, write_field
from studies.consumer.cases import COLLIDER
from studies.consumer.rover import CONTACT, WHEELS, FieldSpec, Rover

# Samples on a side of a wheel's field, at the most: nodes serve patches of tracked bodies with up to 9 or so.
MOST = 33
# Time by which patches are extrapolated ahead [s]. MuJoCo's contacts ignore the velocity of the ground, so that a wheel
# lags behind the ground by its speed times twice the time constant of the contact.
LEAD = 2.0 * CONTACT


class ServedGround:
    """The rover's wheels are tracked bodies of a ``terrain_collider``; each stands on the patch it is served."""

    def __init__(self) -> None:
        self.client = PatchClient(COLLIDER)

    @staticmethod
    def fields() -> list[FieldSpec]:
        """One for each wheel, which alone collides with it."""
        return [
            FieldSpec(name=f"ground_{name}", rows=MOST, columns=MOST, wheels=(index,))
            for index, name in enumerate(WHEELS)
        ]

    def close(self) -> None:
        """Ends the client."""
        self.client.close()

    def now(self) -> float:
        """The clock that stamps are of [s]."""
        return self.client.now()

    @property
    def received(self) -> int:
        """Messages so far."""
        return self.client.received

    def ready(self, rover: Rover) -> bool:
        """Tells the node of the wheels; whether each has its patch."""
        self.client.track(rover.links())
        return self.client.patches().keys() >= set(WHEELS)

    def spin(self, timeout: float) -> None:
        """Takes what has arrived, waiting up to ``timeout`` [s]."""
        self.client.spin_once(timeout)

    def track(self, rover: Rover, now: float) -> None:
        """Tells the node where the wheels are at ``now`` [s]."""
        self.client.track(rover.links(), now)

    def update(self, rover: Rover, now: float) -> int:
        """Update the wheels' fields to ``now`` [s]; return the number of wheels without a patch."""
        patches = self.client.patches(now + LEAD)
        for index, name in enumerate(WHEELS):
            patch = patches.get(name)
            if patch is not None:
                write_field(rover.model, rover.data, index, patch)
        return sum(name not in patches for name in WHEELS)

    def age(self, now: float) -> float:
        """Time since the stamp of the newest patches [s]."""
        return self.client.age(now)
