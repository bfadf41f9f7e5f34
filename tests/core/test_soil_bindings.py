"""No argument makes the soil of the core read or write outside an array: what it cannot take, it refuses."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from smartmesh_ros.core import CORE, as_bytes
from smartmesh_ros.patches.shapes import box
from smartmesh_ros.soil.config import SoilConfig
from smartmesh_ros.soil.layer import LAYER_SAMPLE
from smartmesh_ros.soil.soil import FOOT, NOWHERE, with_room
from tests.core.test_bindings import REFUSED, SPOILT, arrays

SHAPE = (70, 130)
SPACING = 0.1


def soil_arguments() -> dict[str, np.ndarray]:
    return {
        "samples": np.zeros((*SHAPE, LAYER_SAMPLE.itemsize), np.uint8),
        "kinds": np.zeros(SHAPE, np.uint8),
        "soils": np.array([[1e6, 0.0, 1.0, 0.0, 0.5, 0.01, 2e8, 3e4]]),
    }


def feet() -> Any:
    found = with_room(np.zeros(0, FOOT), 2)
    for row, place in enumerate(((3.0, 2.0), (9.0, 4.0))):
        found["shape"][row] = box((0.4, 0.4, 0.4)).record
        found["state"][row] = (*place, 0.2, 0.0, 0.0, 0.0, 1.0, *(0.0,) * 6)
    found["force"] = 100.0
    return found


def update_arguments(some: Any) -> dict[str, Any]:
    grid = CORE.Grid(**arrays(*SHAPE))
    grid.place(0.0, 0.0, 0.0, 0.0, SPACING)
    grid.set_motion(1, 25.0, 0.2, 0.0, 0.0)
    records = some.view(np.uint8).reshape(-1, FOOT.itemsize)
    return {"grid": grid, "feet": records, "time": 0.0, "dt": 0.01, "number": 1, "config": SoilConfig()}


@pytest.mark.parametrize("how", SPOILT)
@pytest.mark.parametrize("name", ("samples", "kinds", "soils"))
def test_a_soil_refuses_arrays_that_do_not_fit(name: str, how: str) -> None:
    given = soil_arguments()
    if (name, how) in (("soils", "reversed"), ("soils", "Fortran order")):
        return  # one row is the same either way
    if (name, how) == ("kinds", "misaligned"):
        return  # bytes lie anywhere
    given[name] = SPOILT[how](given[name])
    with pytest.raises(REFUSED):
        CORE.Soil(**given)


def test_a_soil_refuses_samples_that_it_may_not_write() -> None:
    given = soil_arguments()
    given["samples"].setflags(write=False)
    with pytest.raises(REFUSED):
        CORE.Soil(**given)


def test_two_feet_press_the_soil() -> None:
    some, soil = feet(), CORE.Soil(**soil_arguments())
    rectangles, heights, velocities = soil.update(**update_arguments(some))
    assert len(rectangles) == 2
    sizes = (rectangles[:, 2] - rectangles[:, 0] + 1) * (rectangles[:, 3] - rectangles[:, 1] + 1)
    assert sizes.sum() == len(heights) == len(velocities)
    assert (velocities < 0.0).any()
    assert (some["sinkage"] > 0.0).all()


@pytest.mark.parametrize("how", sorted(set(SPOILT) - {"one row fewer", "empty"}))
def test_an_update_refuses_feet_that_do_not_fit(how: str) -> None:
    given = update_arguments(feet())
    given["feet"] = SPOILT[how](given["feet"])
    with pytest.raises(REFUSED):
        CORE.Soil(**soil_arguments()).update(**given)


def test_an_update_refuses_feet_that_it_may_not_write() -> None:
    given = update_arguments(feet())
    given["feet"].setflags(write=False)
    with pytest.raises(REFUSED):
        CORE.Soil(**soil_arguments()).update(**given)


@pytest.mark.parametrize(
    ("name", "value"),
    [("grid", None), ("time", np.nan), ("dt", 0.0), ("dt", np.nan), ("dt", -1.0), ("number", 2**31), ("config", None)],
)
def test_an_update_refuses_what_is_no_instant(name: str, value: Any) -> None:
    with pytest.raises((*REFUSED, AttributeError)):
        CORE.Soil(**soil_arguments()).update(**(update_arguments(feet()) | {name: value}))


@pytest.mark.parametrize(
    ("name", "value"), [("rim", -1), ("slides", 10**9), ("flow", np.nan), ("repose", np.inf), ("still", "a")]
)
def test_an_update_refuses_settings_out_of_their_range(name: str, value: Any) -> None:
    config = SimpleNamespace(**(vars(SoilConfig()) | {name: value}))
    with pytest.raises((*REFUSED, RuntimeError)):
        CORE.Soil(**soil_arguments()).update(**(update_arguments(feet()) | {"config": config}))


def test_an_update_refuses_a_map_of_another_size() -> None:
    given = update_arguments(feet()) | {"grid": CORE.Grid(**arrays(69, 130))}
    with pytest.raises(REFUSED):
        CORE.Soil(**soil_arguments()).update(**given)


@pytest.mark.parametrize("kind", (0, 5, 6, -1, 2**62, -(2**63)))
def test_an_update_refuses_shapes_that_it_does_not_know(kind: int) -> None:
    some = feet()
    some["shape"]["kind"][1] = kind
    with pytest.raises(REFUSED):
        CORE.Soil(**soil_arguments()).update(**update_arguments(some))


@pytest.mark.parametrize(
    "seen",
    (
        (-1, 0, 5, 5), (0, -1, 5, 5), (0, 0, 70, 5), (0, 0, 5, 130), (5, 5, 4, 5), (NOWHERE, 0, 5, 5),
        (NOWHERE, NOWHERE, 5, -1), (-(2**31), -(2**31), 2**31 - 1, 2**31 - 1),
    ),
)  # fmt: skip
def test_an_update_refuses_samples_that_are_not_there(seen: tuple[int, int, int, int]) -> None:
    some = feet()
    some["seen"][1] = seen
    with pytest.raises(REFUSED):
        CORE.Soil(**soil_arguments()).update(**update_arguments(some))


def numbers_of(some: Any, field: str) -> Any:
    """A view of a field of the feet (2, n), or of their shapes."""
    table = some if field in (FOOT.names or ()) else some["shape"]
    return table[field][:, None] if table[field].ndim == 1 else table[field]


@pytest.mark.parametrize("kind", (1, 2, 3, 4))
@pytest.mark.parametrize("value", (np.nan, np.inf, -np.inf, 1e300, -1e300, 1e-300, 0.0))
@pytest.mark.parametrize(
    "field",
    ("half", "rounding", "offset", "turn", "state", "force", "place", "load", "centre_of_load", "seat", "slope"),
)
def test_any_numbers_of_feet_do_no_harm(field: str, value: float, kind: int) -> None:
    """Bodies that are beside the map, huge, or thrown to infinity."""
    soil = CORE.Soil(**soil_arguments())
    for column in range(numbers_of(feet(), field).shape[1]):
        some = feet()
        some["shape"]["kind"] = kind
        numbers_of(some, field)[0, column] = value
        soil.update(**update_arguments(some))
    some["force"] = 0.0
    soil.update(**update_arguments(some))


def test_kinds_of_soils_that_are_not_there_count_as_the_last() -> None:
    given = soil_arguments()
    given["kinds"][:] = 255
    some = feet()
    CORE.Soil(**given).update(**update_arguments(some))
    assert (some["sinkage"] > 0.0).all()


@pytest.mark.parametrize("how", SPOILT)
@pytest.mark.parametrize("name", ("record", "points"))
def test_a_shape_refuses_arrays_that_do_not_fit(name: str, how: str) -> None:
    given = {"record": as_bytes(box((0.2, 0.2, 0.2)).record.reshape(1)), "points": np.zeros((5, 2)), "spacing": 0.1}
    if (name == "points" and how in ("one row fewer", "empty")) or (name == "record" and how == "reversed"):
        return  # fewer points are points, and one row is the same either way
    given[name] = SPOILT[how](given[name])
    with pytest.raises(REFUSED):
        CORE.shape_above_grid(**given)


@pytest.mark.parametrize("kind", (-1, 0, 5, 2**31 - 1))
def test_a_shape_has_one_of_four_kinds(kind: int) -> None:
    record = box((0.2, 0.2, 0.2)).record.reshape(1)
    record["kind"] = kind
    with pytest.raises(REFUSED):
        CORE.shape_above_grid(as_bytes(record), np.zeros((1, 2)), 0.1)
