"""A transport within this process: it passes on recorded messages, and hands published ones to whoever records them."""

from __future__ import annotations

import math
import sys
from collections import defaultdict, deque
from collections.abc import Callable, Collection, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

from rclpy.exceptions import NameValidationException
from rclpy.expand_topic_name import expand_topic_name
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.validate_namespace import validate_namespace
from rclpy.validate_node_name import validate_node_name

from smartmesh_ros.errors import InputError
from smartmesh_ros.node.outputs.cdr import bytes_of
from smartmesh_ros.tools.replay.bag import Topic
from smartmesh_ros.tools.replay.clock import ReplayClock

# Most messages of a latched topic that wait for a subscription.
MOST_LATCHED = 100


class Names:
    """The collider's name, and its remapping rules (from, to), as of ``--ros-args -r from:=to``; the first that fits
    counts. Raises `InputError` for impossible names."""

    def __init__(self, rules: Mapping[str, str] | Sequence[tuple[str, str]] = ()) -> None:
        rules = list(rules.items()) if isinstance(rules, Mapping) else rules
        given = dict(reversed(rules))
        self.name = given.get("__node", given.get("__name", "terrain_collider"))
        self.namespace = given.get("__ns") or "/"
        try:
            validate_node_name(self.name)
            validate_namespace(self.namespace)
        except NameValidationException as error:
            reason, name, *_ = str(error).splitlines()
            raise InputError("topic", f"{reason} {name.strip()}") from None
        self._rules = [(self._full(old), self._full(new)) for old, new in rules if not old.startswith("__")]

    @property
    def node(self) -> str:
        """The full name of the node."""
        return f"{self.namespace.rstrip('/')}/{self.name}"

    def full(self, topic: str) -> str:
        """Return the full name of a topic or service, which is below the node's name unless it begins with ``/``."""
        return self.resolve(topic if topic.startswith(("/", "~")) else f"~/{topic}")

    def all_of(self, topics: str | Collection[str]) -> list[str]:
        """Return the full names of topics, or of a single one."""
        return [self.full(topic) for topic in ([topics] if isinstance(topics, str) else topics)]

    def resolve(self, topic: str) -> str:
        """Return the full name of a topic or service, after remapping."""
        full = self._full(topic)
        return next((new for old, new in self._rules if old == full), full)

    def _full(self, topic: str) -> str:
        try:
            return str(expand_topic_name(topic, self.name, self.namespace))
        except ValueError as error:
            raise InputError("topic", str(error).partition(", at ")[0]) from None


class Log:
    """The node's logger, with ``info``, ``warning`` and ``error`` as of rclpy's: ``say`` gets each line. A line with
    ``throttle_duration_sec`` [s] is left out for so long after the last one from the same place of the code."""

    def __init__(self, clock: ReplayClock, say: Callable[[str], None]) -> None:
        self._clock, self._say = clock, say
        self._said: dict[tuple[Any, int], float] = {}
        self.info, self.warning, self.error = (partial(self._add, level) for level in ("INFO", "WARN", "ERROR"))

    def _add(self, level: str, text: str, throttle_duration_sec: float = 0.0) -> None:
        caller, now = sys._getframe(1), self._clock.elapsed
        place = caller.f_code, caller.f_lineno
        if now < self._said.get(place, -math.inf) + throttle_duration_sec:
            return
        self._said[place] = now
        self._say(f"[{level}] [{now:.3f} s] {text}")


class Subscription(NamedTuple):
    """An input. ``callback`` gets each message's bytes. ``publishers``: their number."""

    kind: Any
    topic_name: str
    callback: Callable[[bytes], None]
    publishers: int

    def get_publisher_count(self) -> int:
        """Return the number of publishers."""
        return self.publishers


# Subscriptions and the messages that wait for them.
Waiting = deque[tuple[Subscription, bytes]]


class Publisher:
    """An output. ``record``: gets each message's bytes, None = not recorded. ``own``: the collider's own subscriptions,
    whose messages are ``waiting``."""

    def __init__(
        self, kind: Any, topic_name: str, qos: QoSProfile | int, own: Sequence[Subscription], waiting: Waiting
    ) -> None:
        self.kind, self.topic_name = kind, topic_name
        self.qos = qos if isinstance(qos, QoSProfile) else QoSProfile(depth=qos)
        self.record: Callable[[bytes], None] | None = None
        self._own, self._waiting = own, waiting

    def publish(self, message: Any) -> None:
        """Publish a message or its bytes, if anybody subscribes."""
        if not self.get_subscription_count():
            return
        data = message if isinstance(message, bytes) else bytes_of(message)
        if self.record is not None:
            self.record(data)
        self._waiting.extend((subscription, data) for subscription in self._own)

    def get_subscription_count(self) -> int:
        """Return the number of subscriptions."""
        return (self.record is not None) + len(self._own)


class Service:
    """A service of type ``kind``."""

    def __init__(self, kind: Any, callback: Callable[[Any, Any], Any]) -> None:
        self.kind, self.callback = kind, callback

    def call(self, request: Any) -> list[Any]:
        """Handle a request; return the list that gets the response, now or when the work for it is done."""
        answers: list[Any] = []
        self.send_response(self.callback(request, self.kind.Response()), answers)
        return answers

    def send_response(self, response: Any, answers: list[Any]) -> None:
        """Send the response to a request. `Turns` puts itself in this place, to answer later."""
        answers.append(response)


class InProcess:
    """A `Transport` without other nodes. For one thread.

    ``recorded``: topics of the recording, each of which counts as one publisher. ``record``: returns what takes the
    messages of a publisher, or None. ``publishers``, ``subscriptions``, ``services``: by full name.
    """

    def __init__(
        self,
        names: Names,
        log: Log,
        recorded: Mapping[str, Topic],
        record: Callable[[Publisher], Callable[[bytes], None] | None],
    ) -> None:
        self.names = names
        self.publishers: dict[str, Publisher] = {}
        self.subscriptions: dict[str, list[Subscription]] = defaultdict(list)
        self.services: dict[str, Service] = {}
        self._log, self._recorded, self._record = log, recorded, record
        self._latched: dict[str, deque[bytes]] = defaultdict(lambda: deque(maxlen=MOST_LATCHED))
        self._waiting: Waiting = deque()

    def deliver(self, topic: str, data: bytes) -> None:
        """Pass a message on, or keep it for a later subscription unless it was recorded from a topic that is not
        latched."""
        found = self.subscriptions.get(topic)
        if not found and (topic not in self._recorded or self._recorded[topic].latched):
            self._latched[topic].append(data)
        self._waiting.extend((subscription, data) for subscription in found or ())
        self.deliver_waiting()

    def deliver_waiting(self) -> bool:
        """Pass on what the collider published for itself, and latched messages for its new subscriptions. Return False
        if there is none."""
        some = bool(self._waiting)
        while self._waiting:
            subscription, data = self._waiting.popleft()
            subscription.callback(data)
        return some

    def create_publisher(self, msg_type: Any, topic: str, qos_profile: Any) -> Publisher:
        """Return a publisher."""
        name = self.resolve_topic_name(topic)
        self.publishers[name] = publisher = Publisher(
            msg_type, name, qos_profile, self.subscriptions[name], self._waiting
        )
        publisher.record = self._record(publisher)
        return publisher

    def create_subscription(
        self, msg_type: Any, topic: str, callback: Callable[[bytes], None], qos_profile: Any, *, raw: bool
    ) -> Subscription:
        """Call ``callback`` with the bytes of each message, also of those that a latched topic has kept."""
        assert raw, "the collider subscribes to bytes alone"
        name = self.resolve_topic_name(topic)
        subscription = Subscription(msg_type, name, callback, int(name in self._recorded))
        self.subscriptions[name].append(subscription)
        if qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL:
            self._waiting.extend((subscription, data) for data in self._latched.pop(name, ()))
        return subscription

    def create_service(
        self, srv_type: Any, srv_name: str, callback: Callable[[Any, Any], Any], *, qos_profile: Any
    ) -> Service:
        """Return a service."""
        service = Service(srv_type, callback)
        self.services[self.resolve_topic_name(srv_name)] = service
        return service

    def destroy_publisher(self, publisher: Publisher) -> None:
        """End a publisher."""
        del self.publishers[publisher.topic_name]

    def destroy_subscription(self, subscription: Subscription) -> None:
        """End a subscription."""
        self.subscriptions[subscription.topic_name].remove(subscription)

    def get_logger(self) -> Log:
        """Return the logger."""
        return self._log

    def get_name(self) -> str:
        """Return the node's name."""
        return self.names.name

    def get_namespace(self) -> str:
        """Return the node's namespace."""
        return self.names.namespace

    def get_fully_qualified_name(self) -> str:
        """Return the node's namespace and name."""
        return self.names.node

    def resolve_topic_name(self, topic: str) -> str:
        """Return the full name of a topic, after remapping."""
        return self.names.resolve(topic)

    def count_publishers(self, topic_name: str) -> int:
        """Return 1 if the collider or the recording publishes on a topic. What both publish, the recorded collider
        did."""
        return int(topic_name in self.publishers or topic_name in self._recorded)

    def count_subscribers(self, topic_name: str) -> int:
        """Return the number of subscribers of an own output."""
        return self.publishers[topic_name].get_subscription_count() if topic_name in self.publishers else 0

    def get_publishers_info_by_topic(self, topic_name: str) -> list[Any]:
        """Return no endpoint, because recordings do not say who published."""
        return []

    def get_subscriptions_info_by_topic(self, topic_name: str) -> list[Any]:
        """Return no endpoint."""
        return []

    def get_topic_names_and_types(self) -> list[tuple[str, list[str]]]:
        """Return the topics of the recording."""
        return [(name, [topic.type_name]) for name, topic in self._recorded.items()]

    def get_node_names_and_namespaces(self) -> list[tuple[str, str]]:
        """Return the collider alone."""
        return [(self.get_name(), self.get_namespace())]
