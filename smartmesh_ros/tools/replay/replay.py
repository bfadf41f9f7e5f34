"""A collider that lives in a recording: it gets each message when it was received, steps in between, and publishes."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from pathlib import Path
from time import sleep
from typing import TYPE_CHECKING, Any

from rcl_interfaces.msg import ParameterEvent
from rclpy.parameter import Parameter
from rclpy.serialization import deserialize_message, serialize_message
from rosgraph_msgs.msg import Clock
from service_msgs.msg import ServiceEventInfo

from smartmesh_ros.errors import InputError, as_float, require
from smartmesh_ros.node.inputs.checked_messages import message_from
from smartmesh_ros.node.parameters.helping import flat
from smartmesh_ros.node.parameters.specifications import NAMES, settings_from
from smartmesh_ros.node.terrain_collider import Collider
from smartmesh_ros.tools.replay.bag import EVENTS, Bag, Messages, Record, Source, type_of
from smartmesh_ros.tools.replay.checks import STATES, left_out, require_named, require_taken, require_type
from smartmesh_ros.tools.replay.clock import ReplayClock
from smartmesh_ros.tools.replay.digest import Digest
from smartmesh_ros.tools.replay.parameters import require_changeable, require_known
from smartmesh_ros.tools.replay.transport import InProcess, Log, Names, Publisher
from smartmesh_ros.world.world import World

if TYPE_CHECKING:
    from smartmesh_ros.tools.replay.mcap_file import McapFile

# Topics that are read beside the inputs; those of transforms become inputs when a message needs them.
CLOCK, PARAMETERS, TRANSFORMS = "/clock", "/parameter_events", ("/tf", "/tf_static")
# Outputs that parameters may begin at any time.
LATER = "/tf", CLOCK
# Differences of times that are rounding errors [s].
SLACK = 1e-6


class Replay:
    """A run of the collider. Close it, or use it as a context manager.

    Time zero, at which the first step begins, is that of the first message for the collider. A message is taken before
    the step that begins when it arrives. Answers to calls take no time.
    ``collider``, ``world``: as in the node. ``time`` [s]: how far the run has come. ``log``: what the node would log.
    Raises `InputError` if the collider refuses its parameters, if nothing in the recording is for it, or if a message
    of a list is not.

    Names of topics and services without a leading ``/`` are below that of the node.
    """

    def __init__(
        self,
        source: Source | str | Path | Sequence[tuple[str, float, Any]],
        parameters: Mapping[str, Any] | None = None,
        *,
        remap: Mapping[str, str] | Sequence[tuple[str, str]] = (),
        keep: str | Collection[str] = (),
        file: McapFile | None = None,
        topics: str | Collection[str] = (),
        say: Callable[[str], None] | None = None,
    ) -> None:
        """``source``: a recording, the path of a bag, or a list of (topic, time [s], message) and (service, time [s],
        request). ``parameters``: of terrain_collider, by name, or in groups as in a file. ``remap``: new names of
        topics and services, as of ``--ros-args -r``. ``keep``: outputs whose messages `received` returns. ``file``:
        gets the outputs, or only these ``topics``. ``say``: gets the lines of ``log``."""
        self.log: list[str] = []
        self.names = Names(remap)
        self._kept: dict[str, list[Any]] = {name: [] for name in self.names.all_of(keep)}
        self._file, self._topics = file, set(self.names.all_of(topics))
        if isinstance(source, str | Path):
            source = Bag(Path(source))
        elif not isinstance(source, Source):
            source = Messages(source, self.names.node)
        self._source, self._values = source, dict(flat(dict(parameters or {})))
        require_known(self._values)
        settings = settings_from(self._values)
        self.clock = ReplayClock(0.0, simulated=bool(self._values.get("use_sim_time")) and CLOCK in source.topics)
        self.node = InProcess(self.names, Log(self.clock, say or self.log.append), source.topics, self._sink)
        self.collider = Collider(self.node, settings, self.clock)
        try:
            self._calls = self._call_events()
            require_named(self.names.node, "output", self._kept, {*self.outputs, *map(self.names.resolve, LATER)})
            self._records = source.records(self._wanted())
            self._next = next(self._records, None)
            if self._next is None:
                there = "\n".join(f"  {name}  {kind}" for name, kind in self._inputs)
                raise source.refusal("topic", f"nothing here is for {self.names.node}, whose inputs are\n{there}")
        except BaseException:
            self.collider.close()
            raise
        self.clock.start = self._next.time
        self.clock.elapsed = -self.world.dt
        self.collider.pacer.restart()
        self.clock.elapsed = 0.0
        self._digest = Digest(self.world)

    def __enter__(self) -> Replay:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the run."""
        self.collider.close()

    @property
    def world(self) -> World:
        """The simulated world."""
        return self.collider.session.world

    @property
    def time(self) -> float:
        """Time since the first message [s]."""
        return self.clock.elapsed

    @property
    def digest(self) -> str:
        """SHA-256 of all states and contacts so far."""
        return self._digest.hexadecimal()

    @property
    def outputs(self) -> set[str]:
        """Full names of the outputs."""
        rates = self.collider.settings.publish
        later = {"/tf": rates.tf, CLOCK: rates.clock}  # the publishers of these come with the first message
        return {*self.node.publishers, *(self.names.resolve(topic) for topic, rate in later.items() if rate)}

    @property
    def left_out(self) -> dict[str, str]:
        """Recorded topics of which nothing is made, although they may be meant for the node, with their types."""
        others = {*self.outputs, *self._event_kinds}
        return left_out(self.names.node, self._source.topics, dict(self._inputs), others)

    @property
    def refused(self) -> dict[str, int]:
        """Counts of refused messages and calls, by "topic: reason"."""
        return dict(self.collider.refusals.counts)

    def run(self, until: float = math.inf) -> None:
        """Go on until ``until`` [s], or until the last message."""
        for _ in self.steps(until):
            pass

    def steps(self, until: float = math.inf) -> Iterator[None]:
        """Do the same, and yield after each step and message. What is left of it can be done later."""
        require(not math.isnan(as_float(until)), "parameter", "until", until, "a number of seconds")
        while self._next is not None and (at := max(self._next.time - self.clock.start, self.clock.elapsed)) <= until:
            yield from self._steps_to(at)
            record, self._next = self._next, next(self._records, None)
            self._take(record)
            yield
            if self.clock.simulated:
                yield from self._steps_to(math.inf)
        if until < math.inf:
            yield from self._steps_to(until)

    def give(self, topic: str, message: Any) -> None:
        """Give the collider a message, or its bytes, now. Raises `InputError` if it has no input of this name and
        type."""
        name = self.names.full(topic)
        require_named(self.names.node, "input", [name], {*dict(self._inputs), *TRANSFORMS})
        for subscription in self.node.subscriptions.get(name, []):
            require_type(name, message, subscription.kind, bytes)
        self.node.deliver(name, message if isinstance(message, bytes) else serialize_message(message))
        self._settle()

    def call(self, service: str, request: Any) -> Any:
        """Call a service now, and return its response. Raises `InputError` if the collider has none of this name and
        type."""
        name = self.names.full(service)
        require_named(self.names.node, "service", [name], self.node.services)
        require_type(name, request, self.node.services[name].kind.Request)
        answers = self.node.services[name].call(request)
        self._settle()
        return answers[0]

    def received(self, topic: str) -> list[Any]:
        """Return the messages of an output that is kept, so far. Raises `InputError` for another one."""
        name = self.names.full(topic)
        if name not in self._kept:
            raise InputError("name", f"{topic} is not kept; name it in keep=[{topic!r}]")
        return self._kept[name]

    def set(self, **values: Any) -> None:
        """Set parameters, with ``__`` for the dots in their names; raise `InputError` if the node would refuse them."""
        named = {name.replace("__", "."): value for name, value in values.items()}
        require_known(named)
        require_changeable(named)
        self._set(named)

    def _set(self, values: Mapping[str, Any]) -> None:
        changed = {**self._values, **values}
        settings = settings_from(changed)
        self._values = changed
        self.collider.configure(settings, set(values))

    def _steps_to(self, time: float) -> Iterator[None]:
        """Do the steps that begin before ``time`` [s], or, if ``/clock`` rules, those that it has released."""
        pacer, clock = self.collider.pacer, self.clock
        while pacer.remaining() <= 0.0 if clock.simulated else pacer.deadline < time - SLACK:
            if not clock.simulated:
                clock.elapsed = max(pacer.deadline, clock.elapsed)
            self.collider.tick(pacer.advance)
            self._settle()
            yield
        clock.elapsed = max(clock.elapsed, time if time < math.inf else 0.0)

    def _settle(self) -> None:
        """Finish what a message, a call or a step has begun, and take note of the steps in it."""
        turns = self.collider.session.turns
        while self.node.deliver_waiting() or len(turns):
            if len(turns) and not self.collider.turn():
                sleep(1e-3)  # for a robot that is being prepared
        self._digest.note()

    def _take(self, record: Record) -> None:
        refusals = self.collider.refusals
        try:
            if record.topic.endswith(EVENTS):
                self._take_call(record)
            elif record.topic == CLOCK and self.clock.simulated:
                now = message_from(record.data, Clock).clock
                self.clock.set_simulated(now.sec + 1e-9 * now.nanosec)
            elif record.topic == PARAMETERS:
                self._take_parameters(message_from(record.data, ParameterEvent))
            else:
                self.node.deliver(record.topic, record.data)
        except InputError as error:
            refusals.add(record.topic, error)
        self._settle()

    def _take_call(self, record: Record) -> None:
        """Make the call of a service event, unless it is the event of an answer."""
        service = self.node.services[record.topic.removesuffix(EVENTS)]
        event = message_from(record.data, service.kind.Event)
        if event.info.event_type != self._calls[record.topic]:
            return
        if not event.request:
            raise InputError("content", "the event has no request: set the introspection of the service or of its "
                             "client to CONTENTS")  # fmt: skip
        service.call(event.request[0])

    def _take_parameters(self, event: Any) -> None:
        """Set the parameters that the recorded node changed while it ran."""
        if event.node != self.names.node:
            return
        changed = [Parameter.from_parameter_msg(one) for one in event.changed_parameters if one.name in NAMES]
        if changed:
            self._set({one.name: one.value for one in changed})

    def _call_events(self) -> dict[str, int]:
        """Return which event of each recorded service stands for a call: that of the server, which a client may have
        recorded besides, or else that of the client."""
        there = self._event_kinds.keys() & self._source.topics
        found = dict.fromkeys(there, int(ServiceEventInfo.REQUEST_SENT))
        for record in self._source.records(there):
            kind = int(record.data[4]) if len(record.data) > 4 else -1  # the first field of ServiceEventInfo
            if kind == ServiceEventInfo.REQUEST_RECEIVED:
                found[record.topic] = kind
        return found

    def _wanted(self) -> Collection[str]:
        """Return the recorded topics that are for the collider, or may be; raise `InputError` if one is of another
        type than its input, or if a list of messages has others."""
        topics, own = self._source.topics, dict([*self._inputs, *self._event_kinds.items()])
        for name, kind in {**own, CLOCK: type_of(Clock), PARAMETERS: type_of(ParameterEvent)}.items():
            if name in topics and topics[name].type_name != kind:
                raise self._source.refusal("topic", f"{name} has {topics[name].type_name}, and must have {kind}")
        others = {*TRANSFORMS, PARAMETERS, CLOCK}
        found = {topic for topic in topics if topic in {*own, *others} or topic.endswith(STATES)}
        if isinstance(self._source, Messages) and found & own.keys():
            left = {topic: about for topic, about in topics.items() if topic not in found}
            require_taken(self.names.node, left, dict(self._inputs), self.node.services)
        return found if found & own.keys() else set()

    @property
    def _event_kinds(self) -> dict[str, str]:
        """Types of the topics with the events of the services, by name."""
        return {f"{name}{EVENTS}": type_of(service.kind) + "_Event" for name, service in self.node.services.items()}

    @property
    def _inputs(self) -> list[tuple[str, str]]:
        """Names and types of the inputs."""
        return sorted({(name, type_of(one.kind)) for name, found in self.node.subscriptions.items() for one in found})

    def _sink(self, publisher: Publisher) -> Callable[[bytes], None] | None:
        """Return what takes the bytes of an output, None = nobody does."""
        kept = self._kept.get(publisher.topic_name)
        if kept is not None:
            return lambda data: kept.append(deserialize_message(data, publisher.kind))
        file, wanted = self._file, not self._topics or publisher.topic_name in self._topics
        if file is None or not wanted:
            return None
        return lambda data: file.write(publisher, self.clock.start + self.clock.elapsed, data)
