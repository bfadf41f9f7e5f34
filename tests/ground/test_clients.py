"""Grounds in clients whose server has a thread or a process of its own, and in clients that fail and end."""

import math
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pybullet as pb
import pytest
from pybullet_utils.bullet_client import BulletClient

from smartmesh_ros import Box, Ground, InputError, Sphere
from smartmesh_ros.core import CORE
from smartmesh_ros.ground import layout_probe
from smartmesh_ros.terrain.motion import MotionConfig
from tests.bodies import ground_of, height, put
from tests.ground.scene import Client, by_steps, in_real_time, run
from tests.grounds import level
from tests.memory import allocated

DT = 1.0 / 240.0
BALL = Sphere(0.1)
KEY = 20000 + os.getpid() % 40000  # of the shared memory, which all processes of this machine see


@pytest.fixture
def threaded() -> Iterator[Any]:
    """A client whose server has a thread of its own."""
    client = Client(pb.SHARED_MEMORY_SERVER, KEY)
    client.setGravity(0.0, 0.0, -9.81)
    yield client
    client.disconnect()


def test_contacts_of_a_server_in_a_thread_of_its_own_are_the_same(threaded: Any, client: Any) -> None:
    """To the last digit, before and after a reset."""
    wanted = run(client)
    assert run(threaded) == wanted
    threaded.resetSimulation()
    assert run(threaded) == wanted


def test_a_server_that_steps_in_real_time_makes_the_same_steps(threaded: Any, client: Any) -> None:
    steps, states = in_real_time(threaded)
    assert states == by_steps(client, steps)


def test_no_step_sees_half_a_map(threaded: Any) -> None:
    """Balls at the two ends of a large map rise and fall alike while maps come at any moment."""
    threaded.setTimeStep(1e-3)
    side = 2001
    terrain = level(side, 0.01, motion=MotionConfig(mode="hold"))
    bodies = [put(threaded, BALL, (0.0, y, 0.1)) for y in (-9.5, 9.5)]
    ground = ground_of(threaded, terrain, *bodies)
    maps = [np.full((side, side), z, np.float32) for z in (-3e-3, 0.0)]
    for number in range(25):
        threaded.setRealTimeSimulation(1)
        terrain.replace(maps[number % 2], time=ground.clock)
        terrain.replace(maps[1 - number % 2], time=ground.clock)
        threaded.setRealTimeSimulation(0)
        low, high = (height(threaded, body) for body in bodies)
        assert low == pytest.approx(high, rel=0.0, abs=1e-9)
    assert ground.clock > 5e-3


def test_bodies_come_and_go_while_a_server_steps(threaded: Any) -> None:
    """A ball at the origin, where PyBullet puts new bodies, keeps lying there."""
    lies = put(threaded, BALL, (0.0, 0.0, 0.1))
    ground = ground_of(threaded, level(), lies)
    threaded.setRealTimeSimulation(1)
    for k in range(25):
        other = put(threaded, BALL, (1.0 + 0.01 * k, 1.0, 0.2))
        ground.attach(other)
        ground.detach(other)
        threaded.removeBody(other)
        position, velocity = threaded.getBasePositionAndOrientation(lies)[0], threaded.getBaseVelocity(lies)[0]
        assert np.allclose(position, (0.0, 0.0, 0.1), rtol=0.0, atol=1e-3)
        assert math.hypot(*velocity) < 0.05


SERVER = f"""
import pybullet, sys
pybullet.connect(pybullet.SHARED_MEMORY_SERVER, {KEY + 1})
print("ready", flush=True)
sys.stdin.read()
"""


def test_a_client_of_a_server_in_another_process_is_refused() -> None:
    with subprocess.Popen(
        [sys.executable, "-c", SERVER], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
    ) as server:
        assert server.stdout is not None
        while b"ready" not in server.stdout.readline():
            assert server.poll() is None
        client = Client(pb.SHARED_MEMORY, KEY + 1)
        client.setGravity(0.0, 0.0, -9.81)
        with pytest.raises(InputError, match="server of this PyBullet client runs in another process"):
            Ground(client, level())
        assert client.getNumBodies() == 0
        client.disconnect()
        server.communicate()


def test_worlds_that_ended_leave_nothing_behind() -> None:
    """Not 2 KiB a world of twenty boxes."""
    terrain, used = level(), []
    for count in (5, 20):
        for _ in range(count):
            client: Any = BulletClient(pb.DIRECT)
            places = [(0.3 * (k % 5), 0.3 * (k // 5), 0.1) for k in range(20)]
            ground = ground_of(client, terrain, *[put(client, Box(0.2, 0.2, 0.2), place) for place in places])
            client.stepSimulation()
            client.disconnect()
            ground.close()
        used.append(allocated())
    assert used[1] - used[0] < 20 * 2 * 1024


FAILING = """
import resource
import numpy as np, pybullet as pb
from smartmesh_ros import Ground, HeightMap

pb.connect(pb.DIRECT)
pb.setGravity(0.0, 0.0, -9.81)
heights = np.random.default_rng(0).normal(0.0, 0.01, (1001, 1001))
ground = Ground(pb, HeightMap(heights, resolution=0.01, origin=(-5.0, -5.0)))
box = pb.createMultiBody(1.0, pb.createCollisionShape(pb.GEOM_BOX, halfExtents=(4.9, 4.9, 0.1)), -1, (0.0, 0.0, 0.12))
ground.attach(box)
soft, hard = resource.getrlimit(resource.RLIMIT_AS)
with open("/proc/self/statm") as file:
    used = int(file.read().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (used + (8 << 20), hard))
pb.stepSimulation()
resource.setrlimit(resource.RLIMIT_AS, (soft, hard))
assert not pb.getContactPoints(box)
try:
    ground.step(1 / 240, 1 / 240)
except pb.error as error:
    print(error)
ground.step(1 / 240, 1 / 240)
assert pb.getContactPoints(box)
"""


def test_a_step_without_memory_has_no_contacts_and_says_so_later() -> None:
    """The process goes on, and so does the world."""
    done = subprocess.run([sys.executable, "-c", FAILING], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "in a step of PyBullet a body had no contacts with the ground: std::bad_alloc" in done.stdout


def test_a_core_that_was_unloaded_leaves_the_world_usable(client: Any) -> None:
    body = put(client, BALL, (0.0, 0.0, 0.1))
    ground = ground_of(client, level(), body)
    ground.step(0.0, DT)
    assert client.getContactPoints(body)
    client.unloadPlugin(client.loadPlugin(CORE.__file__, layout_probe.POSTFIX))
    client.stepSimulation()
    assert not client.getContactPoints(body)
    with pytest.raises(InputError, match="make another"):
        ground.step(DT, DT)


def moved(numbers: Any) -> Any:
    """Numbers of PyBullet, each a little larger."""
    return tuple(moved(each) for each in numbers) if isinstance(numbers, tuple) else numbers + 1e-6


def moved_at(at: int) -> Callable[[Any], Any]:
    """Contacts of PyBullet, of which one number or point is a little larger."""
    return lambda points: tuple((*each[:at], moved(each[at]), *each[at + 1 :]) for each in points)


# What PyBullet is asked and told, its answer if it keeps it elsewhere than the core, and what the two differ in then.
ELSEWHERE: list[tuple[str, Callable[[Any], Any], str]] = [
    ("getBasePositionAndOrientation", moved, "the states of bodies and links"),
    ("getLinkState", moved, "the states of bodies and links"),
    ("setPhysicsEngineParameter", lambda _: None, "the settings of the solver"),
    # The point, the normal, the distance, the force, friction.
    *(("getContactPoints", moved_at(at), "contacts") for at in (6, 7, 8, 9, 10)),
    ("rayTest", lambda _: (), "pairs of bodies"),
]


@pytest.mark.parametrize(("call", "changed", "what"), ELSEWHERE)
def test_a_core_that_was_built_for_another_pybullet_is_not_used(
    client: Any, call: str, changed: Callable[[Any], Any], what: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    own = getattr(pb, call)
    layout_probe.misread.cache_clear()
    monkeypatch.setattr(pb, call, lambda *args, **named: changed(None if "set" in call else own(*args, **named)))
    assert layout_probe.misread() == what
    monkeypatch.undo()
    with pytest.raises(InputError, match=f"the core was built for another PyBullet: the two differ in {what}"):
        Ground(client, level())
    assert client.getNumBodies() == 0
    layout_probe.misread.cache_clear()
    assert layout_probe.misread() == ""
