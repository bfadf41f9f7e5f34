"""State that all parts of the node share: world, settings, clocks and refusals."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import contextmanager
from threading import RLock
from typing import Any

import pybullet as pb
from builtin_interfaces.msg import Time
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.qos import QoSProfile

from smartmesh_ros.errors import InputError, listed
from smartmesh_ros.ground.state import BodyState
from smartmesh_ros.node.endpoints import OwnTopics
from smartmesh_ros.node.inputs.checked_messages import message_from
from smartmesh_ros.node.inputs.conversions import RobotNames
from smartmesh_ros.node.inputs.tracking import Tracking
from smartmesh_ros.node.parameters.settings import LONGEST_NAME, MOST_BODIES, Settings
from smartmesh_ros.node.refusals import Refusals, shortened, unexpected
from smartmesh_ros.node.services.files import FileWork
from smartmesh_ros.node.services.turns import Turns, Work
from smartmesh_ros.node.timing.pacing import MOST_CATCH_UP, MOST_JUMP, Pacer, stamp_of
from smartmesh_ros.node.timing.stamps import StampClock
from smartmesh_ros.node.transport import Clock, Transport
from smartmesh_ros.stopwatch import Stopwatch
from smartmesh_ros.world.base import Base
from smartmesh_ros.world.world import World

# What is done with a request and its response, or with a response and its error.
Act = Callable[[Any, Any], Any]
# Queue depth of requests and responses. The default of ROS drops all but ten.
SERVICES = QoSProfile(depth=2000)
OUTPUTS = QoSProfile(depth=10)
# Most lost bodies that are named, beside those of the scene.
MOST_LOST = 16
# Errors that end a message or call, and leave the world as it was.
REFUSED = (InputError, pb.error)
# Errors of a step or an output that the node outlives, as of a body that the step left nowhere.
FAILED = (*REFUSED, rclpy_implementation.RCLError)


def require_name(name: str) -> None:
    """Raises `InputError` if the name of a body, tile or frame is too long."""
    if len(name) > LONGEST_NAME:
        raise InputError("name", f"a name of {len(name)} characters; at most {LONGEST_NAME} are possible")


def conclude(response: Any, error: Exception | None) -> None:
    """Write the outcome of a call into a response that has ``success`` and ``message``."""
    response.success = error is None
    if error is not None:
        response.message = shortened(str(error))


class Session:
    """One running node: ``node``, its topics and services, and its ``clock``, of DDS or of a recording.

    ``frame_id``: the terrain's frame, empty until a map sets it. ``last_map_time``: steady time of the last accepted
    terrain message [s], None before the first; ``deck_times``: of the last pose of each deck that follows a frame or an
    odometry; ``maps``: numbers of accepted terrain messages by tile. ``counts``: of what is no refusal but told in the
    diagnostics, by its words there. ``lock``: guards the world, for executors with several threads. ``handled``: number
    of messages and calls so far; ``heard``: full names of the inputs that had messages. ``map_warning``: how maps are
    misused, empty = they are not. ``terrain_subscriptions``: subscriptions to terrain. ``topics``: the node's inputs
    and outputs. ``source_clocks``: of inputs by the names of their sources. ``turns``: answers under way. ``files``:
    reads files and prepares robots. ``bases``: robots that drive, by name. ``lost``: why bodies were removed, by name,
    until a reset; ``losses``: number of all so far.
    """

    def __init__(self, node: Transport, settings: Settings, clock: Clock) -> None:
        self.node, self.clock = node, clock
        self.settings = settings
        self.world = World(config=settings.world, stopwatch=Stopwatch(now=clock.steady))
        self.world.say, self.world.note = node.get_logger().warning, node.get_logger().info
        self.tracking = Tracking(self.world, settings.body_timeout, settings.max_velocity)
        self.bases = {entry.body: Base(self.world, entry.body, entry.config) for entry in settings.bases}
        self.robot_names = RobotNames(self.world, always=settings.robot_prefix)
        self.counts: Counter[str] = Counter()
        self.source_clocks: list[dict[str, StampClock]] = []
        self.subscriptions: list[Any] = []
        self.publishers: list[Any] = []
        self.topics = OwnTopics(node.resolve_topic_name)
        self.terrain_subscriptions: list[Any] = []
        self.handled, self.heard = 0, set[str]()
        self.refusals = Refusals(node.get_logger(), clock.steady)
        self.lock = RLock()
        self.pacer = Pacer(settings.world.physics.dt, now=self.clock.pace)
        self.configure_pacer()
        self.frame_id = settings.frame_id
        self.last_map_time: float | None = None
        self.deck_times: dict[str, float] = {}
        self.maps: Counter[str] = Counter()
        self.map_warning = ""
        self.turns = Turns()
        self.files = FileWork()
        self.lost: dict[str, str] = {}
        self.losses = 0
        self._seen, self._stalled = math.inf, 0.0

    @property
    def marker_namespace(self) -> str:
        """The field ``ns`` of markers, which tells those of several nodes on one topic apart: the node's namespace."""
        return self.node.get_namespace().strip("/") or "patches"

    @property
    def paused(self) -> bool:
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
    ) -> Any:
        """Subscribes to ``~/topic``, or to ``topic`` if not ``private``; counts and logs what ``take`` refuses. Returns
        the subscription. ``raw``: ``take`` gets the message's bytes."""

        def callback(data: bytes) -> None:
            try:
                with self.lock:
                    self.handled += 1
                    self.heard.add(full)
                    take(data if raw else message_from(data, kind))
            except REFUSED as error:
                self.refusals.add(topic, error)

        name = f"~/{topic}" if private else topic
        full = self.topics.register(name, self.topics.taken)
        self.subscriptions.append(self.node.create_subscription(kind, name, callback, qos, raw=True))
        return self.subscriptions[-1]

    def publisher(self, kind: Any, topic: str, qos: QoSProfile = OUTPUTS) -> Any:
        """Return a publisher of a private topic; raises `InputError` if the node subscribes to it."""
        self.topics.register(topic, self.topics.published)
        self.publishers.append(self.node.create_publisher(kind, topic, qos))
        return self.publishers[-1]

    @contextmanager
    def enduring(self, part: str) -> Iterator[None]:
        """Counts and logs a failure in the block, also of PyBullet or DDS, and goes on after it."""
        try:
            yield
        except FAILED as error:
            self.refusals.add(part, error)

    def configure_pacer(self) -> None:
        """Configures the pacer for the settings and the clock, and restarts it."""
        simulated = self.clock.simulated
        self.pacer.period = self.settings.world.physics.dt
        # Messages of /clock release several steps at once; none of these steps is late.
        self.pacer.policy = "catch_up" if simulated else self.settings.deadline
        self.pacer.most_catch_up = MOST_JUMP if simulated else MOST_CATCH_UP
        self.pacer.follows_clock = simulated
        self.pacer.restart()

    def serve(self, kind: Any, service: str, handle: Act, conclude: Act = conclude) -> None:
        """Serves ``~/service`` with the response that `answered` returns. The call runs at once until it first awaits,
        and then in turns."""

        def start(request: Any, response: Any) -> Any:
            self.handled += 1
            steps = self.answered(service, handle, request, response, conclude)
            try:
                steps.send(None)
            except StopIteration as end:
                return end.value
            return Work(steps)

        self.turns.answer_later(self.node.create_service(kind, f"~/{service}", start, qos_profile=SERVICES))

    async def answered(self, service: str, handle: Act, request: Any, response: Any, conclude: Act = conclude) -> Any:
        """Return the response to a request; a refusal, and any other error, is counted and logged.

        ``handle`` fills in the response, or raises `InputError`. It may be a coroutine, which holds the ``lock`` where
        it needs the world, and awaits `next_turn` between parts of its work, so that steps are not late. ``conclude``
        writes the outcome into the response: the error, or None.
        """
        outcome: Exception | None = None
        try:
            with self.lock:
                rest = handle(request, response)
            if rest is not None:
                await rest
        except REFUSED as error:
            outcome = error
        except Exception as error:  # noqa: BLE001  # each call is answered, and none ends the node
            outcome = unexpected(error)
        if outcome is not None:
            self.refusals.add(service, outcome)
        conclude(response, outcome)
        return response

    def awake(self) -> float:
        """Return the loop's time [s] without that in which it was held up, by more than a period and than it can catch
        up with: that is no silence of peers and sources, whose messages wait to be read."""
        now, before = self.clock.pace(), self._seen
        self._seen = now
        self._stalled += max(now - before - max(self.pacer.most_catch_up, self.pacer.period), 0.0)
        return now - self._stalled

    def clock_now(self) -> float:
        """Return the time to compare stamps with [s]: simulated time if the node publishes it, else its clock."""
        return self.time_at(0.0) if self.settings.publish.clock else self.clock.stamp_now()

    @property
    def waits_for_clock(self) -> bool:
        """True before the first message of ``/clock``."""
        return self.clock.simulated and not self.clock.stamp_now()

    @property
    def simulates_stamps(self) -> bool:
        """True if stamps are simulated times, of this node or of another."""
        return self.settings.publish.clock > 0.0 or self.clock.simulated

    def state_time(self) -> float:
        """Return the time of the bodies' states on the clock that stamps are compared with [s]."""
        if self.settings.publish.clock:
            return self.world.time
        return self.clock.stamp_now() + self.world.time - self.time_at(0.0)

    def stamp_now(self) -> Time:
        """Return the stamp for messages published now. Under simulated time it is that of the bodies' states, because
        one message of ``/clock`` may release several steps."""
        return stamp_of(self.state_time() if self.simulates_stamps else self.clock.stamp_now())

    def time_at(self, age: float) -> float:
        """Return the simulated time [s] of the instant ``age`` [s] ago on the clock that stamps are compared with."""
        if self.paused:
            return self.world.time - age
        if self.settings.publish.clock:  # stamps are simulated times
            return self.pacer.simulated_at(0.0, self.world.time) - age
        return self.pacer.simulated_at(age, self.world.time)

    def require_room(self, names: Iterable[str]) -> None:
        """Raises `InputError` if bodies of these names would be too many with those of the world."""
        there = self.world.bodies
        count = len(there) + len({name for name in names if name not in there})
        if count > MOST_BODIES:
            raise InputError("size", f"{count} bodies; at most {MOST_BODIES} are possible")

    def remove(self, name: str) -> None:
        if name in self.tracking.names:
            self.tracking.forget(name)
        else:
            self.world.remove(name)

    def require_not_simulated(self, name: str) -> None:
        """Raises `InputError` if the body is simulated, because only the physics may move it."""
        known = self.world.bodies.get(name)
        if known is not None and not known.tracked:
            raise InputError("duplicate_id", f"{name!r} is simulated; a tracked body needs another name")

    def start_of(
        self, name: str, state: BodyState, *, on_ground: bool = False, cure: str = "on_ground: true chooses the height"
    ) -> str:
        """Return how a body starts otherwise than asked, and log it; empty if it does not. ``cure``: what to do about a
        start below the ground."""
        words, (x, y, z) = "", state.position
        ground = float("nan") if on_ground else float(self.world.ground_at([[x, y]]).z[0])
        if not on_ground and self.world.terrain.empty:
            words = f"{name!r} falls, because there is no ground before the first map"
        elif z < ground and name in (below.partition("/")[0] for below in self.world.below_ground()):
            words = (
                f"{name!r} starts {ground - z:.2f} m below the ground, which is at z = {ground:.2f} m there, and is "
                f"put onto it; {cure}"
            )
        if words:
            self.node.get_logger().warning(words)
        return words

    def note_lost(self, initial: Collection[str]) -> None:
        """Counts and logs the bodies that the world removed because they were far below the ground, or nowhere.
        Remembers the ``initial`` ones, and the last `MOST_LOST` others."""
        lost = [f"{name!r} {why}, and was removed" for name, why in self.world.lost.items()]
        if not lost:
            return
        self.losses += len(lost)
        self.node.get_logger().warning(f"{listed(lost, between='; ')}; spawn again what is missed")
        self.lost |= self.world.lost
        self.world.lost.clear()
        for name in [name for name in self.lost if name not in initial][:-MOST_LOST]:
            del self.lost[name]

    def require_frame(self, frame_id: str) -> None:
        """Raises `InputError` if ``frame_id`` is too long, or neither empty nor the terrain's frame."""
        require_name(frame_id)
        if self.frame_id and frame_id and frame_id != self.frame_id:
            decks = "".join(f", nor {entry.frame!r} of deck {entry.deck!r}" for entry in self.settings.decks[:5])
            words = f"frame {frame_id!r} is not the terrain's frame {self.frame_id!r}{decks}"
            raise InputError("frame", f"{words}; the parameter frame_id sets that, or else the first map does")
