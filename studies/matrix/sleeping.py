"""Rows on sleeping bodies, each beside a world that never sleeps: none is lost, and they end where they do awake."""

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from itertools import product
from operator import methodcaller
from typing import Any

import numpy as np

from smartmesh_ros import BodyState, Box, InputError, JointCommand, MotionConfig, PhysicsConfig, Sphere
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.world.states import SimulatedStates
from studies.matrix.arena import HUSKY, Arena, Method, Row, own_row
from studies.matrix.still_ground import lay_on_slope

RATE, MAPS = 240, 60.0  # steps and maps in a second
SETTLED = 2.0  # time until bodies are asleep [s]
FLAT = np.zeros((41, 41), np.float32)

Build = Callable[[Arena], Any]
# Called before each step after the bodies slept: with the arena and the number of the step.
Event = Callable[[Arena, int], Any]


def small(method: Method, **more: Any) -> Arena:
    """Level ground of 4 m, or what ``more`` settings of an arena make of it."""
    return Arena(method, size=len(FLAT), resolution=0.1, **more)


def play(
    method: Method, build: Build, event: Event, *, sleep: bool, steps: int = 480, **more: Any
) -> list[dict[str, FloatArray]]:
    """Let bodies come to rest on level ground; return the positions [m] of all bodies by name after each of the steps
    of what then happens to them. In a sleeping world all bodies must be asleep before it; raises `InputError` if they
    are not."""
    path = []
    with small(method, physics=PhysicsConfig(sleep=sleep), **more) as arena:
        world = arena.world
        build(arena)
        arena.settle(SETTLED)
        awake = [name for name in world.bodies if not world.is_asleep(name)]
        if sleep and awake:
            raise InputError("method", f"these bodies did not fall asleep: {', '.join(awake)}")
        for step in range(steps):
            event(arena, step)
            world.step()
            path.append({name: np.array(world.state(name).position) for name in world.bodies})
    return path


def astray(build: Build, event: Event, method: Method, of: str = "", **more: Any) -> float:
    """Largest distance [mm] of any body, or ``of`` one, from its place in a world that never sleeps, at the end;
    infinite if one is lost."""
    asleep, awake = (play(method, build, event, sleep=sleep, **more)[-1] for sleep in (True, False))
    if asleep.keys() != awake.keys():
        return math.inf
    return 1e3 * max(math.dist(asleep[name], awake[name]) for name in ([of] if of else awake))


box_alone = methodcaller("spawn", "box", Box(0.2, 0.2, 0.2), (0.5, 0.03, 0.1))


def ball_and_box(arena: Arena) -> None:
    """A ball and a box apart from one another."""
    arena.spawn("ball", Sphere(0.1), (-0.5, 0.02, 0.1))
    box_alone(arena)


def pile(arena: Arena, count: int) -> None:
    """Boxes in columns of five, side by side."""
    for index in range(count):
        column, level = divmod(index, 5)
        x, y = divmod(column, 4)
        arena.spawn(f"box_{index}", Box(0.2, 0.2, 0.2), (0.21 * x, 0.21 * y, 0.1 + 0.2 * level))


def changed_map(change: Callable[[float], Any], *, region: bool = False) -> Event:
    """Maps, or regions in the middle, at the maps' rate: heights [m] by the time since the event began [s]."""

    def event(arena: Arena, step: int) -> None:
        if step % round(RATE / MAPS) == 0:
            heights = change(step / RATE).astype(np.float32)
            if region:
                arena.heightmap.update_region(8, 8, heights[8:33, 8:33], time=arena.world.time)
            else:
                arena.tell(heights)

    return event


def rise(height: float, speed: float, *, region: bool = False) -> Event:
    """Ground that rises by a ``height`` [m] at a ``speed`` [m/s] and stays there."""
    return changed_map(lambda time: FLAT + np.float32(min(speed * (time + 1.0 / MAPS), height)), region=region)


def sunk(height: float) -> Event:
    """The ground under both bodies is at a ``height`` [m] at once, NaN = gone."""
    heights = FLAT.copy()
    heights[12:29, 12:29] = height
    return changed_map(lambda _: heights)


def once(act: Callable[[Arena], None]) -> Event:
    """Do something before the first step."""
    return lambda arena, step: act(arena) if step == 0 else None


def rises(method: Method) -> float:
    """Ground rises by 0.1 to 300 mm at 0.05 to 3 m/s, by maps and by regions: the worst of all."""
    return max(
        astray(ball_and_box, rise(height, speed, region=region), method)
        for height, speed, region in product((1e-4, 1e-3, 0.01, 0.3), (0.05, 3.0), (False, True))
    )


def slide(arena: Arena) -> None:
    """The ground starts to slide at 0.3 m/s, as a belt does."""
    arena.tell(FLAT)
    arena.heightmap.slide((0.3, 0.0), 0.5)


def turn_gravity(arena: Arena) -> None:
    """Gravity tilts so far that both bodies slide."""
    config = arena.world.config
    arena.world.configure(replace(config, physics=replace(config.physics, gravity=(7.0, 0.0, -7.0))))


def bottom_taken(method: Method) -> float:
    """The lowest box of a column of five is removed: error [mm] of the heights that the others come to rest at."""
    ends = play(method, partial(pile, count=5), once(lambda arena: arena.world.remove("box_0")), sleep=True)[-1]
    return 1e3 * float(max(abs(ends[f"box_{level + 1}"][2] - 0.1 - 0.2 * level) for level in range(4)))


def hit(method: Method) -> float:
    """A box is hit by a ball of its mass at 0.5 to 40 m/s, from the side and from above: how much deeper it gets than
    awake."""
    worst = 0.0
    for speed in (0.5, 5.0, 40.0):
        for start, velocity in (((-1.0, 0.03, 0.12), (speed, 0.0, 0.0)), ((0.5, 0.03, 1.0), (0.0, 0.0, -speed))):
            throw = once(methodcaller("spawn", "thrown", Sphere(0.1), start, linear=velocity))
            paths = [play(method, box_alone, throw, sleep=sleep, steps=120) for sleep in (True, False)]
            asleep, awake = (min(place[2] for places in path for place in places.values()) for path in paths)
            worst = max(worst, 1e3 * float(awake - asleep))
    return worst


def spawn_husky(arena: Arena, x: float) -> None:
    """A robot with its brakes on; PyBullet lets it roll on flat ground otherwise."""
    arena.world.spawn_robot("husky", HUSKY, BodyState((x, 0.0, 0.15)))
    drive_husky(arena, 0.0)


def drive_husky(arena: Arena, speed: float) -> None:
    """All of its wheels turn at a ``speed`` [rad/s]."""
    for joint in arena.world.bodies["husky"].joints:
        arena.world.command("husky", joint, JointCommand(velocity=speed))


def robot_and_row(arena: Arena) -> None:
    """A robot before a row of three boxes."""
    spawn_husky(arena, -1.2)
    for index in range(3):
        arena.world.spawn(f"box_{index}", Box(0.3, 0.3, 0.3), 2.0, BodyState((0.4 + 0.31 * index, 0.0, 0.15)))


def guest_comes(method: Method) -> float:
    """A remote ball rolls into the box."""
    with small(None) as other:
        other.spawn("guest", Sphere(0.1), (-0.3, 0.03, 0.1), linear=(2.0, 0.0, 0.0))
        states = SimulatedStates(other.world)
        path = [states.read(), *(states.read() for _ in other.run(119.0 / RATE))]
    return astray(
        box_alone, lambda arena, step: arena.world.guests.take("other", path[step], arena.world.time), method, steps=120
    )


def noise(method: Method) -> float:
    """Share of the time [%] that bodies are awake on maps with noise of 5 mm at 10 Hz that are fused, after the first
    minute of two."""
    rng = np.random.default_rng(7)
    with small(method, motion=MotionConfig(changes="correction", noise=0.005)) as arena:
        for index in range(4):
            arena.spawn(f"box_{index}", Box(0.2, 0.2, 0.2), (0.8 * index - 1.2, 0.03, 0.1))
        ground, awake = arena.world.ground, 0
        for number in range(1200):
            arena.tell(FLAT + rng.normal(0.0, 0.005, FLAT.shape).astype(np.float32))
            steps = arena.run(0.1)
            awake += sum(
                len(ground.followers) - len(ground.contacts.core.find_asleep()) for _ in steps if number >= 600
            )
        return 100.0 * awake / (60 * RATE * len(ground.followers))


def long_on_slope(method: Method) -> float:
    """How far [mm] a box creeps on a slope of 25 degrees in an hour, once it is asleep."""
    with small(method, ground={"kind": "slope", "angle": 25.0}, physics=PhysicsConfig(friction=0.7)) as arena:
        lay_on_slope(arena, Box(0.2, 0.2, 0.2), 0.0, math.radians(25.0))
        arena.settle(SETTLED)
        start = arena.positions()[0]
        arena.world.step(3600 * RATE)
        return 1e3 * math.dist(start, arena.positions()[0])


def rolls_on(method: Method) -> float:
    """Distance [mm] of a ball that rolls down a slope of 0.5 degrees for 3 s from its place in a world that never
    sleeps."""
    ends = []
    for sleep in (True, False):
        physics = PhysicsConfig(sleep=sleep)
        with small(method, ground={"kind": "slope", "angle": -0.5}, physics=physics) as arena:
            height = math.tan(math.radians(0.5)) + 0.1 / math.cos(math.radians(0.5))
            ends.append(arena.rest_of(Sphere(0.1), (-1.0, 0.0, height), 3.0))
    return 1e3 * math.dist(*ends)


SOURCE = "a world that never sleeps"
# Where bodies tumble against one another, two runs differ by centimetres whatever sleeps.
CHAOS = "a world that never sleeps; chaos"


def row(
    name: str, build: Build, event: Event, limit: float = 1.0, source: str = SOURCE, *, quick: bool = True, **more: Any
) -> Row:
    """Return a row on `astray`, with ``more`` settings."""
    return Row(f"sleep: {name}", partial(astray, build, event, **more), limit, "mm", source, quick=quick)


# A ball and a box, a pile, a robot before a row of boxes, and one at rest; where the ground is gone bodies fall as far
# as awake ones.
ROWS = (
    Row("sleep: ground rises", rises, 1.0, "mm", SOURCE),
    row("dug away", ball_and_box, sunk(-0.2)),
    row("a hole", ball_and_box, sunk(math.nan), steps=60),
    row("its tile goes", ball_and_box, once(lambda arena: arena.world.terrain.remove("")), steps=60),
    row("slides", ball_and_box, once(slide), steps=240),
    row("corrected", ball_and_box, changed_map(lambda _: FLAT + 0.05), motion=MotionConfig(changes="correction")),
    Row("sleep: bottom taken", bottom_taken, 1.0, "mm", "geometry", quick=True),
    row("pile of 50", partial(pile, count=50), rise(0.02, 0.1), 5.0, CHAOS, quick=False),
    Row("sleep: hit", hit, 1.0, "mm", SOURCE, quick=True),
    row("robot pushes", robot_and_row, once(partial(drive_husky, speed=5.0)), 50.0, CHAOS, quick=False, of="box_2"),
    row("joint commanded", partial(spawn_husky, x=0.0), once(partial(drive_husky, speed=2.0)), 5.0, CHAOS, steps=240),
    row("gravity turns", ball_and_box, once(turn_gravity), steps=60),
    Row("sleep: guest comes", guest_comes, 5.0, "mm", CHAOS, quick=True),
    own_row("sleep: fused noise", noise, 50.0, "%", "asleep most of the time"),
    own_row("sleep: an hour on 25 degrees", long_on_slope, 0.0, "mm", "Coulomb"),
    Row("sleep: rolls on 0.5 degrees", rolls_on, 0.0, "mm", SOURCE, quick=True),
)
