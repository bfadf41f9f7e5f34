"""The quick form of ``make fuzz``."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from rclpy.serialization import deserialize_message, serialize_message

from smartmesh_ros import InputError
from smartmesh_ros.io.rasters import RasterConfig
from smartmesh_ros.node.inputs.adapters import ADAPTERS, occupancy_region
from smartmesh_ros.tools.testing import Probe, heightmap_message, pose_message
from tests.fuzz.mutations import mutated
from tests.fuzz.run import INPUTS, attack, attack_with_examples
from tests.fuzz.seeds import make
from tests.fuzz.target import Target
from tests.fuzz.wire import bombard


@pytest.fixture
def target() -> Iterator[Target]:
    with Target() as made:
        yield made


@pytest.mark.parametrize(
    ("terrain_input", "changes"), [*((name, "motion") for name in INPUTS), ("heightmap", "correction")]
)
def test_spoilt_messages(terrain_input: str, changes: str) -> None:
    result = attack(terrain_input, 250, seed=11, changes=changes)
    assert sum(result["counts"].values()) == 250
    assert result["vertices"] > 1000


def test_messages_made_field_by_field() -> None:
    assert sum(attack_with_examples("image", 200, seed=12)["counts"].values()) >= 200


# A cast of a signalling NaN, which is a hole like any other, is all that may be warned of.
@pytest.mark.filterwarnings("ignore:invalid value encountered in cast:RuntimeWarning")
@pytest.mark.filterwarnings("error::RuntimeWarning")
@pytest.mark.parametrize("scale", [1.0, -2.0, 0.0, 1e30])
@pytest.mark.parametrize("name", [*ADAPTERS, "occupancy_grid_update"])
def test_any_raster_gives_a_surface_of_its_size_or_is_refused(name: str, scale: float) -> None:
    rng = np.random.default_rng(14)
    convert: Callable[..., Any] = ADAPTERS[name].convert if name in ADAPTERS else occupancy_region
    made = [make(name, rng) for _ in range(20)]
    good, converted = [bytes(serialize_message(message)) for message in made], 0
    for _ in range(1000):
        try:
            message = deserialize_message(mutated(good[int(rng.integers(20))], good, rng), type(made[0]))
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


def test_spoilt_messages_over_the_wire(probe: Probe) -> None:
    with probe.running(parameters={"terrain.motion": "hold", "frame_id": "map"}) as process:
        assert bombard(probe, process, 400, np.random.default_rng(13)) > 50


def test_a_general_mesh_beside_a_height_map_does_not_stop_the_loop(target: Target) -> None:
    """A general mesh has no rows and columns for a body that changes tiles."""
    rng = np.random.default_rng(1)
    for name in ("spawn_body", "tracked_bodies", "heightmap", "terrain_mesh", "tracked_bodies"):
        target.give(name, serialize_message(make(name, rng)))


@pytest.mark.parametrize("spin", [1e200, 1e6])
def test_a_spin_that_cannot_be_simulated_is_refused(target: Target, spin: float) -> None:
    request = make("spawn_body", np.random.default_rng(1))
    request.twist.angular.z = spin
    target.give("spawn_body", serialize_message(request))
    assert target.counts["spawn_body: refused"] == 1


def test_a_map_at_the_end_of_the_world_is_refused(target: Target) -> None:
    """How many cells it had moved by could not be counted."""
    message = heightmap_message(np.zeros((3, 3)))
    target.give("heightmap", serialize_message(message))
    message.info.origin.position.x = 1e300
    message.info.resolution = 1e-30
    target.give("heightmap", serialize_message(message))
    assert target.counts["heightmap: refused"] == 1


def test_a_name_with_a_zero_byte_is_refused(target: Target) -> None:
    """Read by C it is a short name, by Python a long one: a map of one tile would have become that of another."""
    message = heightmap_message(np.zeros((3, 3)), tile="abcd")
    target.give("heightmap", serialize_message(message).replace(b"abcd", b"a\0cd"))
    assert target.counts["heightmap: refused"] == 1
    assert not target.node.session.world.terrain.tiles


def test_one_impossible_body_refuses_all_of_its_message(target: Target) -> None:
    message = make("tracked_bodies", np.random.default_rng(2))
    message.bodies[-1].radius = 1e30
    target.give("tracked_bodies", serialize_message(message))
    message.bodies[-1].radius = 0.1
    message.bodies[-1].pose = pose_message((1e12, 0.0, 0.0))
    target.give("tracked_bodies", serialize_message(message))
    assert target.counts["tracked_bodies: refused"] == 2
    assert not target.node.session.world.bodies


def test_a_body_that_leaves_everything_is_taken_out_and_named(target: Target) -> None:
    target.give("spawn_body", serialize_message(make("spawn_body", np.random.default_rng(1))))
    [name] = target.node.session.world.bodies
    world = target.node.session.world
    world.client.resetBasePositionAndOrientation(world.bodies[name].uid, (1e9, 0, 0), (0, 0, 0, 1))
    target.node.tick()
    assert not world.bodies
    assert target.node.refusals.counts["physics: lost"] == 1
