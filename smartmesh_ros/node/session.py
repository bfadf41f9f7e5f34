"""What the parts of the node share: the world, the settings, the clock, and how input is refused."""

from __future__ import annotations

from collections.abc import Callable
from threading import RLock
from typing import Any

from builtin_interfaces.msg import Time
from rclpy.node import Node
from rclpy.qos import QoSProfile

from smartmesh_ros.errors import InputError
from smartmesh_ros.node.endpoint_names import EndpointNames
from smartmesh_ros.node.inputs.bounds import require_name
from smartmesh_ros.node.inputs.decoding import MOST_ITEMS, message_from
from smartmesh_ros.node.inputs.own_topics import OwnTopics
from smartmesh_ros.node.inputs.tracking import Tracking
from smartmesh_ros.node.parameters.settings import Settings
from smartmesh_ros.node.refusals import Refusals, shortened
from smartmesh_ros.node.timing.clock import NodeClock, stamp_of
from smartmesh_ros.node.timing.pacing import MOST_CATCH_UP, MOST_JUMP, Pacer
from smartmesh_ros.physics.limits import FARTHEST_BODY
from smartmesh_ros.physics.world import World

# Calls that may wait, and answers that are kept until they are delivered: by default ROS loses all but ten.
SERVICES = QoSProfile(depth=2000)


class Session:
    """One running node.

    ``frame_id``: the terrain's frame, empty until it is known. ``map_taken``: steady time of the last terrain message
    taken [s], None before the first; ``maps``: how many were taken. ``lock``: held by whatever touches the world, for
    executors with several threads. ``handled``: messages and calls so far. ``rival_maps``: publishers whose maps
    disagree. ``doubtful_maps``: what is wrong with the maps, empty where nothing is. ``terrain_subscriptions``: those
    that bring terrain. ``topics``: those that are taken and published. ``names``: of the nodes at their other ends.
    """

    def __init__(self, node: Node, settings: Settings) -> None:
        self.node = node
        self.settings = settings
        self.world = World(config=settings.world)
        self.tracking = Tracking(self.world, settings.body_timeout)
        self.subscriptions: list[Any] = []
        self.topics = OwnTopics(node.resolve_topic_name, settings)
        self.names = EndpointNames()
        self.terrain_subscriptions: list[Any] = []
        self.handled = 0
        self.refusals = Refusals(node.get_logger())
        self.lock = RLock()
        self.clock = NodeClock(node)
        self.pacer = Pacer(settings.world.physics.dt, now=self.clock.pace)
        self.take_pace()
        self.frame_id = settings.frame_id
        self.map_taken: float | None = None
        self.overtaken = 0  # maps that came after one with a newer stamp
        self.maps = 0
        self.rival_maps: list[str] = []
        self.doubtful_maps = ""

    @property
    def paused(self) -> bool:
        """Whether the physics stands still."""
        return self.pacer.paused

    def listen(
        self,
        kind: Any,
        topic: str,
        take: Callable[[Any], None],
        qos: QoSProfile,
        *,
        raw: bool = False,
        private: bool = True,
        most: Callable[[], int] = lambda: MOST_ITEMS,
    ) -> None:
        """Subscribes to ``~/topic``, or to ``topic`` as it is; what ``take`` refuses is counted and logged.

        ``raw``: whether ``take`` reads the message's bytes itself. ``most``: elements allowed in each of its sequences.
        """

        def callback(data: bytes) -> None:
            try:
                with self.lock:
                    self.handled += 1
                    take(data if raw else message_from(data, kind, most()))
            except InputError as error:
                self.refusals.add(topic, error)

        name = f"~/{topic}" if private else topic
        self.topics.take(name)
        self.subscriptions.append(self.node.create_subscription(kind, name, callback, qos, raw=True))

    def answer(self, kind: Any, service: str, act: Callable[[Any], str]) -> None:
        """Serves ``~/service``: ``act`` returns the message of success, or refuses."""

        def callback(request: Any, response: Any) -> Any:
            try:
                with self.lock:
                    self.handled += 1
                    response.message = act(request)
                response.success = True
            except InputError as error:
                self.refusals.add(service, error)
                response.message = shortened(str(error))
                response.success = False
            return response

        self.node.create_service(kind, f"~/{service}", callback, qos_profile=SERVICES)

    def take_pace(self) -> None:
        """Paces the loop as the settings and the clock want it."""
        simulated = self.clock.simulated
        self.pacer.period = self.settings.world.physics.dt
        # The steps that are due come in bursts, with the messages of /clock: none of them is late.
        self.pacer.policy = "catch_up" if simulated else self.settings.deadline
        self.pacer.most_catch_up = MOST_JUMP if simulated else MOST_CATCH_UP
        self.pacer.follows = simulated
        self.pacer.restart()

    def serve(self, kind: Any, service: str, handle: Callable[[Any, Any], None]) -> None:
        """Serves ``~/service`` with responses of other forms, which ``handle`` fills in."""

        def callback(request: Any, response: Any) -> Any:
            self.handled += 1
            with self.lock:
                handle(request, response)
            return response

        self.node.create_service(kind, f"~/{service}", callback, qos_profile=SERVICES)

    def clock_now(self) -> float:
        """The time that stamps are compared with [s]: simulated time if this node publishes it, else its clock."""
        return self.time_at(0.0) if self.settings.publish.clock else self.clock.stamp_now()

    def stamp_now(self) -> Time:
        """The stamp of what is published now."""
        return stamp_of(self.world.time if self.settings.publish.clock else self.clock.stamp_now())

    def time_at(self, age: float) -> float:
        """Simulated time of an instant ``age`` [s] ago, by the clock that stamps are compared with [s]."""
        if self.paused:
            return self.world.time - age
        if self.settings.publish.clock:  # which is simulated time itself
            return self.pacer.simulated_at(0.0, self.world.time) - age
        return self.pacer.simulated_at(age, self.world.time)

    def ahead_of_stamps(self) -> float:
        """By how much simulated time, as the bodies are now, is ahead of the stamp of what is published now [s]."""
        return 0.0 if self.settings.publish.clock else self.world.time - self.time_at(0.0)

    def pace_at(self, age: float) -> float:
        """The loop's own clock ``age`` [s] ago [s]."""
        return self.clock.pace() - age

    def require_not_simulated(self, name: str) -> None:
        """Raises `InputError` if the body is simulated, so that nobody can dictate its pose."""
        known = self.world.bodies.get(name)
        if known is not None and not known.tracked:
            raise InputError("duplicate_id", f"{name!r} is simulated; a tracked body needs another name")

    def note_lost(self) -> None:
        """Counts and logs the bodies that the world took out because they had left everything."""
        for name in self.world.lost:
            error = InputError(
                "lost", f"{name!r} was at no place or farther away than {FARTHEST_BODY:g} m, and was removed"
            )
            self.refusals.add("physics", error)
        self.world.lost.clear()

    def require_frame(self, frame_id: str) -> None:
        """Raises `InputError` if ``frame_id`` is neither empty nor the terrain's frame, or no name."""
        require_name(frame_id, self.settings)
        if self.frame_id and frame_id and frame_id != self.frame_id:
            raise InputError("frame", f"frame {frame_id!r} is not the terrain's frame {self.frame_id!r}")
