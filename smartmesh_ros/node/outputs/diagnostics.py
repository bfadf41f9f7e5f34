"""``/diagnostics``: the node's state, once a second and whenever a publisher appears or disappears."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import chain, islice
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from smartmesh_ros.errors import listed
from smartmesh_ros.node.endpoints import incompatible_peers, unheard_latched
from smartmesh_ros.node.fleet.peers import PeerBodies
from smartmesh_ros.node.outputs.clock_publishing import ClockPublishing, ClockWatch
from smartmesh_ros.node.outputs.rates import Rhythm
from smartmesh_ros.node.session import OUTPUTS, Session

# A map older than this is stale, and so is the pose of a deck [s].
STALE = 2.0
# Most inputs whose stamps are reported.
MOST_AGES = 32
# Time without a map after which a latched publisher may have sent its only one before [s]. Until then the map may be on
# its way: a source that starts with the node makes it, or the machine is busy.
PATIENCE = 3.0
# Rates of the diagnostics, and of the check for appearing and disappearing publishers [Hz].
DIAGNOSTICS_RATE, CONNECTIONS_RATE = 1.0, 10.0
# A smaller share of the clock's time that is simulated is too slow.
SLOW = 0.95
# Shortest time over which a real-time factor is measured [s].
MIN_WINDOW = 0.5


class PaceWindow:
    """Measures time, real-time factor and missed deadlines between readings.

    The factor is 1 at first and after a restart of the loop. It is updated at most every `MIN_WINDOW`, because a few
    steps give no reliable factor. Steps that the newest message of ``/clock`` has released count as done, because it
    may release many at once. ``now``: the time in place of real time [s], None = that.
    """

    def __init__(self, session: Session, now: Callable[[], float] | None = None) -> None:
        self._session, self._now = session, now or session.clock.steady
        self._read, self._misses = self._now(), 0
        self._start, self._time, self._factor = self._read, session.world.time, 1.0
        self._restarts = session.pacer.restarts

    def read(self) -> tuple[float, float, int]:
        """Return time since the last reading [s], real-time factor, and deadlines missed since the last reading."""
        now, world, pacer = self._now(), self._session.world, self._session.pacer
        time = world.time + min(max(-pacer.remaining(), 0.0), pacer.interval)
        length, misses = max(now - self._read, 1e-9), pacer.misses - self._misses
        if self._restarts != pacer.restarts:
            self._restarts, self._start, self._time, self._factor = pacer.restarts, now, time, 1.0
        elif now - self._start >= MIN_WINDOW:
            self._factor = max(time - self._time, 0.0) / (now - self._start)
            self._start, self._time = now, time
        self._read, self._misses = now, pacer.misses
        return length, self._factor, misses


class Diagnostics:
    """Publishes the state of the node's tasks: terrain, bodies, physics, inputs, connections.

    ``clock``: the node's output on ``/clock``. ``waiting``: returns the bodies that wait for ground, by name, and
    whether they are being put onto it.
    """

    def __init__(
        self, session: Session, peers: PeerBodies, clock: ClockPublishing, waiting: Callable[[], Mapping[str, bool]]
    ) -> None:
        self._session, self._peers, self._clock, self._waiting = session, peers, clock, waiting
        self._world = session.world
        self._publisher = session.node.create_publisher(DiagnosticArray, "/diagnostics", OUTPUTS)
        self._clock_watch, self._namesakes = ClockWatch(session), 0
        self._window, self._clock_window = PaceWindow(session), PaceWindow(session, session.clock.pace)
        self._rhythm, self._look = Rhythm(session.clock.steady()), Rhythm()
        self._connections: dict[str, int] = {}  # numbers of connected publishers by topic
        self._incompatible: set[str] = set()  # topics of peers that are told of
        self._refused_before = self._lost_before = 0
        self._waiting_since, self._told = self._session.clock.steady(), False

    def publish(self, now: float) -> None:
        """Publish the state if it is due at the steady time ``now`` [s], or if a publisher appeared or disappeared."""
        changed = self._look.is_due(now, CONNECTIONS_RATE) and self._connections_changed()
        if not self._rhythm.is_due(now, DIAGNOSTICS_RATE, now=changed):
            return
        node_name = self._session.node.get_fully_qualified_name()
        message = DiagnosticArray(
            status=[
                task_status(node_name, "terrain", *self._terrain()),
                task_status(node_name, "bodies", *self._bodies()),
                task_status(node_name, "physics", *self._physics()),
                task_status(node_name, "inputs", *self._inputs()),
                task_status(node_name, "connections", *self._ends()),
            ]
        )
        message.header.stamp = self._session.stamp_now()
        self._publisher.publish(message)
        self._warn_of_namesakes()

    def _warn_of_namesakes(self) -> None:
        """Log whenever another node of the same full name appears, which hears and answers the same calls."""
        node, before = self._session.node, self._namesakes
        self._namesakes = node.get_node_names_and_namespaces().count((node.get_name(), node.get_namespace())) - 1
        if self._namesakes > before:
            node.get_logger().warning(
                f"another node is called {node.get_fully_qualified_name()}, or was until seconds ago: both hear the "
                "same topics, and either answers calls meant for the other; give one a namespace (-r __ns:=/name) or "
                "another ROS_DOMAIN_ID"
            )

    def _connections_changed(self) -> bool:
        before = self._connections
        self._connections = {end.topic_name: end.get_publisher_count() for end in self._session.subscriptions}
        return self._connections != before

    def _terrain(self) -> tuple[bytes, str, dict[str, Any]]:
        session, tiles = self._session, self._world.terrain.tiles
        sources = sum(topic.get_publisher_count() for topic in session.terrain_subscriptions)
        values: dict[str, Any] = {"tiles": len(tiles), "samples": sum(tile.size for tile in tiles.values())}
        for name, tile in list(tiles.items())[:16]:
            values[f"size of {name!r}"] = tile.description
            values[f"updates of {name!r}"] = session.maps[name]
        ages = {name: session.clock.steady() - heard for name, heard in sorted(session.deck_times.items())}
        for name, old in ages.items():
            values[f"tiles of deck {name!r}"] = len(self._world.terrain.deck(name).tiles)
            values[f"age of deck {name!r} [s]"] = f"{old:.3f}"
        values["publishers"] = sources
        unheard = self._unheard()
        if session.last_map_time is None:
            if self._world.terrain.empty:
                return DiagnosticStatus.WARN, f"no map yet: {unheard}" if unheard else "no map yet", values
            return DiagnosticStatus.OK, "the ground of a restored state", values
        age = session.clock.steady() - session.last_map_time
        values["age [s]"] = f"{age:.3f}"
        text = f"the last map is {age:.1f} s old"
        if silent := [name for name, old in ages.items() if old > STALE]:
            return DiagnosticStatus.WARN, f"no pose comes of the decks {listed(silent)}, which rest", values
        waiting = [entry.deck for entry in session.settings.decks if entry.deck not in self._world.terrain.decks]
        if self._world.terrain.empty and not waiting:
            return DiagnosticStatus.WARN, "no map any more: the last one was removed", values
        # A single map may be static terrain; after several maps, more are expected.
        if age > STALE and not sources and session.maps.total() > 1:
            return DiagnosticStatus.WARN, f"{text}, and nobody publishes maps any more", values
        if session.map_warning:
            return DiagnosticStatus.WARN, session.map_warning, values
        if unheard:
            return DiagnosticStatus.WARN, unheard, values
        if waiting:
            words = f"no ground yet: the decks {listed(waiting)}, of whose frame, topic or body no pose came"
            return DiagnosticStatus.WARN, words, values
        if age > STALE:
            return DiagnosticStatus.OK, text, values
        return DiagnosticStatus.OK, "maps arrive", values

    def _unheard(self) -> str:
        """Return why the map of a latched publisher may be missed, empty if none may; log it once it lasts
        `PATIENCE`."""
        session, now = self._session, self._session.clock.steady()
        silent = [end for end in session.terrain_subscriptions if end.topic_name not in session.heard]
        unheard = unheard_latched(session.node, silent)
        # A node that waits for the clock says nothing, because the publisher may wait for it, too.
        if not unheard or session.waits_for_clock:
            self._waiting_since = now
        elif now - self._waiting_since > PATIENCE and not self._told:
            start = "no map yet: " if self._world.terrain.empty else ""
            session.node.get_logger().warning(f"{start}{unheard}")
            self._told = True
        return unheard

    def _bodies(self) -> tuple[bytes, str, dict[str, Any]]:
        world, peers = self._world, self._peers.summaries()
        below = world.below_ground()
        losses = self._session.losses
        new_losses, self._lost_before = losses - self._lost_before, losses
        patches, remote = len(world.patches().slots), sum(follower.remote for follower in world.followers)
        values: dict[str, Any] = {
            "simulated": sum(body.simulated for body in world.bodies.values()),
            "tracked": sum(body.tracked for body in world.bodies.values()),
            "asleep": sum(world.is_asleep(body.name) for body in world.bodies.values()),
            "patches": patches,
            "out of reach of the ground": len(world.followers) - remote - patches,
            "below ground": len(below),
            "falling": len(world.falls.falling),
            "put back onto the ground": world.rescues,
            "lost": losses,
            **{f"lost, {name}": why for name, why in self._session.lost.items()},
        }
        if peers:
            values["guests"] = remote
            values |= {f"peer {name}": words for name, words in peers.items()}
        if below:
            return DiagnosticStatus.ERROR, f"below the ground: {listed(below)}", values
        if new_losses:
            return DiagnosticStatus.WARN, f"{new_losses} lost in the last second", values
        if falling := world.falls.falling:
            places = [f"{name} at ({x:.2f}, {y:.2f})" for name, (x, y, _) in falling.items()]
            return DiagnosticStatus.WARN, f"fell off the ground: {listed(places)}", values
        waiting = [name for name, begun in self._waiting().items() if not begun]
        if waiting and not world.terrain.empty:
            return DiagnosticStatus.WARN, f"no ground yet where they start: {listed(waiting)}", values
        if silent := self._peers.silent():
            return DiagnosticStatus.WARN, f"not heard: {', '.join(silent)}", values
        if missing := self._missing():
            return DiagnosticStatus.WARN, f"no such body: {listed(missing)}", values
        return DiagnosticStatus.OK, f"{patches} patches", values

    def _missing(self) -> list[str]:
        """Return the bodies that outputs and bases name, and that are not there and do not wait for ground."""
        settings, there = self._session.settings, {*self._world.bodies, *self._waiting()}
        named = {name: getattr(settings, name) for name in ("height_scans", "ground_maps", "imus", "bases")}
        return [f"{entry.body} of {name}" for name, of in named.items() for entry in of if entry.body not in there]

    def _physics(self) -> tuple[bytes, str, dict[str, Any]]:
        session = self._session
        (_, factor, _), (_, pace, _) = self._window.read(), self._clock_window.read()
        clock_wait = self._clock_watch.check()
        values = {
            "real-time factor": f"{factor:.3f}",
            "deadline misses": session.pacer.misses,
            "paused": session.paused,
        }
        if session.paused:
            return DiagnosticStatus.OK, "paused", values
        if clock_wait:
            return DiagnosticStatus.WARN, clock_wait, values
        follows = session.clock.simulated
        if pace < SLOW:
            return DiagnosticStatus.WARN, f"slower than {'/clock' if follows else 'real time'} ({pace:.2f})", values
        return DiagnosticStatus.OK, "as fast as /clock" if follows else "in real time", values

    def _inputs(self) -> tuple[bytes, str, dict[str, Any]]:
        counts = self._session.refusals.counts
        total, values = counts.total(), {f"refused, {reason}": count for reason, count in sorted(counts.items())}
        values |= self._session.counts
        new, self._refused_before = total - self._refused_before, total
        if new:
            return DiagnosticStatus.WARN, f"{new} refused in the last second", values
        return DiagnosticStatus.OK, f"{total} refused so far", values

    def _ends(self) -> tuple[bytes, str, dict[str, Any]]:
        session, rivals = self._session, self._clock.rivals
        incompatible = incompatible_peers(session.node, session.subscriptions, session.publishers)
        values: dict[str, Any] = {f"publishers of {topic}": count for topic, count in self._connections.items()}
        # In the reverse order, because those of peers, who may be many, were made first.
        sources = chain.from_iterable(clocks.items() for clocks in reversed(session.source_clocks))
        ages = islice(((source, clock.age) for source, clock in sources if clock.age is not None), MOST_AGES)
        values |= {f"age of stamps on arrival, {source} [s]": f"{age:.3f}" for source, age in ages}
        values |= {f"incompatible peers on {topic}": peers for topic, peers in incompatible.items()}
        for topic in incompatible.keys() - self._incompatible:
            session.node.get_logger().warning(f"incompatible peers on {topic}: {incompatible[topic]}")
        self._incompatible = set(incompatible)
        if rivals:
            values["/clock is also published by"] = ", ".join(rivals)
            return DiagnosticStatus.ERROR, f"silent on /clock, which {rivals[0]} publishes", values
        if incompatible:
            return DiagnosticStatus.WARN, f"incompatible peers on {', '.join(incompatible)}", values
        return DiagnosticStatus.OK, "no incompatible peers", values


def task_status(node_name: str, task: str, level: bytes, text: str, values: dict[str, Any]) -> DiagnosticStatus:
    """Return a status with its values by key. Its name has the namespace of the node."""
    pairs = [KeyValue(key=key, value=str(value)) for key, value in values.items()]
    name = f"{node_name.strip('/')}: {task}"
    return DiagnosticStatus(level=level, name=name, message=text, hardware_id=node_name, values=pairs)
