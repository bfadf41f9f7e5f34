"""A node under fire: every subscription and service of it, called with the bytes that the middleware hands over."""

from __future__ import annotations

import traceback
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from rclpy.parameter import Parameter
from rclpy.serialization import deserialize_message, serialize_message

from smartmesh_ros.node import terrain_collider
from smartmesh_ros.node.inputs.adapters import ADAPTERS
from smartmesh_ros.terrain.heightmap import HeightMap
from tests.fuzz.oracle import maps_of, on_map, require_taken, updates_of
from tests.grounds import patch_of
from tests.node.shared import Fed, fed

BASE = {
    "terrain.motion": "hold",
    "terrain.settle": 0.001,  # less than a step: so corrections are worked off when patches are compared
    "frame_id": "map",
    "bodies.poses": ["p=/pose_in"],
    "bodies.odometry": ["o=/odometry_in"],
    "bodies.frames": ["tool"],
    "bodies.timeout": 5.0,
}
PARAMETERS = ("set_parameters", "set_parameters_atomically")
TERRAIN = ("heightmap", "heightmap_update", "terrain_mesh", "terrain_mesh_update", *ADAPTERS, "occupancy_grid_update")
MOST_BODIES = 8
MOST_STEPS = 20


class FindingError(AssertionError):
    """Something that must not happen, and the message that made it happen."""

    def __init__(self, name: str, data: bytes, error: BaseException) -> None:
        super().__init__(f"{name}, {len(data)} bytes: {type(error).__name__}: {error}")
        self.name, self.data = name, data


class Target:
    """The node, its inputs by name, and counts of what became of the messages."""

    def __init__(self, node: Fed, record: Path | None) -> None:
        self.node, self._answer = node.node, node.call
        self.node.refusals._logger = SimpleNamespace(warning=lambda _: None)
        self.counts: Counter[str] = Counter()
        self.compared: Counter[str] = Counter()
        self.saved: Any = None  # the last state that the node told
        self._record = record
        self._topics = {sub.topic_name.rpartition("/")[2]: sub for sub in self.node.subscriptions}
        services = {srv.srv_name.rpartition("/")[2]: srv for srv in self.node.services}
        services.pop("get_type_description", None)  # served below Python
        self._services = services
        self._base = {name: self.node.get_parameter(name).value for name in terrain_collider.parameters.NAMES}
        self._given = 0

    def result(self) -> dict[str, Any]:
        """What became of the messages, refusals by reason, and what was compared."""
        return {
            "counts": dict(self.counts),
            "reasons": dict(self.node.refusals.counts),
            "compared": dict(self.compared),
        }

    @property
    def inputs(self) -> list[str]:
        """Names of all topics and services."""
        return [*self._topics, *self._services]

    def kind(self, name: str) -> Any:
        """The type of an input's messages or requests."""
        return self._topics[name].msg_type if name in self._topics else self._services[name].srv_type.Request

    def give(self, name: str, data: bytes) -> None:
        """Hands bytes to an input and checks that all is well. Raises `FindingError`."""
        if self._record is not None:
            self._record.write_bytes(name.encode() + b"\n" + data)
        try:
            self._give(name, data)
        except Exception as error:
            raise FindingError(name, data, error) from error

    def _overtaken(self) -> int:
        return sum(count for words, count in self.node.session.counts.items() if words.startswith("overtaken "))

    def _give(self, name: str, data: bytes) -> None:
        terrain, before = self.node.session.world.terrain, self._refused()
        overtaken = self._overtaken()
        updates, maps = updates_of(terrain), maps_of(terrain)
        fate = "taken"
        if name in self._topics:
            self._topics[name].callback(data)
            self._settle()
            if self._refused() > before:
                fate = "refused"
            elif self._overtaken() > overtaken:
                fate = "overtaken"
        else:
            fate = self._call(name, data)
            self._settle()
        self.counts[f"{name}: {fate}"] += 1
        terrain = self.node.session.world.terrain
        if fate == "taken" and name in ("heightmap", "heightmap_update"):
            require_taken(deserialize_message(data, self.kind(name)), terrain, maps)
        assert fate == "taken" or updates_of(terrain) == updates, f"what was {fate} changed the terrain"
        self._given += 1
        if (fate == "taken" and name in TERRAIN) or self._given % 6 == 0:
            self._tick()
        if fate == "taken" and name in PARAMETERS:
            self._restore()
        if self._given % 20 == 0:
            self._tidy()

    def _refused(self) -> int:
        """Messages refused so far, without the bodies that waited for terrain and could not be spawned on it."""
        counts = self.node.refusals.counts
        return sum(count for key, count in counts.items() if not key.startswith("start of "))

    def _call(self, name: str, data: bytes) -> str:
        try:
            request = deserialize_message(data, self.kind(name))
        except Exception:  # noqa: BLE001  # raised by rclpy in the node's loop, which counts it
            return "malformed"
        before = self._refused()
        try:
            response = self._answer(name, request)
        except Exception as error:
            # rclpy's own services raise on parameters of no type; the node's loop catches and counts that.
            places = [Path(frame.filename) for frame in traceback.extract_tb(error.__traceback__)[2:]]
            if places[0].name == "parameter_service.py" and all("smartmesh_ros" not in place.parts for place in places):
                return "raised in rclpy"
            raise
        serialize_message(response)
        failed = [key for key in self.node.refusals.counts if key.endswith(": failed")]
        assert not failed, f"an unexpected error was the answer: {response}"
        success = getattr(response, "success", True)
        if name == "save_state" and success:
            self.saved = response.state
        assert success == (self._refused() == before), "a refusal that was not counted"
        return "taken" if success else "refused"

    def _settle(self) -> None:
        """Finishes what a message or a call has begun, such as the robot of a description."""
        while len(self.node.session.turns):
            self.node.turn()

    def _tick(self) -> None:
        """A turn of the node's loop with everything published, and what must hold after it."""
        self.node.tick()
        world = self.node.session.world
        if any(_correcting(mesh) for mesh in world.terrain.tiles.values()):
            self.node.tick()  # the first one after a pause is at the time of the last before it
        table = world.patches().table()
        for index, tile in enumerate(table.tiles):
            if _correcting(world.terrain.tiles[tile]):
                # Time stood still, or went on by less than corrections take.
                assert self.node.session.paused or self.node.settings.motion.settle >= world.config.physics.dt
            else:
                self.compared.update(on_map(world.terrain.tiles[tile], patch_of(table, index)[0]))
        for name in world.bodies:
            state = world.state(name)
            numbers = (*state.position, *state.orientation, *state.linear, *state.angular)
            assert np.isfinite(numbers).all(), f"{name!r} is at no finite place: {numbers}"
        if self._given % 30 == 0:
            for output in self.node._outputs._outputs.values():
                made = output.make()
                if isinstance(made, bytes):
                    deserialize_message(made, output.publisher.msg_type)

    def _restore(self) -> None:
        """Sets the parameters back, so that the next messages find the node as the first ones did."""
        self.node.set_parameters([Parameter(name, value=value) for name, value in self._base.items()
                                  if self.node.get_parameter(name).value != value])  # fmt: skip

    def _tidy(self) -> None:
        """Forgets stamps, and takes out what has piled up."""
        node, world = self.node, self.node.session.world
        node._forget_stamps()
        if node.session.paused and self._given % 100 == 0:
            node.session.pacer.pause(False)
        for name in list(world.bodies)[:-MOST_BODIES] if len(world.bodies) > MOST_BODIES else []:
            node.session.tracking.forget(name)
            if name in world.bodies:
                world.remove(name)
        for name in [name for name in world.terrain.tiles if name not in ("", "far", "mesh")]:
            world.terrain.remove(name)


@contextmanager
def target(terrain_input: str = "heightmap", record: Path | None = None, changes: str = "motion") -> Iterator[Target]:
    """A node in this process that writes down each message in a file ``record`` before it takes it."""
    values = {**BASE, "terrain.input": terrain_input, "terrain.changes": changes}
    with pytest.MonkeyPatch.context() as patch, fed(values) as node:
        patch.setattr(terrain_collider, "MOST_STEPS", MOST_STEPS)
        yield Target(node, record)


def _correcting(mesh: Any) -> bool:
    """Return True while corrections of a tile are being blended in."""
    return isinstance(mesh, HeightMap) and mesh.motion.corrects and mesh.moving(0.0)
