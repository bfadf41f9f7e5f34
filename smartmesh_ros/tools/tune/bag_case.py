"""A recorded bag as a case."""

from __future__ import annotations

import bisect
import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from smartmesh_ros.ground.shapes import Sphere
from smartmesh_ros.ground.state import Vector
from smartmesh_ros.node.parameters.settings import RobotConfig, Settings
from smartmesh_ros.node.services.robot_files import with_package_paths
from smartmesh_ros.node.services.spawning import Entry, entry_from_text, spawn
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.tools.tune.bag import Bag
from smartmesh_ros.tools.tune.case import SLACK, Case, Ground, MapTopic, Span
from smartmesh_ros.tools.tune.events import BodiesCame, Event, MapCame, Start
from smartmesh_ros.tools.tune.recording import HEIGHTMAP_UPDATE, Reader, Recording
from smartmesh_ros.tools.tune.reference import finest_positions
from smartmesh_ros.tools.tune.start import settings_of
from smartmesh_ros.tools.tune.truth import Truth


@dataclass(frozen=True, kw_only=True)
class BagLimits:
    """How much of a bag is replayed.

    ``search`` [s]: maximum length of a searching run, which is also at most half of the bag. ``longer``: length of the
    confirming run, in searching runs. ``memory`` [bytes]: maximum size of all stored messages. ``balls``: maximum
    number of test balls beside tracked bodies. ``truth_rate`` [Hz]: rate of the reference's maps. ``shortest`` [s]:
    minimum length of a bag.
    """

    search: float = 3.0
    longer: float = 2.0
    memory: float = 4e9
    balls: int = 8
    truth_rate: float = 240.0
    shortest: float = 0.1


LIMITS = BagLimits()


class BagCase(Case):
    """A bag, replayed as it was recorded. Raises `InputError` with the bag's contents if it cannot be replayed."""

    def __init__(
        self, bag: Bag, start: Mapping[str, Any], terrain_topic: str = "", seconds: float | None = None
    ) -> None:
        self.name, self.title = bag.path.resolve().name, f"the bag {bag.path.resolve().name}"
        self.start = dict(start)
        settings = settings_of(start)
        longest = LIMITS.search if seconds is None else seconds
        reader = Reader(bag, settings, terrain_topic, LIMITS.memory)
        self._recording = reader.read(bag.records(), LIMITS.longer * longest)
        _require_enough(bag, self._recording, settings)
        length = self._recording.length
        search = min(longest, 0.5 * length)
        self.span = Span(search=search, confirm=min(length, LIMITS.longer * search), settle=min(0.5, 0.25 * search))
        self._settings = settings
        self._arrivals = [event.arrives for event in self._recording.events]
        self._bodies = _entries(settings)
        balls = [] if self._bodies else _test_balls(self._recording, settings)
        self._bodies += balls
        if not self._bodies:
            raise bag.refusal(
                "bodies", "there are no bodies: neither tracked ones in the bag, nor bodies.spawn or robot.description "
                "in the parameter file; see config/bodies.yaml"
            )  # fmt: skip
        self.notes = _notes(self._recording, balls)
        self.map_topics = _map_topics(bag, self._recording, settings)
        self.identity = self._digest()
        self.fresh()

    def fresh(self) -> None:
        self._truth = Truth(self._recording.maps, self._settings)

    def bodies(self) -> Sequence[Start]:
        return [partial(_start, entry) for entry in self._bodies]

    def events(self, after: float, until: float) -> Sequence[Event]:
        first, last = (bisect.bisect_right(self._arrivals, time + SLACK) for time in (after, until))
        return self._recording.events[first:last]

    def truth(self, time: float) -> Sequence[Ground]:
        return self._truth.at(time)

    def forget(self, before: float) -> None:
        """Do nothing: all events stay in memory."""

    def reference(self) -> dict[str, Vector] | None:
        finest: Case = self if self._settings.motion.corrects else _Finest(self)
        found = finest_positions(finest, self.start, self.span.horizon)
        self.fresh()
        return found

    def true_maps(self) -> tuple[Truth, list[Event]]:
        """Return the true ground, and all events that are no maps."""
        others = [event for event in self._recording.events if event not in set(self._recording.maps)]
        return Truth(self._recording.maps, self._settings), others

    def _digest(self) -> str:
        digest = hashlib.sha256(repr((sorted(self.start.items()), self.span, self._arrivals, self._bodies)).encode())
        for event in self._recording.maps:
            heights = event.heights if not isinstance(event, MapCame) else event.raster and event.raster.heights
            digest.update(b"" if heights is None else np.ascontiguousarray(heights).tobytes())
        return digest.hexdigest()[:12]


class _Finest(Case):
    """A bag whose maps are replaced by the true ground at `BagLimits.truth_rate`."""

    def __init__(self, bag: BagCase) -> None:
        self.name, self.title, self.identity = bag.name, bag.title, bag.identity
        self.start, self.span = bag.start, bag.span
        self._bag = bag
        self.fresh()

    def fresh(self) -> None:
        self._truth, self._others = self._bag.true_maps()
        self._arrivals = [event.arrives for event in self._others]
        self._next = 0

    def bodies(self) -> Sequence[Start]:
        return self._bag.bodies()

    def events(self, after: float, until: float) -> Sequence[Event]:
        found: list[Event] = []
        while self._next / LIMITS.truth_rate <= until + SLACK:
            time = self._next / LIMITS.truth_rate
            self._next += 1
            found += [MapCame(arrives=time, at=time, tile=tile, raster=raster) for tile, raster in self.rasters(time)]
        first, last = (bisect.bisect_right(self._arrivals, time + SLACK) for time in (after, until))
        return found + self._others[first:last]

    def rasters(self, time: float) -> Sequence[tuple[str, Any]]:
        """Return the tiles of the true ground at a time [s]."""
        return list(self._truth.rasters(time))

    def truth(self, time: float) -> Sequence[Ground]:
        return self._truth.at(time)

    def forget(self, before: float) -> None:
        """Do nothing."""

    def reference(self) -> dict[str, Vector] | None:
        return None


def _start(entry: Entry, world: Any) -> bool:
    return spawn(world, entry)


def _entries(settings: Settings) -> list[Entry]:
    """Return the bodies and the robot that the parameters spawn."""
    entries = [entry_from_text(text) for text in settings.spawn]
    robot: RobotConfig = settings.robot
    if robot.description:
        urdf = with_package_paths(robot.description)
        entries.append(Entry(robot.name, urdf=urdf, xy=robot.xy, above=robot.above, yaw=robot.yaw))
    return [replace(entry, urdf=with_package_paths(entry.urdf)) if entry.urdf else entry for entry in entries]


def _test_balls(recording: Recording, settings: Settings) -> list[Entry]:
    """Return balls of the tracked bodies' size beside their paths, because a dictated pose does not depend on a
    patch."""
    ways: dict[str, list[tuple[float, float]]] = {}
    radii: dict[str, float] = {}
    for event in recording.events:
        for body in event.bodies if isinstance(event, BodiesCame) else ():
            ways.setdefault(body.name, []).append(body.state.position[:2])
            radii[body.name] = body.radius or settings.default_radius
    taken = np.array([place for way in ways.values() for place in way])
    widest = max(radii.values(), default=0.0)
    entries: list[Entry] = []
    for name, radius in list(radii.items())[: LIMITS.balls]:
        entries += _beside(name, radius, np.array(ways[name]), taken, 1.2 * (radius + widest))
    return entries[: LIMITS.balls]


def _beside(name: str, radius: float, way: FloatArray, taken: FloatArray, apart: float) -> list[Entry]:
    """Return balls on both sides of a path ``way`` (N, 2) [m], at least ``apart`` [m] from all positions ``taken``
    (M, 2) [m] and from each other."""
    found: list[Entry] = []
    for x, y in way[:: max(1, len(way) // LIMITS.balls)].tolist():
        for dx, dy in ((0.0, 1.1), (0.0, -1.1), (1.1, 0.0), (-1.1, 0.0)):
            place = (x + dx * apart, y + dy * apart)
            others = np.array([*taken.tolist(), *(entry.xy for entry in found)])
            if np.hypot(*(others - place).T).min() >= apart and len(found) < LIMITS.balls:
                number = len(found)
                found.append(Entry(f"test_ball_{name}_{number}", Sphere(radius), 1.0, xy=place, above=1.2 * radius))
    return found


def _map_topics(bag: Bag, recording: Recording, settings: Settings) -> list[MapTopic]:
    """Return the topics of the replayed maps, and the node's input topic for each."""
    found = []
    for topic in bag.topics:
        if topic.name in recording.map_topics:
            is_update = topic.type_name == HEIGHTMAP_UPDATE
            found.append(MapTopic(topic.name, topic.type_name, "heightmap_update" if is_update else settings.input))
    return found


def _notes(recording: Recording, balls: Sequence[Entry]) -> list[str]:
    notes = []
    if balls:
        notes.append(
            f"The parameters name no simulated body: {len(balls)} test balls of the tracked bodies' size stand beside "
            "their paths. The cost includes these balls."
        )
    for words, count in recording.refused.most_common(5):
        notes.append(f"Refused {count} times, as the node would: {words}")
    return notes


def _require_enough(bag: Bag, recording: Recording, settings: Settings) -> None:
    """Raise `InputError` if the bag lacks maps, transforms or length."""
    refused = "; ".join(words for words, _ in recording.refused.most_common(3))
    frames = ", ".join(recording.frames) or "none"
    if not recording.maps:
        raise bag.refusal("maps", f"no map of the bag can be taken: {refused or 'it has none'}; frames: {frames}")
    refused_bodies = [words for words in recording.refused if "no transform" in words or "was asked for" in words]
    tracked = any(isinstance(event, BodiesCame) for event in recording.events)
    if refused_bodies and not tracked:
        raise bag.refusal("frame", f"bodies are in other frames than the maps, and the bag's /tf does not lead there: "
                          f"{refused_bodies[0]}; frames: {frames}")  # fmt: skip
    if recording.length < LIMITS.shortest:
        raise bag.refusal(
            "length", f"{len(recording.events)} messages within {recording.length:.3g} s that can be replayed; record "
            f"at least {LIMITS.shortest:g} s of maps and bodies"
        )  # fmt: skip
