"""No argument makes the core read or write outside an array: what it cannot take, it refuses."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pybullet as pb
import pytest
from pybullet_utils.bullet_client import BulletClient

from smartmesh_ros.core import _core
from smartmesh_ros.terrain.motion import CLOCK, KEPT

REFUSED = (TypeError, ValueError)
Spoil = Callable[[np.ndarray], Any]

# What is never an array that the core can take.
SPOILT: dict[str, Spoil] = {
    "None": lambda a: None,
    "list": lambda a: a.tolist(),
    "number": lambda a: 1.0,
    "other precision": lambda a: a.astype({"float32": np.float64, "float64": np.float32}.get(a.dtype.name, np.int64)),
    "integers": lambda a: a.astype(np.int32),
    "objects": lambda a: a.astype(object),
    "byte order": lambda a: a.astype(a.dtype.newbyteorder()) if a.dtype.itemsize > 1 else a.astype(">i2"),
    "strided": lambda a: np.repeat(a, 2, axis=-1)[..., ::2],
    "Fortran order": lambda a: np.asfortranarray(np.concatenate([a, a]))[: len(a)],
    "reversed": lambda a: a[::-1],
    "one axis fewer": lambda a: a[0],
    "one axis more": lambda a: a[None],
    "one row fewer": lambda a: a[:-1],
    "one column fewer": lambda a: np.ascontiguousarray(a[..., :-1]),
    "misaligned": lambda a: np.frombuffer(b"\0" + a.tobytes(), a.dtype, a.size, 1).reshape(a.shape),
    "empty": lambda a: a[:0],
    "empty rows": lambda a: np.ascontiguousarray(a[..., :0]),
    "huge without memory": lambda a: np.broadcast_to(a.ravel()[:1], (1 << 20,) * a.ndim),
}


def arrays(rows: int = 70, columns: int = 130) -> dict[str, np.ndarray]:
    blocks = ((rows + 63) // 64, (columns + 63) // 64)
    return {
        "heights": np.zeros((rows, columns), np.float32),
        "velocities": np.zeros((KEPT, rows, columns), np.float32),
        "offsets": np.zeros((rows, columns), np.float32),
        "clocks": np.zeros(blocks, CLOCK).view(np.uint8).reshape(*blocks, CLOCK.itemsize),
    }


def grid_of(heights: np.ndarray, resolution: float = 0.1, yaw: float = 0.0) -> Any:
    """Returns a height map of the core whose first sample is at the origin."""
    grid = _core.Grid(**(arrays(*heights.shape) | {"heights": heights}))
    grid.place(0.0, 0.0, 0.0, yaw, resolution)
    return grid


def contact_arguments() -> dict[str, Any]:
    return {
        "shape": _core.Shape.box(0.1, 0.1, 0.1),
        "tiles": [grid_of(np.zeros((8, 8), np.float32))],
        "pose": np.vstack([np.eye(3), [0.5, 0.5, 0.1]]),
        "motion": np.zeros((2, 3)),
        "duration": 0.004,
        "margin": 0.01,
    }


@pytest.mark.parametrize("how", SPOILT)
@pytest.mark.parametrize("name", ("heights", "velocities", "offsets", "clocks"))
def test_a_grid_refuses_arrays_that_do_not_fit(name: str, how: str) -> None:
    given = arrays()
    given[name] = SPOILT[how](given[name])
    with pytest.raises(REFUSED):
        _core.Grid(**given)


@pytest.mark.parametrize("rows, columns", ((1, 5), (5, 1), (0, 0)))
def test_a_grid_has_at_least_a_cell(rows: int, columns: int) -> None:
    with pytest.raises(REFUSED):
        _core.Grid(**arrays(rows, columns))


def test_a_grid_reads_arrays_that_are_read_only_and_keeps_them() -> None:
    given = arrays()
    given["heights"][:] = 2.0
    for array in given.values():
        array.setflags(write=False)
    grid = _core.Grid(**given)
    del given
    assert grid.sample(69, 129, 0.0, 0.1) == (2.0, 0.0)


@pytest.mark.parametrize("place", ((-1, 0), (0, -1), (70, 0), (0, 130), (2**31 - 1, 0), (-(2**31), -(2**31))))
def test_samples_beyond_a_grid_are_no_ground(place: tuple[int, int]) -> None:
    height, rise = _core.Grid(**arrays()).sample(*place, 0.0, 0.1)
    assert np.isnan(height) and rise == 0.0


@pytest.mark.parametrize("newest", (-1, KEPT, 2**62, -(2**63)))
def test_a_clock_that_names_no_velocity_reads_none(newest: int) -> None:
    given = arrays()
    clocks = np.zeros((2, 3), CLOCK)
    clocks["known"], clocks["newest"], clocks["lifetime"] = KEPT, newest, 1.0
    clocks["middle"], clocks["middle_1"], clocks["middle_2"] = -0.05, -0.15, -0.25
    given["clocks"] = clocks.view(np.uint8).reshape(2, 3, CLOCK.itemsize)
    grid = _core.Grid(**given)
    assert grid.sample(3, 3, 0.5, 0.1) == (0.0, 0.0)


@pytest.mark.parametrize("value", (np.nan, np.inf, -np.inf, 0.0, -1.0))
def test_a_resolution_is_above_zero_and_finite(value: float) -> None:
    with pytest.raises(REFUSED):
        _core.Grid(**arrays()).place(0.0, 0.0, 0.0, 0.0, value)


@pytest.mark.parametrize("value", (np.nan, np.inf))
@pytest.mark.parametrize("at", range(4))
def test_a_place_is_finite(at: int, value: float) -> None:
    place = [0.0, 0.0, 0.0, 0.0]
    place[at] = value
    with pytest.raises(REFUSED):
        _core.Grid(**arrays()).place(*place, 0.1)


@pytest.mark.parametrize("mode", (-1, 4, 2**31 - 1))
def test_a_mode_is_one_of_four(mode: int) -> None:
    with pytest.raises(REFUSED):
        _core.Grid(**arrays()).set_motion(mode, 1.0, 1.0, 0.0, 0.0)


@pytest.mark.parametrize("how", SPOILT)
@pytest.mark.parametrize("name", ("pose", "motion"))
def test_contacts_refuse_arrays_that_do_not_fit(name: str, how: str) -> None:
    given = contact_arguments()
    given[name] = SPOILT[how](given[name])
    with pytest.raises(REFUSED):
        _core.find_contacts(**given)


@pytest.mark.parametrize("value", (np.nan, np.inf, -np.inf))
@pytest.mark.parametrize("name", ("pose", "motion", "duration", "margin"))
def test_contacts_refuse_numbers_that_are_not_finite(name: str, value: float) -> None:
    given = contact_arguments()
    if isinstance(given[name], np.ndarray):
        given[name][1, 1] = value
    else:
        given[name] = value
    with pytest.raises(REFUSED):
        _core.find_contacts(**given)


@pytest.mark.parametrize("name, value", (("resolution", 1e-300), ("margin", 1e8), ("duration", 1e8)))
def test_extreme_numbers_do_no_harm(name: str, value: float) -> None:
    given = contact_arguments() | {"motion": np.full((2, 3), 1e6)}
    tiles = [grid_of(np.zeros((8, 8), np.float32), value)] if name == "resolution" else given["tiles"]
    try:
        _core.find_contacts(**(given | {"tiles": tiles} | ({name: value} if name in given else {})))
    except REFUSED:
        return


def test_heights_that_are_not_finite_are_no_ground() -> None:
    for value in (np.nan, np.inf, -np.inf):
        given = contact_arguments() | {"tiles": [grid_of(np.full((8, 8), value, np.float32))]}
        assert not len(_core.find_contacts(**given))


@pytest.mark.parametrize("how", SPOILT)
def test_a_hull_refuses_arrays_that_do_not_fit(how: str) -> None:
    points = np.random.default_rng(0).normal(size=(8, 3))
    if how in ("one row fewer",):
        return
    with pytest.raises(REFUSED):
        _core.Shape.hull(SPOILT[how](points), 0.0)


@pytest.mark.parametrize(
    "points", (np.zeros((1, 3)), np.zeros((9, 3)), np.outer(np.arange(5.0), [1.0, 2.0, 3.0]), np.eye(3))
)
def test_hulls_without_volume_do_no_harm(points: np.ndarray) -> None:
    given = contact_arguments() | {"shape": _core.Shape.hull(points, 0.01)}
    assert np.isfinite(_core.find_contacts(**given)).all()


@pytest.fixture
def ground() -> Any:
    client: Any = BulletClient(pb.DIRECT)
    plugin = client.loadPlugin(_core.__file__, "_smartmesh")
    yield _core.Ground(client.executePluginCommand(plugin, "", []))
    client.disconnect()


@pytest.mark.parametrize("slot", (-1, 0, 1, 2**31 - 1, -(2**31)))
def test_slots_that_nobody_has_are_refused(ground: Any, slot: int) -> None:
    with pytest.raises(REFUSED):
        ground.detach(slot)
    with pytest.raises(REFUSED):
        ground.read(np.array([slot], np.int64), np.zeros((1, 13)) if slot else np.zeros((0, 13)))
    with pytest.raises(REFUSED):
        ground.attach(slot, 0, -1, 0)  # PyBullet has no body
    with pytest.raises(REFUSED):
        ground.drive(slot, (0.0, 1.0, 0.0), 1.0)


@pytest.mark.parametrize("flags", (np.zeros(3), np.zeros((2, 2), bool), np.zeros(6, bool)[::2], None))
def test_flags_that_do_not_fit_are_refused(ground: Any, flags: Any) -> None:
    with pytest.raises(REFUSED):
        ground.enable(flags)


def test_flags_of_slots_that_nobody_has_do_no_harm(ground: Any) -> None:
    ground.enable(np.ones(1000, bool))
    states = np.zeros((4, 13))
    ground.read(np.arange(4), states)
    assert np.isnan(states).all()


def test_a_ground_without_a_plugin_is_refused() -> None:
    for number in (-1, 10**6):
        with pytest.raises(RuntimeError):
            _core.Ground(number)


def test_tiles_are_grids(ground: Any) -> None:
    for wrong in ([None], [1], [np.zeros(3)], np.zeros(3), None):
        with pytest.raises((*REFUSED, RuntimeError)):
            ground.set_tiles(wrong)


@pytest.mark.parametrize("how", [how for how in SPOILT if how != "None"])
def test_friction_that_does_not_fit_is_refused(how: str) -> None:
    grid = _core.Grid(**arrays())
    with pytest.raises((ValueError, TypeError)):
        grid.set_friction(SPOILT[how](np.ones((70, 130), np.float32)), 1.0)


@pytest.mark.parametrize("value", [-1.0, math.nan, math.inf])
def test_impossible_uniform_friction_is_refused(value: float) -> None:
    with pytest.raises(ValueError, match="zero or more"):
        _core.Grid(**arrays()).set_friction(None, value)
