"""The quick form of ``make fuzz``."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from rclpy.serialization import deserialize_message, serialize_message

from smartmesh_ros import InputError
from smartmesh_ros.io.rasters import RasterConfig
from smartmesh_ros.node.inputs.adapters import ADAPTERS, occupancy_region
from smartmesh_ros.tools.testing import heightmap_message
from tests.fuzz.mutations import mutated, spoil
from tests.fuzz.run import SETTINGS, attack
from tests.fuzz.seeds import make
from tests.fuzz.target import target
from tests.fuzz.wire import over_the_wire
from tests.node.test_refusals import changed


@pytest.mark.parametrize(("terrain_input", "changes"), SETTINGS[: len(ADAPTERS) + 2])
def test_spoilt_messages(terrain_input: str, changes: str) -> None:
    result = attack(terrain_input, changes, 250, seed=11)
    assert sum(result["counts"].values()) == 250
    assert result["compared"]["vertices"] > 1000
    assert sum(result["reasons"].values()) > 50


# A cast of a signalling NaN, which is a hole like any other, is all that may be warned of.
@pytest.mark.filterwarnings("ignore:invalid value encountered in cast:RuntimeWarning")
@pytest.mark.filterwarnings("error::RuntimeWarning")
@pytest.mark.parametrize("scale", [1.0, -2.0, 0.0, 1e30])
@pytest.mark.parametrize("name", [*ADAPTERS, "occupancy_grid_update"])
def test_any_raster_gives_a_surface_of_its_size_or_is_refused(name: str, scale: float) -> None:
    rng = np.random.default_rng(14)
    convert: Callable[..., Any] = ADAPTERS[name][1] if name in ADAPTERS else occupancy_region
    made = [make(name, rng) for _ in range(20)]
    good, converted = [bytes(serialize_message(message)) for message in made], 0
    for number in range(1000):
        data = good[number % 20]
        try:
            message = deserialize_message(data if number % 2 else mutated(data, good, rng), type(made[0]))
            if number % 2:
                spoil(message, rng)
        except Exception:  # noqa: BLE001  # raised by rclpy; the node refuses it as malformed
            continue
        try:
            first, second, *rest = convert(message, RasterConfig(scale=scale, offset=0.5))
        except InputError as error:
            assert error.reason and str(error)
            continue
        converted += 1
        if name in ADAPTERS:
            assert second.shape == (first.rows, first.columns)
            assert second.dtype == np.float32 and second.size <= 1000 and not np.isinf(second).any()
        else:
            assert (first, second, *rest[0].shape) == (message.y, message.x, message.height, message.width)
    assert converted > 100


def test_spoilt_messages_over_the_wire(domain: int) -> None:
    assert over_the_wire(400, seed=13)["over DDS, refused"] > 50


def good(name: str, **changes: Any) -> tuple[str, Any]:
    """An input and a good message of it, but for changes as of `changed`. Of tracked bodies there are two."""
    return name, changed(make(name, np.random.default_rng(1)), **changes)


def a_map(**changes: Any) -> tuple[str, Any]:
    return "heightmap", changed(heightmap_message(np.zeros((3, 3)), tile="abcd"), **changes)


# Messages that once ended a node or did harm: what is given, and how many of the last input are refused.
FAULTS: dict[str, tuple[list[tuple[str, Any]], int]] = {
    "a general mesh beside a map has no rows and columns for a body that changes tiles": (
        [good(name) for name in ("spawn_body", "tracked_bodies", "heightmap", "terrain_mesh", "tracked_bodies")], 0),
    "a spin that cannot be simulated": ([good("spawn_body", twist__angular__z=spin) for spin in (1e200, 1e6)], 2),
    "a map at the end of the world: how many cells it moved by cannot be counted": (
        [a_map(), a_map(info__resolution=1e-30, info__origin__position__x=1e300)], 1),
    # Read by C it is a short name, by Python a long one: a map of one tile would have become that of another.
    "a name with a zero byte": ([("heightmap", serialize_message(a_map()[1]).replace(b"abcd", b"a\0cd"))], 1),
    "one impossible body refuses all of its message": (
        [good("tracked_bodies", bodies__1__radius=1e30), good("tracked_bodies", bodies__1__pose__position__x=1e12)], 2),
}  # fmt: skip


@pytest.mark.parametrize(("given", "refused"), FAULTS.values(), ids=FAULTS)
def test_messages_that_once_did_harm(given: list[tuple[str, Any]], refused: int) -> None:
    with target() as fire:
        for name, message in given:
            fire.give(name, message if isinstance(message, bytes) else serialize_message(message))
        world = fire.node.session.world
        assert fire.counts[f"{name}: refused"] == refused
        assert not refused or (len(world.bodies), len(world.terrain.tiles)) == (0, len(given) - refused)
