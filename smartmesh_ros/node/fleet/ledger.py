"""Which node of a fleet simulates which body, which of them live, and what becomes of the bodies of one that dies."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple

from smartmesh_ros.errors import InputError
from smartmesh_ros.physics.state_table import StateTable

Spread = Literal["fewest", "tiles"]
Respawn = Literal["elsewhere", "same"]


@dataclass(frozen=True, kw_only=True)
class LedgerConfig:
    """How bodies are spread and kept.

    ``spread``: a body goes to the node with the fewest, or to that of the tile it starts on, of ``tile_size`` [m] a
    side, so that neighbours share a node. ``timeout`` [s]: a node that is not heard for so long is dead; longer than
    any pause of a machine under load. ``restart`` [s]: a node that was silent for so long and has lost bodies was
    started anew; less than a start takes. ``respawn``: bodies of a dead node go to a node that lives, or wait for
    theirs. ``settled`` [s]: a body that was spawned is expected in its node's states after this.
    """

    spread: Spread = "fewest"
    tile_size: float = 20.0
    timeout: float = 2.0
    restart: float = 0.5
    respawn: Respawn = "elsewhere"
    settled: float = 2.0

    def __post_init__(self) -> None:
        for name in ("tile_size", "timeout", "restart", "settled"):
            if not (math.isfinite(value := getattr(self, name)) and value > 0.0):
                raise InputError("parameter", f"{name} is {value}; it must be greater than zero")


class Last(NamedTuple):
    """The last that was heard of a body: a ``row`` of ``states``; None = it was lost before it was heard of."""

    states: StateTable | None
    row: int = 0


@dataclass(eq=False)
class Member:
    """A node: when it was ``heard`` last [s], whether it lives, whether it was silent for a while before that, the
    last states of its bodies with their rows by name, and those from before it was silent."""

    heard: float = -math.inf
    alive: bool = False
    returned: bool = False
    states: StateTable | None = None
    rows: dict[str, int] = field(default_factory=dict)
    before: dict[str, Last] = field(default_factory=dict)

    @property
    def last(self) -> dict[str, Last]:
        """The last states by name."""
        assert self.states is not None or not self.rows
        return {name: Last(self.states, row) for name, row in self.rows.items()}


@dataclass(eq=False)
class Entry:
    """A body: its node; the request that spawned it, if it came by the front; whether its node has told of it; when
    it was spawned [s], infinite while that is asked for; and where it was, while it waits to be spawned again."""

    node: str
    request: Any = None
    seen: bool = False
    asked: float = -math.inf
    lost: Last | None = None


class Respawning(NamedTuple):
    """A body that ``node`` is to spawn, as it was ``last``; ``request``: what spawned it first, if it is known."""

    name: str
    node: str
    request: Any
    last: Last


class Duties(NamedTuple):
    """What is to be done: nodes that ``died`` and ``joined`` since the last look, bodies to spawn again, bodies that a
    node is to remove since another has them, (node, name), and the bodies ``lost`` since the last look, by node: a node
    that lost bodies and did not die was started anew."""

    died: list[str]
    joined: list[str]
    spawn: list[Respawning]
    remove: list[tuple[str, str]]
    lost: dict[str, list[str]]


class Ledger:
    """The bodies of a fleet. ``bodies``: by name. ``members``: nodes by name. ``respawned``: bodies spawned again."""

    def __init__(self, nodes: Sequence[str], config: LedgerConfig | None = None) -> None:
        self.config = config or LedgerConfig()
        self.members = {node: Member() for node in nodes}
        self.bodies: dict[str, Entry] = {}
        self.respawned = 0
        self._present: set[str] = set()
        self._looked = math.inf  # when it was last looked after the nodes [s]

    @property
    def living(self) -> list[str]:
        """Nodes that live."""
        return [node for node, member in self.members.items() if member.alive]

    @property
    def starting(self) -> list[str]:
        """Nodes that are connected and were never heard: they still compile, or load."""
        return [node for node in self._present if self.members[node].heard == -math.inf]

    @property
    def waiting(self) -> list[str]:
        """Bodies that wait to be spawned again."""
        return [name for name, entry in self.bodies.items() if entry.lost is not None]

    def choose(self, name: str, x: float, y: float, request: Any = None) -> str:
        """Give a new body that starts at ``x``, ``y`` [m] to a node, and notes it; raises `InputError` where its name
        is taken or no node lives."""
        if name in self.bodies:
            node = self.bodies[name].node
            raise InputError("duplicate_id", f"there is a body {name!r} already, on {node}; choose another name")
        node = self._choose(x, y)
        self.bodies[name] = Entry(node, request, asked=math.inf)
        return node

    def spawned(self, name: str, time: float) -> None:
        """Note that a body was added to its node."""
        self.bodies[name].asked = time
        if self.bodies[name].lost is not None:
            self.bodies[name].lost = None
            self.respawned += 1

    def not_spawned(self, name: str) -> None:
        """Note that a body was not added; one that was lost waits for another try."""
        entry = self.bodies[name]
        entry.asked = -math.inf
        if entry.lost is None:
            del self.bodies[name]

    def node_of(self, name: str) -> str:
        """Return the node that simulates a body; raises `InputError` if there is none of that name."""
        if name not in self.bodies:
            raise InputError("unknown_body", f"there is no body {name!r} in the fleet")
        return self.bodies[name].node

    def removed(self, name: str) -> None:
        """Note that a body was taken out."""
        self.bodies.pop(name, None)

    def hear(self, node: str, time: float) -> None:
        """Note that a node was heard at ``time`` [s]."""
        member = self.members[node]
        member.returned |= time - member.heard > self.config.restart
        member.heard = time

    def see(self, nodes: Iterable[str]) -> None:
        """Note which nodes are connected, whether they were heard or not."""
        self._present = self.members.keys() & nodes

    def learn(self, node: str, states: StateTable) -> None:
        """Take the newest states of a node's bodies."""
        member = self.members[node]
        if member.returned and not member.before:
            member.before = member.last
        if member.states is None or states.names is not member.states.names:
            member.rows = {name: row for row, name in enumerate(states.names)}
        member.states = states

    def look(self, time: float) -> Duties:
        """What is to be done now, ``time`` [s]."""
        duties = Duties([], [], [], [], {})
        # While the front itself stood still nobody could be heard.
        pause, self._looked = max(time - self._looked - self.config.restart, 0.0), time
        for node, member in self.members.items():
            member.heard += pause
            alive = time - member.heard <= self.config.timeout
            if alive and not member.alive:
                duties.joined.append(node)
            elif member.alive and not alive:
                duties.died.append(node)
            member.alive = alive
        for node in duties.died:
            duties.lost[node] = self._lose(node)
        for node in self.living:
            self._compare(node, time, duties)
        duties.spawn.extend(self._respawnings())
        return duties

    def _lose(self, node: str) -> list[str]:
        """Has the bodies of a dead node wait to be spawned again; returns their names."""
        last = self.members[node].last
        lost = []
        for name, entry in self.bodies.items():
            if entry.node == node and entry.lost is None and entry.asked != math.inf:
                entry.lost, entry.seen, entry.asked = last.get(name, Last(None)), False, -math.inf
                lost.append(name)
        for name in [name for name, of in self.bodies.items() if of.lost == Last(None) and of.request is None]:
            del self.bodies[name]
        return [name for name in lost if name in self.bodies]

    def _compare(self, node: str, time: float, duties: Duties) -> None:
        """Compare the bodies that a node has with those that it should have."""
        member = self.members[node]
        for name in member.rows:
            entry = self.bodies.setdefault(name, Entry(node))
            on_its_way = entry.asked == math.inf
            if entry.node != node and (entry.lost is None or on_its_way):
                duties.remove.append((node, name))
            elif not on_its_way:
                entry.node, entry.lost, entry.seen = node, None, True  # or come back before another took its place
        for name, entry in list(self.bodies.items()):
            if entry.node != node or name in member.rows or entry.lost is not None or entry.asked == math.inf:
                continue
            if not entry.seen and time - entry.asked <= self.config.settled:
                continue
            if name in member.before:
                entry.lost, entry.seen, entry.asked = member.before[name], False, -math.inf
                duties.lost.setdefault(node, []).append(name)
            else:
                del self.bodies[name]  # it was removed, or has left everything
        member.returned, member.before = False, {}

    def _respawnings(self) -> list[Respawning]:
        found = []
        for name in self.waiting:
            entry = self.bodies[name]
            if entry.asked == math.inf or entry.lost is None:
                continue
            states, row = entry.lost
            if not self.members[entry.node].alive:
                if self.config.respawn == "same" or not self.living:
                    continue
                x, y = (0.0, 0.0) if states is None else states.numbers[row, :2].tolist()
                entry.node = self._choose(x, y)
            entry.asked = math.inf
            found.append(Respawning(name, entry.node, entry.request, entry.lost))
        return found

    def _choose(self, x: float, y: float) -> str:
        living = self.living
        if not living and self.starting:
            names = ", ".join(sorted(self.starting))
            raise InputError("no_node", f"{names} are starting; ask again when the diagnostics say that they are there")
        if not living:
            raise InputError("no_node", f"none of {', '.join(self.members)} is heard; start one")
        if self.config.spread == "tiles" and math.isfinite(x) and math.isfinite(y):
            column, row = math.floor(x / self.config.tile_size), math.floor(y / self.config.tile_size)
            side = math.ceil(math.sqrt(len(living)))
            return living[(column % side + side * (row % side)) % len(living)]
        counts = Counter(entry.node for entry in self.bodies.values())
        return min(living, key=lambda node: counts[node])
