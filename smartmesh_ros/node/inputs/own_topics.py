"""Refuses inputs on the node's own outputs, because a tracked body would then overlap the simulated robot it copies."""

from __future__ import annotations

from collections.abc import Callable

from smartmesh_ros.errors import InputError
from smartmesh_ros.node.parameters.settings import Settings


class OwnTopics:
    """The node's input and output topics. ``taken``, ``published``: full name -> name in the node or its parameters.
    ``resolve``: returns the full, remapped name of a topic."""

    def __init__(self, resolve: Callable[[str], str], settings: Settings) -> None:
        self.taken: dict[str, str] = {}
        self.published: dict[str, str] = {}
        self._resolve = resolve
        self._bodies = {source: name for name, source in (*settings.poses, *settings.odometry)}

    def take(self, given: str) -> None:
        """Registers an input before its subscription; raises `InputError` if the node publishes there."""
        self._register(given, self.taken)

    def publish(self, given: str) -> None:
        """Registers an output before its publisher; raises `InputError` if the node subscribes there."""
        self._register(given, self.published)

    def _register(self, given: str, names: dict[str, str]) -> None:
        topic = self._resolve(given)
        names[topic] = given
        if topic in self.taken and topic in self.published:
            taken, advice = self.taken[topic], "remap one of them elsewhere"
            if taken in self._bodies:
                taken = f"{taken!r} of body {self._bodies[taken]!r}"
                advice = "give the body a topic of its own, such as ~/tracked_odometry remapped to the real robot's"
            words = f"the input {taken} is {topic}, which this node publishes as {self.published[topic]}; {advice}"
            raise InputError("own_topic", words)
