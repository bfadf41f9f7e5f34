"""A saved world is all that it goes on from, and what is no saved world changes nothing."""

import io
import json
import os
import pickle
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from smartmesh_ros import BodyState, HeightMap, InputError, PhysicsConfig, Soil, World, WorldConfig
from smartmesh_ros.ground.shapes import Box, Cylinder, Sphere
from smartmesh_ros.terrain import state_file
from smartmesh_ros.world.snapshot import WorldState
from tests.bodies import LYING
from tests.examples import examples
from tests.grounds import level, on_soil, terrain_of
from tests.urdfs import ROVER
from tests.world.random_worlds import digests_elsewhere, saved_run
from tests.world.test_tracked_shapes import SHAPES

# Of `random_worlds`: soil and robots, tiles and a mesh, fused corrections, regions, a scrolling map.
SEEDS, STEPS = (11, 6, 67, 9), 400


def test_worlds_saved_at_random_steps_go_on_to_the_bit_in_a_new_process(tmp_path: Path) -> None:
    files = {seed: tmp_path / f"{seed}.npz" for seed in SEEDS}
    runs = {seed: saved_run(seed, file, 300, STEPS) for seed, file in files.items()}
    restored = digests_elsewhere({seed: (str(files[seed]), at) for seed, (at, _) in runs.items()}, STEPS)
    assert restored == {seed: digest for seed, (_, digest) in runs.items()}


def test_a_restored_world_is_saved_as_it_was() -> None:
    """However bodies are turned, half turns about diagonals among them, and of whatever shape tracked ones are."""
    turns = np.vstack([np.random.default_rng(4).normal(size=(8, 4)), [[-1, 0, 1, 0], [1, -1, 0, 0], [1, 1, 1, 1]]])
    with World(terrain_of(a=level(41, 0.05))) as made:
        for number, (turn, shape) in enumerate(zip(turns, cycle(SHAPES), strict=False)):
            x, y, z, w = (turn / np.linalg.norm(turn)).tolist()
            state = BodyState((0.3 * number - 1.5, 0.5, 1.0), (x, y, z, w), (0.0, 0.1, 0.0), (1.0, 2.0, 3.0))
            made.spawn(f"box {number}", Box(0.2, 0.1, 0.05), 1.0, state)
            made.track(f"tracked {number}", shape, replace(state, position=(0.3 * number, -1.0, 1.0)))
            made.spawn_robot(f"rover {number}", ROVER, replace(state, position=(0.0, 1.5, 1.0 + number)))
        for steps in (0, 20):
            made.step(steps)
            data = made.save()
            assert made.save() == data
            with World() as other:
                other.restore(data)
                assert other.save() == data


@pytest.fixture(scope="module")
def world() -> Iterator[World]:
    """Bodies, a robot and soil on two tiles, one of which moves, after half a second."""
    with World(terrain_of(a=level(41, 0.05), b=level(11, 0.4))) as made:
        made.ground.set_soil(Soil(made.terrain, "clay", tile="a"))
        made.spawn("ball", Sphere(0.1), 10.0, BodyState((0.0, 0.0, 0.2)))
        made.spawn_robot("rover", ROVER, BodyState((0.3, 0.3, 0.5)))
        for index in range(30):
            made.terrain.tiles["b"].replace(np.full((11, 11), 1e-3 * index), time=made.time)
            made.step(4)
        yield made


def spoilt(data: bytes, how: str, at: float) -> bytes:
    """Return what became of a state: cut off, changed in a byte, or another file altogether."""
    place = int(at * len(data))
    if how == "cut off":
        return data[:place]
    if how == "changed":
        return data[:place] + bytes([data[place] ^ (1 + place % 255)]) + data[place + 1 :]
    if how == "longer":
        return data + data[: place + 1]
    file = io.BytesIO()
    if how == "another zip":
        with zipfile.ZipFile(file, "w") as archive:
            archive.writestr("world.txt", data[:place])
    elif how == "another npz":
        np.savez(file, state=np.frombuffer(data, np.uint8)[:place])
    elif how == "pickle":
        pickle.dump(data[:place], file)
    else:
        return np.random.default_rng(place).bytes(place)
    return file.getvalue()


HOWS = ("cut off", "changed", "longer", "another zip", "another npz", "pickle", "noise")


@examples(100)
@given(how=st.sampled_from(HOWS), at=st.floats(0.0, 1.0, exclude_max=True))
def test_spoilt_files_are_refused_and_change_nothing(world: World, how: str, at: float) -> None:
    before = world.state_bytes()
    with pytest.raises(InputError, match=r"no saved state|was damaged"):
        world.restore(spoilt(before, how, at))
    assert world.state_bytes() == before


def remade(data: bytes, change: Callable[[dict[str, Any], dict[str, np.ndarray]], object]) -> bytes:
    """Return a state whose text and arrays were changed by somebody who knows its digest."""
    with np.load(io.BytesIO(data), allow_pickle=False) as file:
        arrays = {name: file[name] for name in file.files}
    head = json.loads(arrays.pop("state").tobytes())
    change(head, arrays)
    file, comment = io.BytesIO(), state_file.MARK + b"0" * state_file.DIGITS
    with zipfile.ZipFile(file, "w") as archive:
        archive.comment = comment
        for name, array in {"state": np.frombuffer(json.dumps(head).encode(), np.uint8), **arrays}.items():
            with archive.open(f"{name}.npy", "w") as member:
                np.lib.format.write_array(member, array, allow_pickle=True)
    return state_file.signed(file.getvalue()[: -len(comment)])


def replace_arrays(new: Callable[[np.ndarray], np.ndarray]) -> Callable[[dict[str, Any], dict[str, np.ndarray]], None]:
    return lambda _, arrays: arrays.update({name: new(array) for name, array in arrays.items()})


NEWER = state_file.VERSION + 1
WRONG: dict[str, tuple[Callable[[dict[str, Any], dict[str, np.ndarray]], object], str]] = {
    "newer": (lambda head, _: head.update(version=NEWER), f"saved by a newer smartmesh_ros, in version {NEWER}"),
    "older": (lambda head, _: head.update(version=0), "saved by an older smartmesh_ros"),
    "of a ground": (lambda head, _: head.update(kind="Ground"), "saved state of a Ground, and a World cannot"),
    "another program's": (lambda head, _: head.update(format="elsewhere"), "no saved state"),
    "of an unknown type": (lambda head, _: head["tree"].update({"is": "Popen"}), "no saved state.*Popen"),
    "with less fields": (lambda head, _: head["tree"]["of"].popitem(), "no saved state.*argument"),
    "with words for time": (lambda head, _: head["tree"]["of"]["snapshot"]["of"].update(time="now"), "no saved state"),
    "without arrays": (lambda _, arrays: arrays.clear(), "no saved state"),
    "with pickles": (replace_arrays(lambda array: np.array([{}], object)), "no saved state.*allow_pickle"),
    "with short arrays": (replace_arrays(lambda array: array[:-1]), "must be"),
    "with flat arrays": (replace_arrays(np.ravel), "must be"),
    "with other numbers": (replace_arrays(lambda a: np.full_like(a, 200)), "must be|is not there"),
    "with other types": (replace_arrays(lambda a: a.astype(np.int16 if a.dtype.kind == "f" else a.dtype)), "must be"),
}  # fmt: skip


@pytest.mark.parametrize("how", WRONG)
def test_files_of_others_are_refused_and_change_nothing(world: World, how: str) -> None:
    before, (change, words) = world.state_bytes(), WRONG[how]
    world.restore(remade(before, lambda *_: None))  # it is the change that is refused
    before = world.state_bytes()
    with pytest.raises(InputError, match=words):
        world.restore(remade(before, change))
    assert world.state_bytes() == before


def test_a_file_that_cannot_be_read_or_written_changes_nothing(world: World, tmp_path: Path) -> None:
    before = world.state_bytes()
    with pytest.raises(InputError, match=r"cannot be read.*No such file"):
        world.restore(tmp_path / "none.npz")
    with pytest.raises(InputError, match="cannot be saved"):
        world.save(tmp_path / "no folder" / "state.npz")
    (tmp_path / "folder").mkdir()
    os.mkfifo(tmp_path / "pipe")
    for name in ("folder", "pipe", "zero \0 byte"):
        with pytest.raises(InputError, match="cannot be saved"):
            world.save(tmp_path / name)
    assert {path.name: path.is_file() for path in tmp_path.iterdir()} == {"folder": False, "pipe": False}
    assert world.state_bytes() == before


@pytest.mark.parametrize("extra", [np.random.default_rng(1), {(1, 2): 3}, 1j, {1}, np.array([None])])
def test_what_no_state_gives_back_is_refused_and_the_file_stays(world: World, extra: Any, tmp_path: Path) -> None:
    """A generator of random numbers has a dict that a state takes."""
    file, random = tmp_path / "state.npz", np.random.default_rng(1)
    data = world.save(file, extra={"random": random.bit_generator.state})
    assert WorldState.from_bytes(data).extra == {"random": random.bit_generator.state}
    before = world.snapshot()
    with pytest.raises(InputError, match=r"the extra state is .*; it must be a dict"):
        world.save(file, extra={"it": extra})
    assert file.read_bytes() == data and world.snapshot() == before


def test_a_state_is_the_whole_and_lies_in_place(tmp_path: Path) -> None:
    """Settings, time, tiles and soil come from it; whoever holds a tile or the soil holds what was restored."""
    config = WorldConfig(physics=PhysicsConfig(rate=100.0, gravity=(0.0, 0.0, -1.6)))
    with World(level(41, 0.05), config) as world:
        world.ground.set_soil(Soil(world.terrain, "dry_sand"))
        world.spawn("box", Box(0.2, 0.2, 0.2), 20.0, BodyState((0.0, 0.0, 0.1)))
        world.step(50)
        world.reset(seed=7)
        world.step(100)
        world.save(tmp_path / "state.npz")
        mine, other_tile = level(41, 0.05), level(11)
        terrain = terrain_of(other=other_tile)
        terrain.put("", mine)
        with World(terrain) as other:
            soil = Soil(mine, "clay")
            other.ground.set_soil(soil)
            other.ground.show(20.0)
            other.restore(tmp_path / "state.npz")
            assert (other.config, other.seed, other.time) == (config, 7, world.time)
            assert other.terrain is terrain
            assert other.ground.drawn == 20.0
            assert other.terrain.tiles == {"": mine}
            assert other.ground.soil is soil
            assert soil.map is mine
            for each in (world, other):
                each.step(100)
            assert other.snapshot() == world.snapshot()
            np.testing.assert_array_equal(soil.sinkage(), world.ground.soil.sinkage())  # type: ignore[union-attr]
            assert soil.sinkage().max() > 1e-3
            for each in (world, other):
                each.reset(seed=3)
                each.step(100)
            assert other.snapshot() == world.snapshot(), "the first terrain is part of the state"


def test_what_slept_sleeps_again_where_it_lay() -> None:
    with World(level()) as world:
        for index in range(4):
            world.spawn(f"box_{index}", Box(0.2, 0.2, 0.2), 1.0, BodyState((0.0, 0.0, 0.1 + 0.2 * index)))
        world.step(480)
        before = [world.state(name).position for name in world.bodies]
        world.save()
        world.step(24)
        assert all(world.is_asleep(name) for name in world.bodies), "a tenth of the time that they must be still"
        assert [world.state(name).position for name in world.bodies] == [pytest.approx(it, abs=1e-4) for it in before]


def test_saving_hardly_disturbs_a_run() -> None:
    """Four times, a track that pulls itself through soil and a wheel that rolls there: they keep how far they sheared
    it. Without, they would be 1.5 mm away."""

    def ends(*, saves: bool) -> list[float]:
        with on_soil(HeightMap(np.zeros((101, 101)), resolution=0.04), "dry_sand") as world:
            world.spawn("track", Box(0.5, 0.1, 0.1), 20.0, BodyState((1.0, 2.0, 0.051)))
            world.spawn("wheel", Cylinder(radius=0.1, height=0.1), 20.0, BodyState((1.0, 3.0, 0.11), LYING))
            world.step(60)
            world.drive_surface("track", "", 0.3)
            world.move("wheel", replace(world.state("wheel"), linear=(0.5, 0.0, 0.0), angular=(0.0, 5.0, 0.0)))
            for _ in range(4):
                world.step(30)
                if saves:
                    world.save()
            world.step(60)
            return [*world.state("track").position, *world.state("wheel").position]

    assert ends(saves=True) == pytest.approx(ends(saves=False), abs=5e-4)
