"""One call of the ground saves and restores PyBullet's world, the terrain and the soil: in place, and to the bit."""

import hashlib
import math
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pybullet as pb
import pybullet_data
import pytest
from pybullet_utils.bullet_client import BulletClient

from smartmesh_ros import Deck, Ground, HeightMap, InputError, Soil
from smartmesh_ros.ground.bullet import BulletCalls

DT = 1.0 / 240.0
COUNT = 16  # of bodies


class Scene:
    """Boxes, balls and a robot that meet in a bowl whose ground moves, or on soil; by PyBullet's own calls."""

    def __init__(self, *, soil: bool, seed: int = 0) -> None:
        client: Any = BulletClient(pb.DIRECT)
        client.setGravity(0.0, 0.0, -9.81)
        # PyBullet shares it among all worlds of a process, so that it is another one after tests of `World`.
        client.setPhysicsEngineParameter(contactBreakingThreshold=0.02)
        self.client, self.soil = client, soil
        self.map = HeightMap(self.heights(0.0), resolution=0.1, origin=(-3.0, -3.0))
        self.ground = Ground(client, self.map)
        if soil:
            self.ground.set_soil(Soil(self.map, "dry_sand"))
        rng = np.random.default_rng(seed)
        shapes = [
            client.createCollisionShape(pb.GEOM_BOX, halfExtents=[0.1, 0.15, 0.1]),
            client.createCollisionShape(pb.GEOM_SPHERE, radius=0.1),
        ]
        self.bodies = [
            client.createMultiBody(
                1.0,
                shapes[k % 2],
                -1,
                [*rng.uniform(-0.8, 0.8, 2), rng.uniform(0.4, 1.2)],
                useMaximalCoordinates=k % 3 == 0,
            )
            for k in range(COUNT)
        ]
        self.bodies.append(client.loadURDF(f"{pybullet_data.getDataPath()}/husky/husky.urdf", [0.0, 0.0, 1.6]))
        for body in self.bodies:
            self.ground.attach(body)
        for name, carrier in (("ship", None), ("bed", self.bodies[-1])):
            tile = HeightMap(np.zeros((9, 9)), resolution=0.1, origin=(-0.4, -0.4))
            self.ground.terrain.put(name, Deck(tile, thickness=0.1, position=(0.5, 0.5, 0.9)))
            if carrier is not None:
                self.ground.carry(name, carrier, position=(0.0, 0.0, 0.4))
        self.ground.drive(self.bodies[0], -1, (0.0, 1.0, 0.0), 0.3)
        self.ground.let_sleep()
        self.time = 0.0

    def heights(self, time: float) -> np.ndarray:
        y, x = 0.1 * np.mgrid[:61, :61] - 3.0
        return np.asarray(0.1 * (x * x + y * y) + (0.0 if self.soil else 0.05 * np.sin(2.0 * x - 3.0 * time)))

    def run(self, steps: int) -> np.ndarray:
        """Step, and return the states of all bodies after each step."""
        found = []
        for _ in range(steps):
            if round(self.time / DT) % 8 == 0 and not self.soil:
                self.map.replace(self.heights(self.time), time=self.time)
            if round(self.time / DT) % 8 == 3:
                roll = 0.1 * math.sin(3.0 * self.time)
                turn = (math.sin(roll), 0.0, 0.0, math.cos(roll))
                self.ground.terrain.deck("ship").move((0.5, 0.5, 0.9 + roll), turn, time=self.time)
            self.ground.step(self.time, DT)
            self.time += DT
            found.append(BulletCalls(self.client).states(self.bodies))
        return np.array(found)

    def save(self, file: Path | None = None) -> bytes:
        return self.ground.save_state(file)

    def restore(self, state: bytes | Path) -> None:
        self.time = self.ground.restore_state(state)


def digest(states: np.ndarray) -> str:
    return hashlib.sha256(states.tobytes()).hexdigest()


def digest_of_restored(file: str, *, soil: bool) -> str:
    scene = Scene(soil=soil)
    scene.restore(Path(file))
    return digest(scene.run(300))


@pytest.fixture
def scene(request: pytest.FixtureRequest) -> Iterator[Scene]:
    made = Scene(soil=request.param)
    yield made
    made.client.disconnect()


both = pytest.mark.parametrize("scene", [False, True], indirect=True, ids=["moving", "soil"])
moving = pytest.mark.parametrize("scene", [False], indirect=True)


@both
def test_a_restored_world_goes_on_to_the_bit_here_and_in_a_new_process(scene: Scene, tmp_path: Path) -> None:
    scene.run(150)
    file = tmp_path / "state.npz"
    data = scene.save(file)
    first = scene.run(300)
    for more in (0, 37):
        scene.run(more)
        scene.restore(data)
        np.testing.assert_array_equal(scene.run(300), first)
    code = (
        "from tests.ground.test_saved_states import digest_of_restored; "
        f"print('digest', digest_of_restored({str(file)!r}, soil={scene.soil}))"
    )
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=300).stdout
    assert told.split("digest ")[-1].strip() == digest(first)


@moving
def test_pybullet_alone_forgets_the_ground(scene: Scene) -> None:
    """What the call is for: after PyBullet's own the map is that of later, and contacts are solved in another order."""
    scene.run(150)
    state, time = scene.client.saveState(), scene.time
    first = scene.run(100)
    scene.client.restoreState(state)
    with pytest.raises(InputError, match="comes after one of"):
        scene.map.replace(scene.heights(time), time=time)
    assert not np.array_equal(scene.run(100), first)


@moving
def test_pybullets_own_states_stay_usable_beside_it(scene: Scene) -> None:
    scene.run(20)
    own = scene.client.saveState()
    before = BulletCalls(scene.client).states(scene.bodies)
    data = scene.save()
    scene.run(20)
    scene.restore(data)
    scene.client.restoreState(own)
    np.testing.assert_array_equal(BulletCalls(scene.client).states(scene.bodies), before)


WRONG: dict[str, tuple[Callable[[Scene], object], str]] = {
    "one body less": (lambda it: it.client.removeBody(it.bodies[3]), "attached bodies and links, and this ground has"),
    "one not attached": (lambda it: it.ground.detach(it.bodies[3]), "attached bodies and links, and this ground has"),
    "more of PyBullet's": (
        lambda it: it.client.createMultiBody(1.0, it.client.createCollisionShape(pb.GEOM_SPHERE, radius=0.1)),
        "PyBullet cannot restore its part",
    ),
    "soil": (lambda it: it.ground.set_soil(Soil(it.map, "clay")), r"no soil, so call set_soil\(None\)"),
    "a reset client": (lambda it: it.client.resetSimulation(), "make another"),
}


@moving
@pytest.mark.parametrize("how", WRONG)
def test_a_state_of_other_bodies_is_refused_and_changes_nothing(scene: Scene, how: str) -> None:
    scene.run(30)
    data, (change, words) = scene.save(), WRONG[how]
    scene.run(10)
    change(scene)
    heights = scene.map.heights.copy()
    bodies = [
        body for body in scene.bodies if body in map(scene.client.getBodyUniqueId, range(scene.client.getNumBodies()))
    ]
    before = BulletCalls(scene.client).states(bodies)
    with pytest.raises(InputError, match=words):
        scene.restore(data)
    np.testing.assert_array_equal(scene.map.heights, heights)
    np.testing.assert_array_equal(BulletCalls(scene.client).states(bodies), before)
