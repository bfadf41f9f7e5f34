"""Two nodes on one terrain: they hear of each other's bodies, which outlive a node, and who does not fit is refused.

What bodies of two nodes do to each other: tests/world/test_guests.py; from recorded states: tests/tools/replay."""

from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from smartmesh_msgs.msg import BodySpecification, Heightmap, Timing, TrackedBody, TrackedBodyArray
from smartmesh_msgs.srv import RemoveBody, SpawnBodies, SpawnBody
from visualization_msgs.msg import Marker, MarkerArray

from smartmesh_ros.errors import InputError
from smartmesh_ros.node.fleet import layout
from smartmesh_ros.node.fleet.front import Front
from smartmesh_ros.node.fleet.ledger import LedgerConfig
from smartmesh_ros.tools import fleet as fleet_command
from smartmesh_ros.tools.testing import Probe, Process, heightmap_message, pose_message
from tests.node.shared import BALL, ROOT, UDP_ONLY, Logged, fed, made_with, stamped

NODES = layout.node_names(2)
# After which silence the front takes a node for dead [s]: longer than a busy machine lets one wait.
FRONT_TIMEOUT = 5.0
PHYSICS = {"physics.rate": 120.0, "physics.restitution": 0.97, "physics.friction": 0.0, "bodies.timeout": 2.0}


class Fleet:
    """A probe of a fleet: what its nodes say, by their index. ``commands``: of its processes, by name."""

    def __init__(self, probe: Probe, commands: dict[str, list[str]]) -> None:
        self.probe, self._commands = probe, commands
        self.states = [probe.listen(f"{name}/body_states", TrackedBodyArray) for name in NODES]
        self.maps = probe.node.create_publisher(Heightmap, "/fleet/heightmap", 10)

    def start(self, name: str) -> Process:
        """Start a process."""
        program, *arguments = self._commands[name]
        return Process(Path(program).name, arguments=arguments, environment=UDP_ONLY)

    def show_ground(self) -> None:
        """Publishes flat ground until the nodes have it, which names its frame."""

        def known() -> bool:
            self.maps.publish(heightmap_message(np.zeros((41, 161)), resolution=0.25, origin=(-20.0, -5.0, 0.0)))
            self.probe.spin(0.1)
            return all(states and states[-1].header.frame_id for states in self.states)

        self.probe.wait_for(known)

    def told(self, name: str) -> dict[str, str]:
        """Values of the newest diagnostics of a name, and their ``message``; empty before the first."""
        newest = [status for message in self.probe.received["/diagnostics"][-9:] for status in message.status]
        for status in reversed(newest):
            if status.name == name:
                return {pair.key: pair.value for pair in status.values} | {"message": status.message}
        return {}

    def bodies(self, node: int) -> set[str]:
        """Names of the bodies that a node simulates."""
        return {body.id for body in self.states[node][-1].bodies} if self.states[node] else set()

    def spawn(self, name: str, x: float) -> Any:
        """Has the front spawn a ball."""
        return self.probe.call(
            "/fleet/spawn_body", SpawnBody, id=name, shape=BALL, mass=1.0, pose=pose_message((x, 0.0, 0.2))
        )


def test_bodies_of_two_nodes_outlive_a_node(probe: Probe, tmp_path: Path) -> None:
    fleet = Fleet(probe, layout.commands(tmp_path, len(NODES), {"timeout": FRONT_TIMEOUT}, PHYSICS))
    patches, timing = probe.listen("/fleet/patches", MarkerArray), probe.listen("/fleet/timing", Timing)
    with ExitStack() as stack:
        *_, dying, front = (stack.enter_context(fleet.start(name)) for name in ("node_0", "node_1", "front"))
        fleet.show_ground()
        probe.wait_for(lambda: fleet.told("fleet: nodes").get("message") == "2 nodes")
        assert fleet.spawn("still", 0.0).success
        # The front gives the second one to the other node, where each meets the other as a guest.
        assert fleet.spawn("near", -0.5).success
        probe.wait_for(lambda: fleet.bodies(0) == {"still"} and fleet.bodies(1) == {"near"})
        tasks = [f"{name.strip('/')}: bodies" for name in NODES]
        probe.wait_for(lambda: [fleet.told(task).get("guests") for task in tasks] == ["1", "1"])
        assert not fleet.spawn("still", 5.0).success
        places = {f"more_{k}": pose_message((-8.0, k, 0.2)) for k in (-2, 2)}
        many = [BodySpecification(id=name, shape=BALL, mass=1.0, pose=pose) for name, pose in places.items()]
        assert probe.call("/fleet/spawn_bodies", SpawnBodies, bodies=many).success
        assert probe.call("/fleet/remove_body", RemoveBody, id="still").success
        probe.wait_for(lambda: len(fleet.bodies(0)) == 1 and len(fleet.bodies(1)) == 2)
        probe.wait_for(lambda: len({marker.ns for message in patches[-9:] for marker in message.markers}) == 2)
        probe.wait_for(lambda: timing)
        assert {stage.stage.partition("/")[0] for message in timing for stage in message.stages} <= {"node_0", "node_1"}

        last = {body.id: body.pose.position for body in fleet.states[1][-1].bodies}
        seen = len(patches)
        dying.process.kill()
        probe.wait_for(lambda: fleet.bodies(0) >= last.keys())
        now = {body.id: body.pose.position for body in fleet.states[0][-1].bodies}
        for name, position in last.items():
            assert abs(now[name].x - position.x) < 1.5, "it goes on from its last known state"
            assert abs(now[name].y - position.y) < 0.05
        probe.wait_for(lambda: f"spawned again on {NODES[0]}: " in front.output)
        for words in (f"{NODES[1]} died", "spawned again on"):
            line = next(line for line in front.output.splitlines() if words in line)
            assert f"{len(last)} bodies" in line
            assert ", ".join(sorted(line.rpartition("(")[2].rstrip(")").split(", "))) == ", ".join(sorted(last))

        def cleared() -> list[str]:
            """Namespaces that a message clears and shows nothing of, since the node died."""
            later = (message.markers for message in patches[seen:])
            return [each[0].ns for each in later if [marker.action for marker in each] == [Marker.DELETEALL]]

        probe.wait_for(cleared)
        assert cleared() == [layout.marker_namespace(NODES[1])]

        # It comes back, and is given what comes next.
        stack.enter_context(fleet.start("node_1"))
        fleet.states[1].clear()
        fleet.show_ground()
        probe.wait_for(lambda: front.output.count(f"{NODES[1]} joined the fleet") == 2)  # diagnostics may be old
        assert fleet.spawn("late", 5.0).success
        probe.wait_for(lambda: fleet.bodies(1) == {"late"})


def test_nodes_let_go_of_the_bodies_of_a_dead_peer_before_the_front_spawns_them_again() -> None:
    """Until then a node refuses them, because another one has bodies of these names."""
    preset = yaml.safe_load((ROOT / "config" / f"{layout.PRESET}.yaml").read_text())["/**"]["ros__parameters"]
    assert preset["bodies.timeout"] < LedgerConfig().timeout


def test_peers_that_simulate_otherwise_are_refused_by_reason(logged: Logged) -> None:
    with fed({**PHYSICS, "bodies.peers": ["/other"], "frame_id": "map"}) as node:
        for rate, gravity, frame, bodies, words in (
            (60.0, -9.81, "map", [], "/other steps at 60 Hz, this node at 120 Hz; set one rate"),
            (120.0, -1.62, "map", [], "has gravity (0, 0, -1.62) m/s^2, this node (0, 0, -9.81) m/s^2"),
            (120.0, -9.81, "odom", [], "frame 'odom' is not the terrain's frame 'map'"),
            (120.0, -9.81, "map", [TrackedBody(id="b")], "body 'b' has a shape of no known kind"),
        ):
            said = TrackedBodyArray(rate=rate, gravity=np.array([0.0, 0.0, gravity], np.float32), bodies=bodies)
            node.give("/other/body_states", stamped(node, said, frame))
            heard = logged()
            assert "/other/body_states refused" in heard and words in heard


def test_the_age_of_the_stamps_of_peers_is_told_behind_that_of_the_nodes_own_inputs() -> None:
    with fed({**PHYSICS, "bodies.peers": ["/other"], "frame_id": "map"}) as node:
        states = TrackedBodyArray(rate=120.0, gravity=np.array([0.0, 0.0, -9.81], np.float32))
        node.give("/other/body_states", stamped(node, states, "map"))
        node.give("tracked_bodies", stamped(node, TrackedBodyArray()))
        ages = [key for key in node.node._outputs._diagnostics._ends()[2] if key.startswith("age of stamps")]
        assert ages == [f"age of stamps on arrival, {source} [s]" for source in ("tracked_bodies", "/other")]


def test_a_fleet_of_no_nodes_is_refused_and_not_waited_for(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as end:
        fleet_command.main(["--nodes", "0"])
    assert end.value.code == 2 and "'0' is no whole number from 1" in capsys.readouterr().err


def test_a_front_of_no_nodes_is_refused_with_what_would_be_right() -> None:
    right = r"nodes is \[\]; .* such as /fleet/node_0/terrain_collider"
    with pytest.raises(InputError, match=right), made_with(Front, {"nodes": []}):
        pass
