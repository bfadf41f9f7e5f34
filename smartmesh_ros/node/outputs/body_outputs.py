"""Messages of body states and contacts, serialised to bytes."""

from __future__ import annotations

from typing import Any

import numpy as np
from smartmesh_msgs.msg import Contact, ContactArray, TrackedBody, TrackedBodyArray
from std_msgs.msg import Header

from smartmesh_ros.ground.config import PhysicsConfig
from smartmesh_ros.node.outputs.cdr import ArrayMessage, by_length, stamp_fields, text_rows
from smartmesh_ros.world.contacts import GroundContact
from smartmesh_ros.world.state_table import StateTable


class BodyStates:
    """``~/body_states``: every simulated body."""

    def __init__(self) -> None:
        self._message = ArrayMessage()

    def write(self, header: Header, states: StateTable, physics: PhysicsConfig, ahead: float) -> bytes:
        """Return the TrackedBodyArray; ``ahead``: lead of the states' time over the header's stamp [s]."""
        message = self._message
        message.start(
            (header.frame_id, physics.rate, physics.gravity),
            lambda: TrackedBodyArray(header=header, rate=physics.rate, gravity=np.array(physics.gravity, np.float32)),
            {**stamp_fields(header), "ahead": ahead},
        )
        # Bodies stay in order of spawning; consecutive ones with names of equal length form a group.
        lengths = np.array([len(name.encode()) for name in states.names], np.int64)
        starts = np.flatnonzero(np.diff(lengths, prepend=-1))
        ends = np.append(starts[1:], len(lengths))[: len(starts)]
        for start, end in zip(starts.tolist(), ends.tolist(), strict=True):
            length = int(lengths[start])
            fields: dict[str, Any] = {
                "id": text_rows(states.names[start:end]),
                "radius": states.radii[start:end],
                "shape": states.kinds[start:end],
                "dimensions": states.dimensions[start:end],
                "centre": states.centres[start:end],
                "mass": states.masses[start:end],
            }
            for column, path in enumerate(_STATE_FIELDS):
                fields[path] = states.numbers[start:end, column]
            message.add(length, lambda: TrackedBody(id="x" * length), end - start, fields)  # noqa: B023  # called at once
        return message.finish()


class Contacts:
    """``~/contacts``: contacts between bodies and the ground."""

    def __init__(self) -> None:
        self._message = ArrayMessage()

    def write(self, header: Header, contacts: list[GroundContact]) -> bytes:
        """Return the ContactArray."""
        message = self._message
        message.start(header.frame_id, lambda: ContactArray(header=header), stamp_fields(header))
        for part, texts in by_length([contact.body for contact in contacts]):
            group = [contacts[index] for index in part.tolist()]
            numbers = np.array([(*c.position, *c.normal, c.depth, c.normal_force) for c in group])
            fields: dict[str, Any] = {path: numbers[:, column] for column, path in enumerate(_CONTACT_FIELDS)}
            fields["body_id"] = text_rows(texts)
            length = len(texts[0].encode())
            message.add(length, lambda: Contact(body_id="x" * length), len(group), fields)  # noqa: B023
        return message.finish()


_CONTACT_FIELDS = (
    *(f"position.{axis}" for axis in "xyz"),
    *(f"normal.{axis}" for axis in "xyz"),
    "depth",
    "normal_force",
)
_STATE_FIELDS = (
    *(f"pose.position.{axis}" for axis in "xyz"),
    *(f"pose.orientation.{axis}" for axis in "xyzw"),
    *(f"twist.linear.{axis}" for axis in "xyz"),
    *(f"twist.angular.{axis}" for axis in "xyz"),
)
