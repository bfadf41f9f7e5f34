"""``make robots``: robots on rough and moving ground, cost against accuracy, beside other engines."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass

import numpy as np

from smartmesh_ros.ground.config import PhysicsConfig
from smartmesh_ros.ground.state import BodyState
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.world.joints import JointCommand
from smartmesh_ros.world.world import World, WorldConfig
from studies.configurations import robot_configurations
from studies.contest import run
from studies.matrix.arena import square
from studies.pages import table
from studies.progress import Progress
from studies.results_file import save_results
from studies.robots.contest import RobotContest
from studies.robots.robot import DATA
from studies.robots.scene import HEAVING, STILL, RoughHills, scenes
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
# Limit of the rescues.
MOST_RESCUES = 0


@dataclass(frozen=True, kw_only=True)
class Stranger:
    """A robot on rough ground. ``moving``: the ground heaves. ``braked``: its joints are, otherwise they turn freely.
    ``drift`` [m]: horizontal motion of its root link over `PERIODS` periods at the end; NaN = it left the map.
    ``rescues``: by the guard, in the whole run."""

    name: str
    moving: bool
    braked: bool
    drift: float
    rescues: int

    @property
    def passed(self) -> bool:
        """Return True if it stayed, and needed no rescue."""
        return self.rescues <= MOST_RESCUES and math.isfinite(self.drift)


def run_strangers(say: Callable[[str], None], *, quick: bool) -> list[Stranger]:
    """Run all robots on both grounds, limp and with braked joints; in the quick run one of them."""
    names = ("mini_cheetah",) if quick else tuple(STRANGERS)
    found = []
    for name in names:
        for moving in (False, True):
            for braked in (False, True):
                say(f"{name} for {SECONDS:g} s")
                found.append(run_stranger(name, moving=moving, braked=braked))
    return found


def run_stranger(name: str, *, moving: bool, braked: bool) -> Stranger:
    """Run one robot that is spawned on the ground in the middle of the map."""
    ground = RoughHills(square(SAMPLES, SPACING), HEAVING if moving else STILL)
    heightmap = HeightMap(ground.heights(0.0), geometry=ground.geometry)
    period = 2.0 * math.pi / HEAVING.frequency
    marks = [round((SECONDS - back) * 240.0) for back in (PERIODS * period, 0.0)]
    places = []
    with World(heightmap, WorldConfig(physics=PhysicsConfig(sleep=False))) as world:
        world.spawn_robot(name, str(STRANGERS[name]), BodyState(), on_ground=True, clearance=0.02)
        _move_into_limits(world, name)
        if braked:
            for joint in world.bodies[name].joints:
                world.command(name, joint, JointCommand(velocity=0.0))
        maps = 0
        for step in range(1, marks[-1] + 1):
            number = math.floor(world.time * MAP_RATE + 1e-6)
            if moving and number != maps:
                heightmap.replace(ground.heights(number / MAP_RATE), time=number / MAP_RATE)
                maps = number
            world.step()
            if step in marks:
                places.append(world.state(name).position[:2] if name in world.bodies else (math.nan, math.nan))
        on_map = bool(np.all(np.abs(places[-1]) < 0.5 * (SAMPLES - 1) * SPACING))
        drift = math.dist(*places) if on_map else math.nan
        return Stranger(name=name, moving=moving, braked=braked, drift=drift, rescues=world.rescues)


def _move_into_limits(world: World, name: str) -> None:
    """Set joints whose limits exclude zero to the nearest limit, because a brake at zero would push against it."""
    client, body = world.client, world.bodies[name]
    for joint in body.joints.values():
        low, high = client.getJointInfo(body.uid, joint)[8:10]
        if low <= high:  # PyBullet gives -1 as the upper limit of joints without limits
            client.resetJointState(body.uid, joint, min(max(0.0, low), high), 0.0)
    world.ground.wake(body.uid)


CHARTS = Charts(
    "robots", "make robots", "robot_charts.md", "robots in the charts", "robot", tables="robot_tables.md",
    part="out/robots",
)  # fmt: skip


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the scenes and the strangers; write JSON, pictures and tables."""
    every = scenes()
    options = CHARTS.parser(__doc__, [scene.name for scene in every]).parse_args(arguments)
    out, machine = CHARTS.begin(options)
    say = Progress()
    todo = CHARTS.chosen(options, every)
    chosen = robot_configurations(quick=options.quick)
    by_title = {scene.title: scene for scene in todo}
    _, blocks = CHARTS.run(out, by_title, chosen, lambda scene: run(RobotContest(scene), chosen, say), machine)
    strangers = [] if options.scenes else run_strangers(say, quick=options.quick)
    save_results(CHARTS.data(out), {"strangers": [asdict(one) for one in strangers]})
    CHARTS.write(out, {"machine": machine, **blocks, "strangers": strangers_table(strangers)})
    return 0


def strangers_table(strangers: Sequence[Stranger]) -> str:
    """Return drift and rescues of the robots that nobody tuned for."""
    rows = [
        [
            f"{one.name}, {'braked' if one.braked else 'limp'}, ground {'heaving' if one.moving else 'at rest'}",
            f"{1e3 * one.drift:.1f}" if math.isfinite(one.drift) else "left the map",
            str(one.rescues),
            f"{MOST_RESCUES}",
            "yes" if one.passed else "**no**",
        ]
        for one in strangers
    ]
    return table(["robot", "drift [mm]", "rescues", "limit", "kept"], rows)
