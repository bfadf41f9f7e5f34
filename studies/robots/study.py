"""``make robots``: robots on rough and moving ground, cost against accuracy, beside other engines."""

import math
from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

from smartmesh_ros import BodyState, JointCommand, PhysicsConfig
from studies.configurations import robot_configurations
from studies.contest import run
from studies.matrix.arena import Arena, square
from studies.pages import save, say, table
from studies.robots.contest import RobotContest
from studies.robots.robot import DATA, HEAVING, STILL, RoughHills, scenes
from studies.tables import Charts

# Descriptions that come with PyBullet.
STRANGERS = {
    "r2d2": DATA / "r2d2.urdf",
    "a1": DATA / "a1" / "a1.urdf",
    "mini_cheetah": DATA / "mini_cheetah" / "mini_cheetah.urdf",
    "minitaur": DATA / "quadruped" / "minitaur.urdf",
}
# Length of a run [s], samples on a side of the map, and their distance [m].
SECONDS, SAMPLES, SPACING = 12.0, 101, 0.04
# The drift is measured over so many periods of the heaving ground, up to the end of the run.
PERIODS = 5
MAP_RATE = 20.0  # [Hz] of the heaving ground


class Stranger(NamedTuple):
    """A robot on rough ground. ``moving``: the ground heaves. ``braked``: its joints are, otherwise they turn freely.
    ``drift`` [m]: horizontal motion of its root link over `PERIODS` periods at the end; NaN = it left the map.
    ``rescues``: by the guard, in the whole run."""

    name: str
    moving: bool
    braked: bool
    drift: float
    rescues: int


def run_stranger(name: str, *, moving: bool, braked: bool) -> Stranger:
    """Run one robot that is spawned on the ground in the middle of the map."""
    ground = RoughHills(square(SAMPLES, SPACING), HEAVING if moving else STILL)
    physics, period = PhysicsConfig(sleep=False), 2.0 * math.pi / HEAVING.frequency
    with Arena(None, ground, map_rate=MAP_RATE if moving else 0.0, physics=physics) as arena:
        world = arena.world
        world.spawn_robot(name, str(STRANGERS[name]), BodyState(), on_ground=True, clearance=0.02)
        for joint in world.bodies[name].joints if braked else ():
            world.command(name, joint, JointCommand(velocity=0.0))
        arena.settle(SECONDS - PERIODS * period)
        before = world.state(name).position[:2]
        arena.settle(PERIODS * period)
        after = world.state(name).position[:2]
        on_map = max(map(abs, after)) < 0.5 * (SAMPLES - 1) * SPACING
        return Stranger(name, moving, braked, math.dist(before, after) if on_map else math.nan, world.rescues)


def run_strangers(names: Sequence[str]) -> list[Stranger]:
    """Run robots on both grounds, limp and with braked joints."""
    found = []
    for name, moving, braked in product(names, (False, True), (False, True)):
        say(f"{name} for {SECONDS:g} s")
        found.append(run_stranger(name, moving=moving, braked=braked))
    return found


CHARTS = Charts(
    "robots", "make robots", "robot_charts.md", "robots in the charts", "robot", tables="robot_tables.md",
    part="out/robots",
)  # fmt: skip


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the scenes and the strangers; write JSON, pictures and tables."""
    every = scenes()
    options = CHARTS.parser(__doc__, [scene.name for scene in every]).parse_args(arguments)
    out, todo = CHARTS.folder(options), CHARTS.chosen(options, every)
    chosen = robot_configurations(quick=options.quick)
    by_title = {scene.title: scene for scene in todo}
    _, blocks = CHARTS.run(out, by_title, lambda scene: run(RobotContest(scene), chosen))
    names = ("mini_cheetah",) if options.quick else tuple(STRANGERS)
    strangers = [] if options.scenes else run_strangers(names)
    save(CHARTS.data(out), {"strangers": [one._asdict() for one in strangers]})
    CHARTS.write(out, {**blocks, "strangers": strangers_table(strangers)})
    return 0


def strangers_table(strangers: Sequence[Stranger]) -> str:
    """Return drift and rescues of the robots that nobody tuned for."""
    rows = []
    for one in strangers:
        name = f"{one.name}, {'braked' if one.braked else 'limp'}, ground {'heaving' if one.moving else 'at rest'}"
        stays = math.isfinite(one.drift)
        drift = f"{1e3 * one.drift:.1f}" if stays else "left the map"
        rows.append([name, drift, str(one.rescues), "0", "yes" if stays and not one.rescues else "**no**"])
    return table(["robot", "drift [mm]", "rescues", "limit", "kept"], rows)
