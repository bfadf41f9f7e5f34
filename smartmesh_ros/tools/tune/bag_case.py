"""A recorded bag as a case, and its true ground.

If changes of height are motion, the true ground is interpolated between the map before and the map after an instant. If
changes are corrections, the true ground is the node's main mesh, which applies corrections over ``terrain.settle``.
"""

from __future__ import annotations

import hashlib
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from smartmesh_ros.errors import InputError
from smartmesh_ros.ground.shapes import Sphere
from smartmesh_ros.io.rasters import Raster
from smartmesh_ros.node.parameters.settings import RobotConfig, Settings
from smartmesh_ros.node.services.initial_bodies import Entry, entry_from_text, spawn
from smartmesh_ros.node.services.robot_files import with_package_paths
from smartmesh_ros.terrain.terrain import Terrain
from smartmesh_ros.tools.evaluation.distance import Surface
from smartmesh_ros.tools.tune.case import LONGER, Case, Span, Truth
from smartmesh_ros.tools.tune.recording import HEIGHTMAP_UPDATE, Bag, Recording
from smartmesh_ros.tools.tune.replay import BodiesCame, Change, MapCame, RegionCame, change_terrain
from smartmesh_ros.tools.tune.start import NODE, settings_of


@dataclass(frozen=True, kw_only=True)
class BagLimits:
    """How much of a bag is replayed.

    ``search`` [s]: maximum length of a searching run, which is also at most half of the bag. ``balls``: maximum number
    of test balls beside tracked bodies. ``truth_rate`` [Hz]: rate of the reference's maps. ``shortest`` [s]: minimum
    length of a bag.
    """

    search: float = 3.0
    balls: int = 8
    truth_rate: float = 240.0
    shortest: float = 0.1


LIMITS = BagLimits()


def bag_case(bag: Bag, start: Mapping[str, Any], terrain_topic: str = "", seconds: float | None = None) -> Case:
    """Return a bag as it was recorded; raise `InputError` with the bag's contents if it cannot be replayed."""
    settings = settings_of(start)
    longest = LIMITS.search if seconds is None else seconds
    recording = Recording(bag, settings, terrain_topic, LONGER * longest)
    _require_enough(bag, recording)
    search = min(longest, 0.5 * recording.length)
    span = Span(search=search, confirm=min(recording.length, LONGER * search), settle=min(0.5, 0.25 * search))
    entries = _entries(settings)
    balls = [] if entries else _test_balls(recording, settings)
    if not entries and not balls:
        raise bag.refusal(
            "bodies", "there are no bodies: neither tracked ones in the bag, nor bodies.spawn or robot.description "
            "in the parameter file; see config/bodies.yaml"
        )  # fmt: skip
    name = bag.path.resolve().name
    known = f"{sorted(start.items())} {span} {terrain_topic} {bag.metadata}"
    return Case(
        name=name, title=f"the bag {name}", identity=hashlib.sha256(known.encode()).hexdigest()[:12],
        start=dict(start), span=span, bodies=[partial(spawn, entry=entry) for entry in entries + balls],
        events=lambda: iter(recording.events), truth=lambda: recorded_ground(recording.changes, settings),
        finest=0.0 if settings.motion.corrects else LIMITS.truth_rate, notes=_notes(recording, balls),
        sources=_sources(bag, recording, settings),
    )  # fmt: skip


def _entries(settings: Settings) -> list[Entry]:
    """Return the bodies and the robot that the parameters spawn."""
    entries = [entry_from_text(text) for text in settings.spawn]
    robot: RobotConfig = settings.robot
    if robot.description:
        entries.append(Entry(robot.name, urdf=robot.description, xy=robot.xy, above=robot.above, yaw=robot.yaw))
    return [replace(entry, urdf=with_package_paths(entry.urdf)) if entry.urdf else entry for entry in entries]


def _test_balls(recording: Recording, settings: Settings) -> list[Entry]:
    """Return balls of the tracked bodies' size on both sides of their paths, apart from all paths and each other: a
    dictated pose does not depend on a patch."""
    paths: dict[str, list[tuple[float, float]]] = {}
    radii: dict[str, float] = {}
    for event in recording.events:
        for body in event.bodies if isinstance(event, BodiesCame) else ():
            paths.setdefault(body.name, []).append(body.state.position[:2])
            radii[body.name] = body.radius or settings.default_radius
    taken = [place for path in paths.values() for place in path]
    entries: list[Entry] = []
    for name, radius in radii.items():
        apart = 1.2 * (radius + max(radii.values()))
        for x, y in paths[name][:: max(1, len(paths[name]) // LIMITS.balls)]:
            for dx, dy in ((0.0, 1.1), (0.0, -1.1), (1.1, 0.0), (-1.1, 0.0)):
                place = (x + dx * apart, y + dy * apart)
                if len(entries) < LIMITS.balls and np.hypot(*(np.array(taken) - place).T).min() >= apart:
                    taken.append(place)
                    ball = f"test_ball_{len(entries)}"
                    entries.append(Entry(ball, Sphere(radius), 1.0, xy=place, above=1.2 * radius))
    return entries


def _sources(bag: Bag, recording: Recording, settings: Settings) -> list[str]:
    """Return a sentence on each topic of the replayed maps, and on the node's input topic for it."""
    found = []
    for name in sorted(recording.map_topics):
        kind, _ = bag.topics[name]
        own = "~/heightmap_update" if kind == HEIGHTMAP_UPDATE else f"~/{settings.input}"
        remap = "" if name == own.replace("~", NODE) else f": start it with -r {own}:={name}"
        found.append(f"Maps: {name} ({kind}), which the node takes on {own}{remap}.")
    return found


def _notes(recording: Recording, balls: Sequence[Entry]) -> list[str]:
    notes = [f"Refused {count} times, as the node would: {words}" for words, count in recording.refused.most_common(5)]
    if balls:
        notes.append(
            f"The parameters name no simulated body: {len(balls)} test balls of the tracked bodies' size stand beside "
            "their paths. The cost includes these balls."
        )
    return notes


def _require_enough(bag: Bag, recording: Recording) -> None:
    """Raise `InputError` if the bag lacks maps, transforms or length."""
    refused = "; ".join(words for words, _ in recording.refused.most_common(3))
    frames = ", ".join(recording.frames) or "none"
    if not recording.changes:
        raise bag.refusal("maps", f"no map of the bag can be taken: {refused or 'it has none'}; frames: {frames}")
    refused_bodies = [
        words for words in recording.refused if "no transform" in words or "not at the requested" in words
    ]
    tracked = any(isinstance(event, BodiesCame) for event in recording.events)
    if refused_bodies and not tracked:
        raise bag.refusal("frame", f"bodies are in other frames than the maps, and the bag's /tf does not lead there: "
                          f"{refused_bodies[0]}; frames: {frames}")  # fmt: skip
    if recording.length < LIMITS.shortest:
        raise bag.refusal(
            "length", f"{len(recording.events)} messages within {recording.length:.3g} s that can be replayed; record "
            f"at least {LIMITS.shortest:g} s of maps and bodies"
        )  # fmt: skip


def recorded_ground(changes: Sequence[Change], settings: Settings) -> Truth:
    """Return the true ground of a recording's changes."""
    if settings.motion.corrects:
        return _corrected(changes, settings)
    of_tiles: dict[str, list[Change]] = defaultdict(list)
    for change in sorted(changes, key=lambda change: change.at):
        of_tiles[change.tile].append(change)
    tiles = {name: _Moving(of_tile) for name, of_tile in of_tiles.items()}
    return lambda time: {name: now for name, tile in tiles.items() if (now := tile.at(time)) is not None}


class _Moving:
    """One tile, interpolated between the map before and the map after an instant."""

    def __init__(self, changes: Sequence[Change]) -> None:
        self._states = _states(changes)
        # A time [s], and the tile from then on; None = it is removed.
        self._before: tuple[float, Raster | None] = 0.0, None
        self._after: tuple[float, Raster | None] | None = next(self._states)

    def at(self, time: float) -> Surface | None:
        while self._after is not None and self._after[0] <= time:
            self._before, self._after = self._after, next(self._states, None)
        (begin, before), (end, after) = self._before, self._after or (0.0, None)
        if before is None:
            return None
        heights = before.heights
        if after is not None and after.geometry == before.geometry:
            heights = heights + np.float32((time - begin) / (end - begin)) * (after.heights - heights)
        return Surface(before.geometry, heights.astype(np.float64))


def _states(changes: Sequence[Change]) -> Iterator[tuple[float, Raster | None]]:
    """Yield a tile after each of its changes."""
    raster: Raster | None = None
    for change in changes:
        if isinstance(change, MapCame):
            raster = change.raster
        elif isinstance(change, RegionCame) and raster is not None:
            heights = raster.heights.copy()
            rows, columns = change.heights.shape
            part = heights[change.row : change.row + rows, change.column : change.column + columns]
            if part.shape == change.heights.shape:  # else the node refuses it
                part[...] = change.heights
            raster = raster._replace(heights=heights)
        yield change.at, raster


def _corrected(changes: Sequence[Change], settings: Settings) -> Truth:
    """Return ground at rest, as the node estimates it."""
    waiting = sorted(changes, key=lambda change: change.arrives, reverse=True)
    terrain = Terrain()
    tiles: dict[str, Any] = terrain.tiles  # height maps

    def show(time: float) -> None:
        for tile in tiles.values():
            tile.show(time)

    def at(time: float) -> dict[str, Surface]:
        while waiting and waiting[-1].arrives <= time:
            change = waiting.pop()
            show(change.arrives)
            with suppress(InputError):  # what the node refuses leaves its ground as it was
                change_terrain(terrain, settings, change)
        show(time)
        return {name: _surface(tile, time) for name, tile in tiles.items()}

    return at


def _surface(tile: Any, time: float) -> Surface:
    geometry = tile.geometry
    indices = np.arange(geometry.size).reshape(geometry.rows, geometry.columns)
    return Surface(geometry, tile.sample(indices, time).heights - geometry.origin[2])
