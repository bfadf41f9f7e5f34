"""Bodies of a fleet are on one node each, none is lost with a node, and every call to a node ends, with a reason for
each body that was not spawned or removed."""

import math
from collections import Counter
from collections.abc import Callable
from contextlib import ExitStack
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.task import Future
from smartmesh_msgs.msg import BodyFailure, BodySpecification, TrackedBodyArray
from smartmesh_msgs.srv import RemoveBodies, SpawnBodies

from smartmesh_ros.errors import InputError
from smartmesh_ros.ground.shapes import ShapeKind
from smartmesh_ros.node.fleet.calls import Calls, specification_of
from smartmesh_ros.node.fleet.front import Front
from smartmesh_ros.node.fleet.ledger import Duties, FleetBody, Ledger, LedgerConfig
from smartmesh_ros.node.session import SERVICES
from smartmesh_ros.world.state_table import StateTable
from tests.node.shared import made_with, wait_until

NODES = ["a", "b", "c"]
LONG = 100_000 * "x"
EVENTS = ["die", "cut", "come", "restart", "spawn", "wait"]


class World:
    """Nodes as the ledger sees them: which live, and which bodies they have."""

    def __init__(self, config: LedgerConfig | None = None) -> None:
        self.ledger = Ledger(NODES, config)
        self.bodies: dict[str, list[str]] = {node: [] for node in NODES}
        self.alive = set(NODES)
        self.time = 0.0
        self.lost: dict[str, list[str]] = {}
        self.go_on(0.5)

    def go_on(self, seconds: float) -> None:
        """Has the nodes talk for a while, and does what the ledger asks for."""
        end = self.time + seconds
        while self.time < end:
            self.time += 0.25
            for node in sorted(self.alive):
                self.ledger.hear(node, self.time)
                self.ledger.update_states(node, table(self.bodies[node]))
            self.do(self.ledger.check(self.time))

    def do(self, duties: Duties) -> None:
        self.lost |= duties.lost
        for again in duties.spawn:
            if again.node in self.alive and again.name not in self.bodies[again.node]:
                self.bodies[again.node].append(again.name)
                self.ledger.answered(again.name, self.time, success=True)
            else:
                self.ledger.answered(again.name, self.time, success=False)
        for node, name in duties.remove:
            if node in self.alive:
                self.bodies[node].remove(name)

    def spawn(self, name: str, x: float = 0.0) -> str:
        node = self.ledger.choose(name, x, 0.0, object())
        self.bodies[node].append(name)
        self.ledger.answered(name, self.time, success=True)
        return node

    def die(self, node: str) -> None:
        self.alive.discard(node)
        self.bodies[node] = []

    def all_living(self) -> Counter[str]:
        return Counter(name for node in self.alive for name in self.bodies[node])


def table(names: list[str]) -> StateTable:
    n = len(names)
    balls, sizes = np.full(n, 2, np.uint8), np.ones((n, 3))
    return StateTable([*names], np.zeros((n, 13)), np.ones(n), balls, sizes, np.zeros((n, 3)), np.ones(n))


def test_a_box_whose_middle_is_not_its_centre_of_mass_is_spawned_again_where_it_was() -> None:
    states = table(["robot"])
    states.numbers[0, :7] = (1.0, 2.0, 3.0, 0.0, 0.0, 0.5**0.5, 0.5**0.5)  # turned about z: x goes to y
    states.kinds[0] = ShapeKind.BOX
    states.centres[0] = (0.5, 0.0, 0.25)
    position = specification_of(FleetBody("robot", "/a", lost=True, last=(states, 0))).pose.position
    assert (position.x, position.y, position.z) == pytest.approx((1.0, 2.5, 3.25))


def test_bodies_are_spread_evenly_or_by_tiles_and_names_are_taken_once() -> None:
    world = World()
    assert set(Counter(world.spawn(f"body_{k}") for k in range(12)).values()) == {4}
    with pytest.raises(InputError, match="there is a body"):
        world.ledger.choose("body_3", 0.0, 0.0)
    world = World(LedgerConfig(spread="tiles", tile_size=10.0))
    nodes = [world.spawn(f"body_{k}", x) for k, x in enumerate((1.0, 9.0, 11.0, 19.0, math.nan))]
    assert nodes[0] == nodes[1] != nodes[2] == nodes[3]
    world = World(LedgerConfig(spread="tiles", tile_size=0.1))
    assert world.spawn("far", 1e308) in NODES, "its tile has no number"


def test_nodes_are_not_taken_for_dead_because_the_front_stood_still() -> None:
    world = World()
    world.spawn("body")
    world.go_on(1.0)
    assert world.ledger.check(world.time + 30.0) == Duties([], [], [], [], {})
    world.time += 30.0
    world.go_on(1.0)
    assert world.ledger.respawned == 0
    assert world.all_living() == Counter({"body": 1})


def test_bodies_that_nodes_add_and_remove_by_themselves_are_known() -> None:
    world = World()
    world.bodies["a"].append("own")
    world.go_on(0.5)
    assert world.ledger.node_of("own") == "a"
    world.bodies["a"].remove("own")
    world.go_on(0.5)
    assert world.ledger.bodies == {}
    world.die("a")
    world.go_on(3.0)
    assert world.ledger.living == ["b", "c"]


def test_nodes_that_are_connected_and_not_heard_yet_are_starting() -> None:
    ledger = Ledger(NODES)
    ledger.connected = {"a", "b", "/somebody/else"}
    assert sorted(ledger.starting) == ["a", "b"]
    with pytest.raises(InputError, match="a, b are starting"):
        ledger.choose("body", 0.0, 0.0)
    ledger.hear("a", 0.0)
    ledger.check(0.1)
    assert ledger.starting == ["b"]
    assert ledger.choose("body", 0.0, 0.0) == "a"
    ledger.check(10.0)
    assert ledger.starting == ["b"], "who was heard before is not heard any more"


@given(
    events=st.lists(st.tuples(st.sampled_from(EVENTS), st.sampled_from(NODES)), max_size=14),
    respawn=st.sampled_from(["elsewhere", "same"]),
)  # fmt: skip
@example([("spawn", "a")] * 6 + [("wait", "a"), ("die", "b"), ("wait", "a"), ("come", "b")], "same")
@example([("spawn", "a"), ("die", "a"), ("die", "b"), ("die", "c"), ("spawn", "a"), ("come", "c")], "elsewhere")
def test_whatever_dies_and_comes_back_every_body_is_there_once_in_the_end(
    events: list[tuple[str, str]], respawn: str
) -> None:
    """Those of a node that is waited for, on that node. Nothing is spawned while no node lives. What a node loses that
    starts anew before it is missed is told, for the log."""
    world = World(LedgerConfig(respawn=respawn))  # type: ignore[arg-type]
    first: dict[str, str] = {}
    for event, node in events:
        if event == "die":
            world.die(node)
        elif event == "cut":
            world.alive.discard(node)
        elif event == "come":
            world.alive.add(node)
        elif event == "restart" and node in world.ledger.living and node in world.alive:
            had = {*world.bodies[node]}
            world.die(node)
            world.go_on(0.75)
            world.alive.add(node)
            world.go_on(1.0)
            assert had <= {*world.lost.get(node, [])}
        elif event == "spawn" and world.ledger.living and set(world.ledger.living) <= world.alive:
            name = f"body_{len(first)}"
            first[name] = world.spawn(name)
        elif event == "spawn" and not world.ledger.living:
            with pytest.raises(InputError, match="none of a, b, c is heard"):
                world.ledger.choose("other", 0.0, 0.0)
        world.go_on(0.5 if event == "wait" else 2.75)
    world.alive.update(NODES)
    world.go_on(8.0)
    assert world.all_living() == Counter(dict.fromkeys(first, 1))
    if respawn == "same":
        assert all(name in world.bodies[node] for name, node in first.items())


def front_of(*, ready: bool = True) -> Any:
    """A node whose clients answer what the test says."""
    future = Future()
    client = SimpleNamespace(service_is_ready=lambda: ready, call_async=lambda _: future)
    return SimpleNamespace(
        future=future, create_client=lambda *_, **__: client, get_publishers_info_by_topic=lambda _: []
    )


def result_of(coroutine: Any) -> Any:
    with pytest.raises(StopIteration) as end:
        coroutine.send(None)
    return end.value.value


def test_a_node_that_dies_or_has_no_services_has_refused_all_bodies_of_the_call() -> None:
    front = front_of()
    calls = Calls(front, ["/a"], None)
    call = calls.remove("/a", ["one", "two"])
    call.send(None)
    for node in ("/b", "/a"):
        assert not front.future.done()
        calls.give_up([node])
    assert result_of(call) == dict.fromkeys(("one", "two"), "/a died before it answered")
    assert result_of(Calls(front_of(ready=False), ["/a"], None).remove("/a", ["one"])) == {
        "one": "/a serves no calls yet"
    }


class Silent(Node):
    """A node of a fleet that shows its states without bodies, and never answers a call."""

    def __init__(self, **options: Any) -> None:
        super().__init__("a", **options)
        self.states = self.create_publisher(TrackedBodyArray, "~/body_states", 10)
        self.create_service(RemoveBodies, "~/remove_bodies", lambda _, response: response, qos_profile=SERVICES)


@pytest.mark.parametrize(
    ("service", "asked", "words"),
    [
        ("/remove_bodies", RemoveBodies.Request(ids=[LONG]), "there is no body"),
        ("/spawn_bodies", SpawnBodies.Request(bodies=[BodySpecification(id=LONG)] * 2), "is named 2 times"),
    ],
)
def test_the_front_quotes_no_long_name_whole(service: str, asked: Any, words: str) -> None:
    with made_with(Front, {"nodes": ["/a"]}) as front:
        [served] = [found for found in front.services if found.srv_name.endswith(service)]
        answer = result_of(served.callback(asked, served.srv_type.Response()))
    [failure] = answer.failures
    assert words in failure.reason and words in answer.message
    assert len(failure.id) + len(failure.reason) + len(answer.message) < 4000


@pytest.mark.parametrize("killed", [False, True])
def test_a_node_that_restarts_before_it_counts_as_dead_has_refused_the_calls_of_before(killed: bool) -> None:
    """It answers none of them, also if it has no bodies that it could lose. DDS still lists one that was killed."""
    with made_with(Front, {"nodes": ["/a"], "timeout": 3600.0}) as front, ExitStack() as old, ExitStack() as new:
        executor = SingleThreadedExecutor(context=front.context)
        executor.add_node(front)
        peer = old.enter_context(made_with(Silent, {}))

        def turned(condition: Callable[[], object]) -> object:
            peer.states.publish(TrackedBodyArray())
            executor.spin_once(0.02)
            return condition()

        wait_until(lambda: turned(lambda: front.ledger.living))
        wait_until(lambda: turned(front._calls._clients["/a", RemoveBodies].service_is_ready))
        call = executor.create_task(front._calls.remove("/a", ["one"]))
        heard = front.ledger.members["/a"].heard
        wait_until(lambda: turned(lambda: front.ledger.members["/a"].heard > heard + 1.0))
        assert not call.done(), "it lives, and takes its time"
        if not killed:
            old.close()
        peer = new.enter_context(made_with(Silent, {}))
        wait_until(lambda: turned(call.done))
        assert call.result() == {"one": "/a died before it answered"} and front.ledger.living == ["/a"]
        executor.remove_node(front)


@pytest.mark.parametrize(
    ("response", "refused"),
    [
        (SpawnBodies.Response(success=True), {}),
        (SpawnBodies.Response(message="busy"), {"one": "busy", "two": "busy"}),
        (SpawnBodies.Response(failures=[BodyFailure(id="two", reason="no room")]), {"two": "no room"}),
        (RemoveBodies.Response(success=True), {}),
    ],
)
def test_refusals_are_told_by_body(response: Any, refused: dict[str, str]) -> None:
    front = front_of()
    front.future.set_result(response)
    bodies = [BodySpecification(id=name) for name in ("one", "two")]
    assert result_of(Calls(front, ["/a"], None).spawn("/a", bodies)) == refused
