"""The ledger of a fleet: the node of each body, the nodes that live, and the bodies to respawn when a node dies."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple

from smartmesh_ros.errors import InputError
from smartmesh_ros.world.state_table import StateTable

Spread = Literal["fewest", "tiles"]
Respawn = Literal["elsewhere", "same"]


@dataclass(frozen=True, kw_only=True)
class LedgerConfig:
    """Rules for assigning bodies to nodes and for detecting dead nodes.

    ``spread``: a new body goes to the node with the fewest bodies, or to the node of its start tile, so that neighbours
    share a node. ``tile_size`` [m]: side of a tile. ``timeout`` [s]: silence after which a node counts as dead; must
    exceed any pause of a loaded machine. ``restart`` [s]: a node that lost bodies and was silent for longer than this
    has restarted; must be shorter than a start takes. ``respawn``: bodies of a dead node go to a living node, or wait
    for their own. ``spawn_grace`` [s]: time a node has to report a new body before the body counts as removed.
    """

    spread: Spread = "fewest"
    tile_size: float = 20.0
    timeout: float = 2.0
    restart: float = 0.5
    respawn: Respawn = "elsewhere"
    spawn_grace: float = 2.0

    def __post_init__(self) -> None:
        for name in ("tile_size", "timeout", "restart", "spawn_grace"):
            if not (math.isfinite(value := getattr(self, name)) and value > 0.0):
                raise InputError("parameter", f"{name} is {value}; it must be greater than zero")


class LastState(NamedTuple):
    """The last known state of a body: a ``row`` of ``states``. None = the body was lost before its node reported it."""

    states: StateTable | None
    row: int = 0


@dataclass(eq=False)
class Member:
    """A node. ``heard``: time of its last message [s]. ``alive``: False after the timeout. ``returned``: True after a
    silence that is long enough for a restart. ``states``: last states of its bodies, with ``rows`` by body name.
    ``states_before_silence``: last states from before that silence, by body name."""

    heard: float = -math.inf
    alive: bool = False
    returned: bool = False
    states: StateTable | None = None
    rows: dict[str, int] = field(default_factory=dict)
    states_before_silence: dict[str, LastState] = field(default_factory=dict)

    @property
    def last(self) -> dict[str, LastState]:
        """The last known states by body name."""
        assert self.states is not None or not self.rows
        return {name: LastState(self.states, row) for name, row in self.rows.items()}


@dataclass(eq=False)
class Entry:
    """A body. ``node``: its node. ``request``: the request that spawned it; None if the front did not. ``seen``: True
    once its node has reported it. ``spawn_time`` [s]: infinite while a spawn call is open. ``lost``: its last known
    state while it waits to be respawned, else None."""

    node: str
    request: Any = None
    seen: bool = False
    spawn_time: float = -math.inf
    lost: LastState | None = None


class Respawning(NamedTuple):
    """A body that ``node`` must respawn in its ``last`` state. ``request``: its first spawn request; None = unknown."""

    name: str
    node: str
    request: Any
    last: LastState


class Duties(NamedTuple):
    """Result of a check. ``died``, ``joined``: nodes since the last check. ``spawn``: bodies to respawn. ``remove``:
    (node, name) of bodies that another node has as well. ``lost``: bodies lost since the last check, by node; a node
    that lost bodies without dying has restarted."""

    died: list[str]
    joined: list[str]
    spawn: list[Respawning]
    remove: list[tuple[str, str]]
    lost: dict[str, list[str]]


class Ledger:
    """The bodies and nodes of a fleet. ``bodies``, ``members``: bodies and nodes by name. ``respawned``: number of
    bodies respawned so far."""

    def __init__(self, nodes: Sequence[str], config: LedgerConfig | None = None) -> None:
        self.config = config or LedgerConfig()
        self.members = {node: Member() for node in nodes}
        self.bodies: dict[str, Entry] = {}
        self.respawned = 0
        self._present: set[str] = set()
        self._checked = math.inf  # time of the last check [s]

    @property
    def living(self) -> list[str]:
        """Names of the nodes that live."""
        return [node for node, member in self.members.items() if member.alive]

    @property
    def starting(self) -> list[str]:
        """Names of the nodes that are connected but have sent nothing yet, because they still load."""
        return [node for node in self._present if self.members[node].heard == -math.inf]

    @property
    def waiting(self) -> list[str]:
        """Names of the bodies that wait to be respawned."""
        return [name for name, entry in self.bodies.items() if entry.lost is not None]

    def choose(self, name: str, x: float, y: float, request: Any = None) -> str:
        """Assign a new body that starts at ``x``, ``y`` [m] to a node; return the node. Raises `InputError` if the
        name is taken or no node lives."""
        if name in self.bodies:
            node = self.bodies[name].node
            raise InputError("duplicate_id", f"there is a body {name!r} already, on {node}; choose another name")
        node = self._choose(x, y)
        self.bodies[name] = Entry(node, request, spawn_time=math.inf)
        return node

    def spawned(self, name: str, time: float) -> None:
        """Record that a node spawned its body at ``time`` [s]."""
        self.bodies[name].spawn_time = time
        if self.bodies[name].lost is not None:
            self.bodies[name].lost = None
            self.respawned += 1

    def not_spawned(self, name: str) -> None:
        """Record that a spawn failed: forget a new body; a lost body waits for the next attempt."""
        entry = self.bodies[name]
        entry.spawn_time = -math.inf
        if entry.lost is None:
            del self.bodies[name]

    def node_of(self, name: str) -> str:
        """Return the node that simulates a body. Raises `InputError` if the fleet has no body of that name."""
        if name not in self.bodies:
            raise InputError("unknown_body", f"there is no body {name!r} in the fleet")
        return self.bodies[name].node

    def removed(self, name: str) -> None:
        """Record that a body was removed."""
        self.bodies.pop(name, None)

    def hear(self, node: str, time: float) -> None:
        """Record a message from a node at ``time`` [s]."""
        member = self.members[node]
        member.returned |= time - member.heard > self.config.restart
        member.heard = time

    def set_connected(self, nodes: Iterable[str]) -> None:
        """Record which nodes are connected."""
        self._present = self.members.keys() & nodes

    def update_states(self, node: str, states: StateTable) -> None:
        """Record the newest states of a node's bodies."""
        member = self.members[node]
        if member.returned and not member.states_before_silence:
            member.states_before_silence = member.last
        if member.states is None or states.names != member.states.names:
            member.rows = {name: row for row, name in enumerate(states.names)}
        member.states = states

    def check(self, time: float) -> Duties:
        """Update which nodes live at ``time`` [s]; return the duties that follow."""
        duties = Duties([], [], [], [], {})
        # A pause of the front itself does not count as silence of the nodes.
        pause, self._checked = max(time - self._checked - self.config.restart, 0.0), time
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
        """Mark the bodies of a dead node as lost, to be respawned; return their names."""
        last = self.members[node].last
        lost = []
        for name, entry in self.bodies.items():
            if entry.node == node and entry.lost is None and entry.spawn_time != math.inf:
                entry.lost, entry.seen, entry.spawn_time = last.get(name, LastState(None)), False, -math.inf
                lost.append(name)
        for name in [name for name, of in self.bodies.items() if of.lost == LastState(None) and of.request is None]:
            del self.bodies[name]
        return [name for name in lost if name in self.bodies]

    def _compare(self, node: str, time: float, duties: Duties) -> None:
        """Compare the bodies that a node reports with its bodies in the ledger; add the differences to ``duties``."""
        member = self.members[node]
        for name in member.rows:
            entry = self.bodies.setdefault(name, Entry(node))
            spawning = entry.spawn_time == math.inf
            if entry.node != node and (entry.lost is None or spawning):
                duties.remove.append((node, name))
            elif not spawning:
                entry.node, entry.lost, entry.seen = (
                    node,
                    None,
                    True,
                )  # also a lost body that came back
        for name, entry in list(self.bodies.items()):
            if entry.node != node or name in member.rows or entry.lost is not None or entry.spawn_time == math.inf:
                continue
            if not entry.seen and time - entry.spawn_time <= self.config.spawn_grace:
                continue
            if name in member.states_before_silence:
                entry.lost, entry.seen, entry.spawn_time = member.states_before_silence[name], False, -math.inf
                duties.lost.setdefault(node, []).append(name)
            else:
                del self.bodies[name]  # removed by another service, or off the terrain
        member.returned, member.states_before_silence = False, {}

    def _respawnings(self) -> list[Respawning]:
        found = []
        for name in self.waiting:
            entry = self.bodies[name]
            if entry.spawn_time == math.inf or entry.lost is None:
                continue
            states, row = entry.lost
            if not self.members[entry.node].alive:
                if self.config.respawn == "same" or not self.living:
                    continue
                x, y = (0.0, 0.0) if states is None else states.numbers[row, :2].tolist()
                entry.node = self._choose(x, y)
            entry.spawn_time = math.inf
            found.append(Respawning(name, entry.node, entry.request, entry.lost))
        return found

    def _choose(self, x: float, y: float) -> str:
        living = self.living
        if not living and self.starting:
            names = ", ".join(sorted(self.starting))
            raise InputError("no_node", f"{names} are starting; try again when the diagnostics list their bodies")
        if not living:
            raise InputError("no_node", f"none of {', '.join(self.members)} is heard; start one")
        if self.config.spread == "tiles" and math.isfinite(x) and math.isfinite(y):
            column, row = math.floor(x / self.config.tile_size), math.floor(y / self.config.tile_size)
            side = math.ceil(math.sqrt(len(living)))
            return living[(column % side + side * (row % side)) % len(living)]
        counts = Counter(entry.node for entry in self.bodies.values())
        return min(living, key=lambda node: counts[node])
