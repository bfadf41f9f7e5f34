"""One call of the ground saves and restores PyBullet's world, the terrain and the soil: in place, and to the bit."""

import hashlib
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pybullet as pb
import pytest

from smartmesh_ros import InputError, Soil
from tests.ground.scene import Scene
from tests.memory import allocated

# So many that bodies of the scene run into each other after what they went through before.
STEPS = 420


def restore(scene: Scene, state: bytes | Path) -> None:
    scene.time = scene.ground.restore_state(state)


def digest(states: np.ndarray) -> str:
    return hashlib.sha256(states.tobytes()).hexdigest()


def digest_of_restored(file: str, *, soil: bool) -> str:
    scene = Scene(soil=soil)
    restore(scene, Path(file))
    return digest(scene.run(STEPS))


@pytest.fixture
def scene(request: pytest.FixtureRequest) -> Iterator[Scene]:
    made = Scene(soil=getattr(request, "param", False))
    yield made
    made.client.disconnect()


@pytest.mark.parametrize("scene", [False, True], indirect=True, ids=["moving", "soil"])
def test_a_restored_world_goes_on_to_the_bit_here_and_in_a_new_process(scene: Scene, tmp_path: Path) -> None:
    scene.run(150)
    file = tmp_path / "state.npz"
    data = scene.ground.save_state(file)
    first = scene.run(STEPS)
    scene.run(37)
    scene.ground.show(20.0)
    restore(scene, data)
    assert scene.ground.drawn == 20.0, "what is shown is no part of a state"
    np.testing.assert_array_equal(scene.run(STEPS), first)
    code = (
        "from tests.ground.test_saved_states import digest_of_restored; "
        f"print('digest', digest_of_restored({str(file)!r}, soil={scene.soil}))"
    )
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=300).stdout
    assert told.split("digest ")[-1].strip() == digest(first)


def test_a_restored_world_of_the_simple_broadphase_goes_on_to_the_bit(client: Any) -> None:
    """A body that went leaves a number that no other has."""
    client.resetSimulation(pb.RESET_USE_SIMPLE_BROADPHASE)
    scene = Scene(client)
    scene.run(20)
    client.removeBody(scene.bodies.pop(3))
    data = scene.ground.save_state()
    first = scene.run(STEPS)
    restore(scene, data)
    np.testing.assert_array_equal(scene.run(STEPS), first)


def test_pybullets_own_states_stay_usable_beside_it(scene: Scene) -> None:
    scene.run(20)
    own = scene.client.saveState()
    before = scene.bases()
    data = scene.ground.save_state()
    scene.run(20)
    restore(scene, data)
    scene.client.restoreState(own)
    np.testing.assert_array_equal(scene.bases(), before)


def test_episodes_that_begin_with_a_restored_state_take_no_more_memory_than_few(scene: Scene) -> None:
    """PyBullet's state of this scene is a file of 170 KiB."""
    start, used = scene.ground.save_state(), []
    for count in (5, 20):
        for _ in range(count):
            restore(scene, start)
            scene.run(2)
            scene.ground.save_state()
        used.append(allocated())
    assert used[1] - used[0] < 20 * 4 * 1024


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


@pytest.mark.parametrize("how", WRONG)
def test_a_state_of_other_bodies_is_refused_and_changes_nothing(scene: Scene, how: str) -> None:
    scene.run(30)
    data, (change, words) = scene.ground.save_state(), WRONG[how]
    scene.run(10)
    change(scene)
    heights, before = scene.map.heights.copy(), scene.bases()
    with pytest.raises(InputError, match=words):
        restore(scene, data)
    np.testing.assert_array_equal(scene.map.heights, heights)
    np.testing.assert_array_equal(scene.bases(), before)
