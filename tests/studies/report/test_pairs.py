"""Which colliders touch which bodies, whatever PyBullet ids they had before."""

import pybullet as pb
from hypothesis import example, given
from hypothesis import strategies as st
from pybullet_utils.bullet_client import BulletClient

from studies.report.patch_contacts import Pairs


class Overlapping:
    """Bodies and colliders, all spheres at nearly the same place: every pair that may touch has a contact."""

    def __init__(self) -> None:
        self.client = BulletClient(pb.DIRECT)
        self.pairs = Pairs(self.client)
        self.shape = self.client.createCollisionShape(pb.GEOM_SPHERE, radius=0.5)
        self.bodies: list[int] = []
        self.colliders: list[int] = []
        self.joined: set[tuple[int, int]] = set()

    def add_body(self) -> None:
        self.bodies.append(self.client.createMultiBody(1.0, self.shape))

    def remove_body(self, at: int) -> None:
        body = self.bodies.pop(at % len(self.bodies))
        for collider in [c for c, b in self.joined if b == body]:
            self.part(collider, body)
        self.client.removeBody(body)

    def add_collider(self) -> None:
        self.colliders.append(self.client.createMultiBody(0.0, self.shape))
        self.pairs.claim(self.colliders[-1])

    def remove_collider(self, at: int) -> None:
        collider = self.colliders.pop(at % len(self.colliders))
        self.joined = {(c, b) for c, b in self.joined if c != collider}
        self.pairs.retire(collider)
        self.client.removeBody(collider)

    def join(self, at: int) -> None:
        pair = self.colliders[at % len(self.colliders)], self.bodies[at // 7 % len(self.bodies)]
        self.joined.add(pair)
        self.pairs.join(*pair, -1)

    def part(self, collider: int, body: int) -> None:
        self.joined.discard((collider, body))
        self.pairs.part(collider, body, -1)

    def touching(self) -> set[frozenset[int]]:
        """The pairs with a contact."""
        for uid in self.bodies + self.colliders:
            self.client.resetBasePositionAndOrientation(uid, (1e-3 * uid, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
        self.client.performCollisionDetection()
        return {frozenset(point[1:3]) for point in self.client.getContactPoints()}

    def expected(self) -> set[frozenset[int]]:
        between = {frozenset((a, b)) for a in self.bodies for b in self.bodies if a != b}
        return between | {frozenset(pair) for pair in self.joined}


# A body and its collider are removed, and each id goes to the other kind.
SWAPPED = [("add_body", 0), ("add_collider", 0), ("join", 0), ("remove_collider", 0), ("remove_body", 0)]


@given(
    st.lists(
        st.tuples(
            st.sampled_from(["add_body", "remove_body", "add_collider", "remove_collider", "join"]),
            st.integers(0, 1000),
        ),
        max_size=40,
    )
)
@example([*SWAPPED, ("add_collider", 0), ("add_body", 0)])
@example([*SWAPPED, ("add_body", 0), ("add_collider", 0)])
@example(
    [("add_body", 0), ("add_collider", 0), ("join", 0), ("remove_body", 0), ("add_collider", 0),
     ("remove_collider", 0), ("add_body", 0)]
)  # fmt: skip
def test_a_body_touches_other_bodies_and_the_colliders_it_is_joined_to(actions: list[tuple[str, int]]) -> None:
    world = Overlapping()
    try:
        for action, at in actions:
            if action.startswith("add"):
                getattr(world, action)()
            elif (action == "remove_body" and world.bodies) or (action == "remove_collider" and world.colliders):
                getattr(world, action)(at)
            elif action == "join" and world.bodies and world.colliders:
                world.join(at)
        assert world.touching() == world.expected()
    finally:
        world.client.disconnect()
