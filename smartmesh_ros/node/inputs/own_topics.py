"""A node must not take input from its own outputs: a tracked body would stand where a simulated robot is."""

from __future__ import annotations

from collections.abc import Callable

from smartmesh_ros.errors import InputError
from smartmesh_ros.node.parameters.settings import Settings


class OwnTopics:
    """Topics that the node takes and publishes. ``taken``, ``published``: by full name, as the node or its parameters
    call them; ``resolve``: the full name of a topic, remapped."""

    def __init__(self, resolve: Callable[[str], str], settings: Settings) -> None:
        self.taken: dict[str, str] = {}
        self.published: dict[str, str] = {}
        self._resolve = resolve
        self._tracked = {source: ("poses", name) for name, source in settings.poses}
        self._tracked |= {source: ("odometry", name) for name, source in settings.odometry}

    def take(self, given: str) -> None:
        """Notes an input before it is subscribed to; raises `InputError` if the node publishes there."""
        topic = self._resolve(given)
        if topic in self.published:
            raise self._conflict(topic, given, self.published[topic])
        self.taken[topic] = given

    def publish(self, given: str) -> None:
        """Notes an output before its publisher is made; raises `InputError` if the node takes messages there."""
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
