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
        self._tracked = {source: ("poses", name) for name, source in settings.poses}
        self._tracked |= {source: ("odometry", name) for name, source in settings.odometry}

    def take(self, given: str) -> None:
        """Registers an input before its subscription; raises `InputError` if the node publishes there."""
        topic = self._resolve(given)
        if topic in self.published:
            raise self._conflict(topic, given, self.published[topic])
        self.taken[topic] = given

    def publish(self, given: str) -> None:
        """Registers an output before its publisher; raises `InputError` if the node subscribes there."""
        topic = self._resolve(given)
        if topic in self.taken:
            raise self._conflict(topic, self.taken[topic], given)
        self.published[topic] = given

    def _conflict(self, topic: str, taken: str, published: str) -> InputError:
        if taken not in self._tracked:
            return InputError(
                "own_topic",
                f"the input {taken} is the topic {topic} that this node publishes as {published}; remap one of them "
                "elsewhere",
            )
        kind, body = self._tracked[taken]
        return InputError(
            "own_topic",
            f"bodies.{kind}: body {body!r} is tracked at {taken!r}, which is the topic {topic} that this node "
            f"publishes as {published}; give the body a topic of its own, such as ~/tracked_{kind} remapped to that of "
            "the real robot, and remap no output there",
        )
