"""Contacts of bodies that fall asleep, which PyBullet then no longer reports."""

from __future__ import annotations

from typing import Any, NamedTuple

from smartmesh_ros.ground.followers import Followers
from smartmesh_ros.terrain.grid import IntArray


class SleepContacts(NamedTuple):
    """Contact points of a body with its ``collider``, a PyBullet body, as PyBullet reported them before the body fell
    asleep."""

    collider: int | None
    points: list[Any]


def contacts_before_sleep(client: Any, followers: Followers, slots: IntArray) -> dict[int, SleepContacts]:
    """Return the contacts of followers (n,) with their colliders in the last step, by slot."""
    colliders = {slot: followers[slot].collider for slot in slots.tolist()}
    slot_of = {collider: slot for slot, collider in colliders.items() if collider is not None}
    contacts = {slot: SleepContacts(collider, []) for collider, slot in slot_of.items()}
    # All points are read, because PyBullet swaps the bodies of a point to fit a filter, but not its friction.
    for point in client.getContactPoints():
        slot = slot_of.get(point[1], slot_of.get(point[2]))
        if slot is not None:
            contacts[slot].points.append(point)
    return contacts
