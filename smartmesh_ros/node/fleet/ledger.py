"""The ledger of a fleet: the node of each body, the nodes that live, and the bodies to respawn when a node dies."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple

from smartmesh_ros.errors import InputError
from smartmesh_ros.world.state_table import StateTable


@dataclass(frozen=True, kw_only=True)
class LedgerConfig:
    """Rules for assigning bodies to nodes and for detecting dead nodes.

    ``spread``: a new body goes to the node with the fewest bodies, or to the node of its start tile, so that neighbours
    share a node. ``tile_size`` [m]: side of a tile. ``timeout`` [s]: silence after which a node counts as dead; must
    exceed any pause of a loaded machine. ``restart`` [s]: a node that lost bodies and was silent for longer than this
    has restarted; must be shorter than a start takes. ``respawn``: bodies of a dead node go to a living node, or wait
    for their own. ``spawn_grace`` [s]: time a node has to report a new body before the body counts as removed.
    """

    spread: Literal["fewest", "tiles"] = "fewest"
    tile_size: float = 20.0
    timeout: float = 2.0
    restart: float = 0.5
    respawn: Literal["elsewhere", "same"] = "elsewhere"
    spawn_grace: float = 2.0


# A state of a body: a table, and the row in it.
LastState = tuple[StateTable, int]


@dataclass(eq=False)
class Member:
    """A node. ``heard``: time of its last message [s]. ``alive``: False after the timeout. ``last``: last known states
    of its bodies by name; ``before_silence``: those from before a silence long enough for a restart, until the check
    after it."""

    heard: float = -math.inf
    alive: bool = False
    last: dict[str, LastState] = field(default_factory=dict)
    before_silence: dict[str, LastState] = field(default_factory=dict)


@dataclass(eq=False)
class FleetBody:
    """A body. ``node``: its node. ``request``: the request that spawned it; None if the front did not. ``spawn_time``
    [s]: infinite while a spawn call is open, minus infinity once its node has reported it. ``lost``: True while it
    waits to be respawned; ``last``: its last known state then, None if it was lost before its node reported it."""

    name: str
    node: str
    request: Any = None
    spawn_time: float = -math.inf
    lost: bool = False
    last: LastState | None = None

    @property
    def spawning(self) -> bool:
        """True while a spawn call is open."""
        return self.spawn_time == math.inf


class Duties(NamedTuple):
    """Result of a check. ``died``, ``joined``: nodes since the last check. ``spawn``: lost bodies to respawn, each on
    its node. ``remove``: (node, name) of bodies that another node has as well. ``lost``: bodies lost since the last
    check, by node; a node that lost bodies without dying has restarted."""

    died: list[str]
    joined: list[str]
    spawn: list[FleetBody]
    remove: list[tuple[str, str]]
    lost: dict[str, list[str]]


class Ledger:
    """The bodies and nodes of a fleet. ``bodies``, ``members``: bodies and nodes by name. ``connected``: names of nodes
    that are connected, of this fleet or not. ``respawned``: number of bodies respawned so far."""

    def __init__(self, nodes: Sequence[str], config: LedgerConfig | None = None) -> None:
        self.config = config or LedgerConfig()
        self.members = {node: Member() for node in nodes}
        self.bodies: dict[str, FleetBody] = {}
        self.respawned = 0
        self.connected: set[str] = set()
        self._checked = math.inf  # time of the last check [s]

    @property
    def living(self) -> list[str]:
        return [node for node, member in self.members.items() if member.alive]

    @property
    def starting(self) -> list[str]:
        """Names of the nodes that are connected but have sent nothing yet, because they still load."""
        return [node for node, one in self.members.items() if node in self.connected and one.heard == -math.inf]

    @property
    def waiting(self) -> list[str]:
        """Names of the bodies that wait to be respawned."""
        return [name for name, entry in self.bodies.items() if entry.lost]

    def choose(self, name: str, x: float, y: float, request: Any = None) -> str:
        """Assign a new body that starts at ``x``, ``y`` [m] to a node; return the node. Raises `InputError` if the
        name is taken or no node lives."""
        if name in self.bodies:
            node = self.bodies[name].node
            raise InputError("duplicate_id", f"there is a body {name!r} already, on {node}; choose another name")
        node = self._choose(x, y)
        self.bodies[name] = FleetBody(name, node, request, spawn_time=math.inf)
        return node

    def answered(self, name: str, time: float, *, success: bool) -> None:
        """Record the answer to a spawn call at ``time`` [s]. After a refusal a new body is forgotten, and a lost one
        waits for the next attempt."""
        entry = self.bodies[name]
        entry.spawn_time = time if success else -math.inf
        if success:
            self.respawned += entry.lost
            entry.lost = False
        elif not entry.lost:
            del self.bodies[name]

    def node_of(self, name: str) -> str:
        """Return the node that simulates a body. Raises `InputError` if the fleet has no body of that name."""
        if name not in self.bodies:
            raise InputError("unknown_body", f"there is no body {name!r} in the fleet")
        return self.bodies[name].node

    def hear(self, node: str, time: float) -> None:
        """Record a message from a node at ``time`` [s]."""
        member = self.members[node]
        if time - member.heard > self.config.restart:
            member.before_silence = member.last
        member.heard = time

    def update_states(self, node: str, states: StateTable) -> None:
        self.members[node].last = {name: (states, row) for row, name in enumerate(states.names)}

    def check(self, time: float) -> Duties:
        """Update which nodes live at ``time`` [s]; return the duties that follow."""
        duties = Duties([], [], [], [], {})
        # A pause of the front itself does not count as silence of the nodes.
        pause, self._checked = max(time - self._checked - self.config.restart, 0.0), time
        for node, member in self.members.items():
            member.heard += pause
            alive = time - member.heard <= self.config.timeout
            if alive != member.alive:
                (duties.joined if alive else duties.died).append(node)
            member.alive = alive
        for entry in list(self.bodies.values()):
            self._look_for(entry, time, duties)
        for node in self.living:
            self._compare(node, duties)
        duties.spawn.extend(entry for entry in self.bodies.values() if self._can_respawn(entry))
        return duties

    def _look_for(self, entry: FleetBody, time: float, duties: Duties) -> None:
        """Mark a body as lost, to be respawned, if its node died or restarted. Forget it if its node removed it, or
        died and neither the state nor the request is known."""
        member, died = self.members[entry.node], entry.node in duties.died
        if entry.lost or entry.spawning:
            return
        if not died and (not member.alive or entry.name in member.last):
            return
        if not died and time - entry.spawn_time <= self.config.spawn_grace:
            return
        known = (member.last if died else member.before_silence).get(entry.name)
        if known is None and not (died and entry.request is not None):
            del self.bodies[entry.name]
            return
        entry.lost, entry.last, entry.spawn_time = True, known, -math.inf
        duties.lost.setdefault(entry.node, []).append(entry.name)

    def _compare(self, node: str, duties: Duties) -> None:
        """Enter the bodies that a node reports, unless they are another node's."""
        member = self.members[node]
        for name in member.last:
            entry = self.bodies.setdefault(name, FleetBody(name, node))
            if entry.node != node and (not entry.lost or entry.spawning):
                duties.remove.append((node, name))
            elif not entry.spawning:  # also a lost body that came back
                entry.node, entry.lost, entry.spawn_time = node, False, -math.inf
        member.before_silence = {}

    def _can_respawn(self, entry: FleetBody) -> bool:
        """Return True if a body is lost and a node can respawn it, which it is then assigned to."""
        if not entry.lost or entry.spawning:
            return False
        if not self.members[entry.node].alive:
            if self.config.respawn == "same" or not self.living:
                return False
            x, y = entry.last[0].numbers[entry.last[1], :2].tolist() if entry.last else (0.0, 0.0)
            entry.node = self._choose(x, y)
        entry.spawn_time = math.inf
        return True

    def _choose(self, x: float, y: float) -> str:
        living, tile = self.living, self.config.tile_size
        if not living and self.starting:
            names = ", ".join(sorted(self.starting))
            raise InputError("no_node", f"{names} are starting; try again when the diagnostics list their bodies")
        if not living:
            raise InputError("no_node", f"none of {', '.join(self.members)} is heard; start one")
        column, row = x / tile, y / tile
        if self.config.spread == "tiles" and math.isfinite(column) and math.isfinite(row):
            side = math.ceil(math.sqrt(len(living)))
            return living[(math.floor(column) % side + side * (math.floor(row) % side)) % len(living)]
        counts = Counter(entry.node for entry in self.bodies.values())
        return min(living, key=lambda node: counts[node])
