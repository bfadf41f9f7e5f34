"""Rows in which something changes at once: holes, maps, kinds, positions; and what must never change."""

from __future__ import annotations

import math
import resource
from dataclasses import replace
from typing import Any

import numpy as np

from smartmesh_ros.errors import InputError
from smartmesh_ros.patches.config import PatchConfig
from smartmesh_ros.physics.shapes import Box, Sphere
from smartmesh_ros.physics.state import BodyState
from smartmesh_ros.studies.matrix.arena import Arena, square
from smartmesh_ros.studies.matrix.row import Row
from smartmesh_ros.studies.measures import GRAVITY, deviation
from smartmesh_ros.terrain.heightmap import HeightMap

HILLS = {"kind": "sinusoid", "amplitude": 0.3, "wavelength": 4.0}


def edits_as_rebuilt(method: PatchConfig) -> float:
    """Largest difference [mm] of how bodies come down on a map after 30 random edits and on the same map made anew."""
    rng = np.random.default_rng(8)
    with Arena(method, HILLS) as arena:
        arena.scatter(9, Sphere(0.2), 5.0, 0.3)
        heights = arena.heightmap.heights.copy()
        for _ in range(30):
            row, column = rng.integers(0, 50, 2).tolist()
            h, w = rng.integers(1, 11, 2).tolist()
            region = (slice(row, row + h), slice(column, column + w))
            heights[region] += rng.uniform(-0.03, 0.03)
            arena.heightmap.update_region(row, column, heights[region], time=arena.world.time)
            arena.settle(2.0 / 240.0)
        arena.settle(1.0)
        arena.world.reset()
        arena.world.time = 10.0  # long after: no motion is left
        arena.settle(0.1)
        found = arena.positions()
    with Arena(method, HILLS) as fresh:
        fresh.scatter(9, Sphere(0.2), 5.0, 0.3)
        fresh.heightmap.replace(heights, time=0.0)
        fresh.world.time = 10.0
        fresh.settle(0.1)
        return 1e3 * float(deviation(found, fresh.positions()).max())


def raised_above_all(method: PatchConfig) -> float:
    """Error [mm] of the rest height on ground 5 m above all that was seen before."""
    with Arena(method, size=21) as arena:
        arena.spawn("ball", Sphere(0.2), (0.013, 0.017, 0.2))
        arena.settle(0.25)
        heights = np.full((21, 21), 5.0)
        heights[10, 10] = 4.0  # the nearest sample: all others are above it, and above what was there at first
        arena.heightmap.replace(heights, time=20.0)
        arena.world.time = 21.0
        arena.world.client.resetBasePositionAndOrientation(
            arena.world.bodies["ball"].uid, (0.62, 0.63, 5.25), (0, 0, 0, 1)
        )
        arena.settle(0.5)
        return 1e3 * abs(float(arena.positions()[0, 2]) - 5.2)


def tunnels(method: PatchConfig) -> float:
    """Bodies lost of 40 balls of 20 mm that strike ripples at 2 to 40 m/s."""
    with Arena(method, {"kind": "sinusoid", "amplitude": 0.05, "wavelength": 2.0}, size=81, resolution=0.1) as arena:
        places = np.random.default_rng(2).uniform(-3.0, 3.0, (40, 2)).tolist()
        for index, (x, y) in enumerate(places):
            speed = 2.0 + 38.0 * index / 39.0
            arena.spawn(f"ball_{index}", Sphere(0.02), (x, y, 0.5), linear=(0.0, 0.0, -speed))
        arena.settle(1.0)
        return float(arena.lost())


def _buried(centre: float) -> Any:
    def figure(method: PatchConfig) -> float:
        """Fastest way up [m/s] of a ball that starts in the ground; infinite where it does not come out in 2 s."""
        with Arena(method, size=21) as arena:
            arena.spawn("ball", Sphere(0.2), (0.013, 0.017, centre))
            fastest = 0.0
            for _ in arena.run(2.0):
                fastest = max(fastest, float(arena.velocities()[0, 2]))
            return fastest if abs(arena.positions()[0, 2] - 0.2) < 5e-3 else math.inf

    return figure


def wakes(method: PatchConfig) -> float:
    """Steps until a box that has rested for 5 s falls when the ground is dug away from under it."""
    with Arena(method) as arena:
        arena.spawn("box", Box(0.3, 0.3, 0.3), (0.013, 0.017, 0.15))
        arena.settle(5.0)
        arena.heightmap.update_region(20, 20, np.full((21, 21), -1.0), time=arena.world.time)
        return _steps_until_falling(arena)


def hole_opens(method: PatchConfig) -> float:
    """Steps until a ball falls when a hole opens under it."""
    with Arena(method) as arena:
        arena.spawn("ball", Sphere(0.2), (0.013, 0.017, 0.2))
        arena.settle(1.0)
        arena.heightmap.update_region(20, 20, np.full((21, 21), np.nan), time=arena.world.time)
        return _steps_until_falling(arena)


def _steps_until_falling(arena: Arena) -> float:
    for step, _ in enumerate(arena.run(1.0)):
        if arena.velocities()[0, 2] < -0.5 * GRAVITY / 240.0:
            return float(step + 1)
    return math.inf


def rim(method: PatchConfig) -> float:
    """Error [mm] of the rest height of a ball beside a hole."""
    with Arena(method) as arena:
        heights = np.zeros((61, 61))
        heights[20:41, 20:41] = np.nan
        arena.heightmap.replace(heights, time=0.0)
        arena.spawn("ball", Sphere(0.1), (-2.85, 0.017, 0.1))
        arena.settle(1.0)
        return 1e3 * abs(float(arena.positions()[0, 2]) - 0.1)


def map_edge(method: PatchConfig) -> float:
    """Error [mm] of the rest height of a ball at the corner of the map."""
    with Arena(method) as arena:
        arena.spawn("ball", Sphere(0.3), (-7.4, -7.4, 0.3))
        arena.settle(1.0)
        return 1e3 * abs(float(arena.positions()[0, 2]) - 0.3)


def doubled_patch(method: PatchConfig) -> float:
    """Change [%] of the mean force on a box at rest on ripples when its patch is twice as wide."""
    forces = []
    for rings in (2, 4):
        with Arena(replace(method, rings=rings), {"kind": "sinusoid", "amplitude": 0.02, "wavelength": 2.0}) as arena:
            arena.spawn("box", Box(0.4, 0.3, 0.2), (0.25, 0.25, 0.15))
            arena.settle(1.0)
            each = []
            for _ in arena.run(0.5):
                points = arena.world.client.getContactPoints()
                each.append(sum(point[9] * abs(point[7][2]) for point in points))
            forces.append(float(np.mean(each)))
    return 100.0 * abs(forces[1] / forces[0] - 1.0)


def bad_input(method: PatchConfig) -> float:
    """How far [mm] a ball moves while maps of wrong size, with infinities and beyond the rim come; infinite where one
    is taken."""
    with Arena(method) as arena:
        arena.spawn("ball", Sphere(0.2), (0.013, 0.017, 0.2))
        arena.settle(1.0)
        before = arena.positions()[0]
        for heights, row in ((np.zeros((60, 61)), None), (np.full((61, 61), np.inf), None), (np.ones((9, 9)), 55)):
            try:
                if row is None:
                    arena.heightmap.replace(heights, time=arena.world.time)
                else:
                    arena.heightmap.update_region(row, 0, heights, time=arena.world.time)
            except InputError:
                arena.settle(0.1)
            else:
                return math.inf
        return 1e3 * math.dist(before, arena.positions()[0])


def leaks(method: PatchConfig) -> float:
    """Memory that stays for every collider changed [bytes], over 4,000 changes after 2,000."""
    with Arena(method, {"kind": "waves"}, size=21, map_rate=240.0) as arena:
        arena.scatter(16, Sphere(0.2), 1.5, 0.3)
        arena.settle(125 / 240.0)
        before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        arena.settle(250 / 240.0)
        return (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) * 1024.0 / 4000.0


def replays(method: PatchConfig) -> float:
    """Largest difference [mm] between two runs of a second with the same inputs."""
    found = []
    for _ in range(2):
        with Arena(method, {"kind": "waves"}, size=41, map_rate=60.0) as arena:
            arena.scatter(12, Box(0.3, 0.25, 0.2), 2.5, 0.4)
            arena.settle(1.0)
            found.append(arena.positions())
    return 1e3 * float(deviation(*found).max())


def teleports(method: PatchConfig) -> float:
    """Deepest penetration [mm] of a ball that is put down somewhere else on hills every 12 steps."""
    rng = np.random.default_rng(4)
    with Arena(method, HILLS) as arena:
        arena.spawn("ball", Sphere(0.2), (0.0, 0.0, 1.0))
        uid = arena.world.bodies["ball"].uid
        worst = 0.0
        for _ in range(40):
            x, y = rng.uniform(-6.0, 6.0, 2).tolist()
            ground = float(arena.heightmap.at([[x, y]], 0.0).heights[0])
            arena.world.client.resetBasePositionAndOrientation(uid, (x, y, ground + 0.23), (0, 0, 0, 1))
            arena.world.client.resetBaseVelocity(uid, (0, 0, 0), (0, 0, 0))
            for _ in arena.run(12 / 240.0):
                worst = max(worst, -float(arena.clearances()[0]))
        return 1e3 * worst


def neighbours(method: PatchConfig) -> float:
    """How far [mm] a box at rest beside another is from where it rests alone."""
    found = []
    for others in (0, 1):
        with Arena(method, HILLS, size=61, resolution=0.1) as arena:
            arena.spawn("box", Box(0.4, 0.4, 0.2), (0.0, 1.0, 0.4))
            if others:
                arena.spawn("other", Box(0.4, 0.4, 0.2), (0.5, 1.0, 0.4))
            arena.settle(1.0)
            found.append(arena.positions()[0])
    return 1e3 * math.dist(*found)


def maps_change(method: PatchConfig) -> float:
    """Largest rise or fall [mm] of a box at rest while maps of other sizes and resolutions replace its own."""
    with Arena(method) as arena:
        arena.spawn("box", Box(0.4, 0.4, 0.2), (0.013, 0.017, 0.1))
        arena.settle(1.0)
        before, worst = arena.positions()[0, 2], 0.0
        for size, resolution in ((101, 0.1), (41, 0.3), (151, 0.05), (31, 0.5)):
            level = HeightMap(np.zeros((size, size)), geometry=square(size, resolution), time=arena.world.time)
            arena.world.terrain.put("", level)
            for _ in range(30):
                arena.world.step()
                worst = max(worst, abs(arena.positions()[0, 2] - before))
        return 1e3 * worst


def kinds_change(method: PatchConfig) -> float:
    """Largest rise or fall [mm] of a box at rest while its collider changes to others and back."""
    with Arena(method) as arena:
        arena.spawn("box", Box(0.4, 0.4, 0.2), (0.013, 0.017, 0.1))
        arena.settle(1.0)
        before, worst = arena.positions()[0, 2], 0.0
        for kind in ("heightfield", None, "trimesh", None, "prisms", None, "auto", None):
            other = method if kind is None else replace(method, kind=kind)
            arena.world.configure(replace(arena.world.config, patch=other))
            for _ in arena.run(20 / 240.0):
                worst = max(worst, abs(arena.positions()[0, 2] - before))
        return 1e3 * worst


def stack(method: PatchConfig) -> float:
    """How far [mm] the top of a stack of five boxes is from its place after 3 s."""
    with Arena(method) as arena:
        for index in range(5):
            arena.spawn(f"box_{index}", Box(0.3, 0.3, 0.3), (0.013, 0.017, 0.15 + 0.3 * index))
        arena.settle(3.0)
        return 1e3 * math.dist(arena.positions()[-1], (0.013, 0.017, 1.35))


def rests(method: PatchConfig) -> float:
    """How far [mm] a box at rest on a bump drifts in 5 s."""
    with Arena(method, {"kind": "noise", "deviation": 0.01}) as arena:
        arena.world.spawn("box", Box(0.6, 0.5, 0.3), 1.0, BodyState((0.013, 0.017, 0.2)))
        arena.shapes["box"] = Box(0.6, 0.5, 0.3)
        arena.settle(2.0)
        before = arena.positions()[0]
        arena.settle(5.0)
        return 1e3 * math.dist(before, arena.positions()[0])


_WHOLE = ("whole trimesh", "whole heightfield")
ROWS = (
    Row(name="T3 edits as rebuilt", figure=edits_as_rebuilt, limit=0.1, unit="mm", source="the same map made anew"),
    Row(
        name="T4 raised above all before",
        figure=raised_above_all,
        limit=1.0,
        unit="mm",
        source="rest height",
        quick=True,
    ),
    Row(name="T6 20 mm balls at 2-40 m/s", figure=tunnels, limit=0.0, unit="lost", source="none lost", quick=True),
    Row(name="T7 buried by half", figure=_buried(0.05), limit=4.0, unit="m/s", source="comes out, at a capped speed"),
    Row(
        name="T7 centre below the ground",
        figure=_buried(-0.1),
        limit=4.0,
        unit="m/s",
        source="comes out, at a capped speed",
        quick=True,
    ),
    Row(name="T9 dug away", figure=wakes, limit=3.0, unit="steps", source="a few steps", quick=True),
    Row(
        name="T10 patch twice as wide", figure=doubled_patch, limit=1.0, unit="%", source="the same force", skip=_WHOLE
    ),
    Row(name="T11 bad input", figure=bad_input, limit=0.1, unit="mm", source="refused, nothing moves", quick=True),
    Row(name="T12 memory", figure=leaks, limit=100.0, unit="B/change", source="flat"),
    Row(name="T13 replay", figure=replays, limit=0.0, unit="mm", source="equal"),
    Row(name="hole opens", figure=hole_opens, limit=3.0, unit="steps", source="a few steps"),
    Row(name="rim of a hole", figure=rim, limit=1.0, unit="mm", source="rest height", skip=("whole trimesh",)),
    Row(name="corner of the map", figure=map_edge, limit=1.0, unit="mm", source="rest height"),
    Row(name="teleporting ball", figure=teleports, limit=10.0, unit="mm", source="half of 0.5 m/s in a step and slop"),
    Row(name="overlapping patches", figure=neighbours, limit=0.5, unit="mm", source="as alone"),
    Row(name="maps change at rest", figure=maps_change, limit=1.0, unit="mm", source="nothing moves", quick=True),
    Row(name="kinds change at rest", figure=kinds_change, limit=1.0, unit="mm", source="nothing moves", quick=True),
    Row(name="stack of five boxes", figure=stack, limit=5.0, unit="mm", source="stands for 3 s", quick=True),
    Row(name="drift at rest", figure=rests, limit=1.0, unit="mm", source="nothing moves, 5 s"),
)
