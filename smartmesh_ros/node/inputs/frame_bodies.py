"""Tracked bodies that follow TF frames."""

from __future__ import annotations

from smartmesh_ros.errors import InputError
from smartmesh_ros.ground.state import BodyState
from smartmesh_ros.node.inputs.conversions import BodyInput
from smartmesh_ros.node.inputs.frames import Transform
from smartmesh_ros.node.inputs.transform_input import TransformInput
from smartmesh_ros.node.session import Session
from smartmesh_ros.node.timing.pacing import StampClock

SOURCE = "bodies.frames"
# Longest time between two look-ups of the frames without a new transform [s], for static frames.
PERIOD = 0.2


class FrameBodies:
    """Moves the bodies of the parameter ``bodies.frames`` with their frames."""

    def __init__(self, session: Session, transforms: TransformInput) -> None:
        self._session = session
        self._transforms = transforms
        self._clocks: dict[str, StampClock] = {}
        self._seen: dict[str, tuple[Transform, float]] = {}  # the last pose and stamp of each body
        self._version = -1
        self._due = 0.0
        if session.settings.frames:
            transforms.listen(SOURCE)

    def forget_stamps(self) -> None:
        """Accepts any stamps from now on."""
        self._clocks.clear()
        self._seen.clear()
        self._due = 0.0

    def refresh(self) -> None:
        """Looks up every frame if a transform arrived or `PERIOD` has passed; reports failures once a `PERIOD`."""
        session, buffer = self._session, self._transforms.buffer
        if not session.settings.frames or not session.frame_id:
            return
        now = session.clock.pace()
        overdue = now >= self._due
        if buffer.version == self._version and not overdue:
            return
        self._version = buffer.version
        self._due = now + PERIOD if overdue else self._due
        for name, frame in session.settings.frames:
            try:
                self._follow(name, frame)
            except InputError as error:
                if overdue:
                    session.refusals.add(SOURCE, error)

    def _follow(self, name: str, frame: str) -> None:
        session = self._session
        session.require_not_simulated(name)
        if self._transforms.is_own(frame):
            raise InputError(
                "own_topic", f"frame {frame!r} of body {name!r} is one that this node publishes (publish.tf); a body "
                "that follows it would overlap the simulated one"
            )  # fmt: skip
        pose, stamp = self._transforms.buffer.lookup(session.frame_id, frame)
        seen = self._seen.get(name)
        if stamp is not None and (pose, stamp) == seen:
            return
        if stamp is not None and seen is not None and stamp < seen[1]:  # the buffer has restarted a frame
            self._clocks.pop(name, None)
        clock = self._clocks.setdefault(name, StampClock())
        placed = clock.place(stamp, session.clock_now(), session.pace_at)
        session.track(SOURCE, BodyInput(name, BodyState(*pose), session.settings.default_radius), placed.time)
        clock.accept(placed)
        session.stamp_ages[SOURCE] = clock.age
        if stamp is not None:
            self._seen[name] = pose, stamp
