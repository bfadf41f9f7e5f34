"""Rows on invariants: replays, edits, memory, rest."""

import math
import resource
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from smartmesh_ros import Box, InputError, Sphere
from studies.matrix.arena import Arena, Method, Row

HILLS = {"kind": "sinusoid", "amplitude": 0.3, "wavelength": 4.0}


def edits_as_rebuilt(method: Method) -> float:
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
        arena.settle(0.25)
        found = arena.positions()
    with Arena(method, HILLS) as fresh:
        fresh.scatter(9, Sphere(0.2), 5.0, 0.3)
        fresh.heightmap.replace(heights, time=0.0)
        fresh.world.time = 10.0
        fresh.settle(0.25)
        return 1e3 * float(np.linalg.norm(found - fresh.positions(), axis=1).max())


def raised_above_all(method: Method) -> float:
    """Error [mm] of the rest height on ground 5 m above all that was seen before."""
    with Arena(method, size=21) as arena:
        arena.rest_of(Sphere(0.2), (0.013, 0.017, 0.2), 0.25)
        heights = np.full((21, 21), 5.0)
        heights[10, 10] = 4.0  # the nearest sample: all others are above it, and above what was there at first
        arena.heightmap.replace(heights, time=20.0)
        arena.world.time = 21.0
        arena.world.client.resetBasePositionAndOrientation(
            arena.world.bodies["body"].uid, (0.62, 0.63, 5.25), (0, 0, 0, 1)
        )
        arena.settle(0.5)
        return 1e3 * abs(float(arena.positions()[0, 2]) - 5.2)


def tunnels(method: Method) -> float:
    """Bodies lost of 40 balls of 20 mm that strike ripples at 2 to 40 m/s."""
    with Arena(method, {"kind": "sinusoid", "amplitude": 0.05, "wavelength": 2.0}, size=81, resolution=0.1) as arena:
        places = np.random.default_rng(2).uniform(-3.0, 3.0, (40, 2)).tolist()
        for index, (x, y) in enumerate(places):
            speed = 2.0 + 38.0 * index / 39.0
            arena.spawn(f"ball_{index}", Sphere(0.02), (x, y, 0.5), linear=(0.0, 0.0, -speed))
        arena.settle(1.0)
        return float(len(arena.lost()))


def doubled_patch(method: Method) -> float:
    """Change [%] of the mean force on a box at rest on ripples when its patch is twice as wide."""
    assert method is not None
    forces = []
    for rings in (2, 4):
        with Arena(replace(method, rings=rings), {"kind": "sinusoid", "amplitude": 0.02, "wavelength": 2.0}) as arena:
            arena.rest_of(Box(0.4, 0.3, 0.2), (0.25, 0.25, 0.15))
            each = []
            for _ in arena.run(0.5):
                contacts = arena.world.contacts()
                each.append(sum(contact.normal_force * abs(contact.normal[2]) for contact in contacts))
            forces.append(float(np.mean(each)))
    return 100.0 * abs(forces[1] / forces[0] - 1.0)


def bad_input(method: Method) -> float:
    """How far [mm] a ball moves while maps of wrong size, with infinities and beyond the rim come; infinite where one
    is taken."""
    with Arena(method) as arena:
        before = arena.rest_of(Sphere(0.2), (0.013, 0.017, 0.2))
        beyond = partial(arena.heightmap.update_region, 55, 0, np.ones((9, 9)), time=arena.world.time)
        for take in (partial(arena.tell, np.zeros((60, 61))), partial(arena.tell, np.full((61, 61), np.inf)), beyond):
            try:
                take()
            except InputError:
                arena.settle(0.1)
            else:
                return math.inf
        return 1e3 * math.dist(before, arena.positions()[0])


def leaks(method: Method) -> float:
    """Memory that stays for every collider changed [bytes], over 4,000 changes once all colliders are made."""

    def resident() -> float:
        return float(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize()

    with Arena(method, {"kind": "waves"}, size=21, map_rate=240.0) as arena:
        arena.scatter(16, Sphere(0.2), 1.5, 0.3)
        arena.settle(300 / 240.0)
        before = resident()
        arena.settle(250 / 240.0)
        return (resident() - before) / 4000.0


def replays(method: Method) -> float:
    """Largest difference [mm] between two runs of a second with the same inputs."""
    found = []
    for _ in range(2):
        with Arena(method, {"kind": "waves"}, size=41, map_rate=60.0) as arena:
            arena.scatter(12, Box(0.3, 0.25, 0.2), 2.5, 0.4)
            arena.settle(1.0)
            found.append(arena.positions())
    return 1e3 * float(np.linalg.norm(found[0] - found[1], axis=1).max())


def neighbours(method: Method) -> float:
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


def stack(method: Method) -> float:
    """How far [mm] the top of a stack of five boxes is from its place after 3 s."""
    with Arena(method) as arena:
        for index in range(5):
            arena.spawn(f"box_{index}", Box(0.3, 0.3, 0.3), (0.013, 0.017, 0.15 + 0.3 * index))
        arena.settle(3.0)
        return 1e3 * math.dist(arena.positions()[-1], (0.013, 0.017, 1.35))


def rests(method: Method) -> float:
    """How far [mm] a box at rest on a bump drifts in 5 s."""
    with Arena(method, {"kind": "noise", "deviation": 0.01}) as arena:
        arena.spawn("box", Box(0.6, 0.5, 0.3), (0.013, 0.017, 0.2))
        return arena.drift(2.0, 5.0)


_WHOLE = ("whole trimesh", "whole heightfield")
ROWS = (
    Row("T3 edits as rebuilt", edits_as_rebuilt, 2.0, "mm", "equal"),
    Row("T4 raised above all before", raised_above_all, 1.0, "mm", "rest height", quick=True),
    Row("T6 20 mm balls at 2-40 m/s", tunnels, 0.0, "lost", "none lost", quick=True),
    Row("T10 patch twice as wide", doubled_patch, 1.0, "%", "the same force", skip=("defaults", *_WHOLE)),
    Row("T11 bad input", bad_input, 0.1, "mm", "refused, nothing moves", quick=True),
    Row("T12 memory", leaks, 100.0, "B/change", "flat"),
    Row("T13 replay", replays, 0.0, "mm", "equal"),
    Row("overlapping patches", neighbours, 0.5, "mm", "as alone"),
    Row("stack of five boxes", stack, 5.0, "mm", "stands for 3 s", quick=True),
    Row("drift at rest", rests, 1.0, "mm", "nothing moves, 5 s"),
)
