"""``make laws``: how well engines keep the laws of contact, and how far runs drift apart; fills docs/laws.md."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from smartmesh_ros import PhysicsConfig
from smartmesh_ros.scenes.moving import Scene as MovingGround
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.tools.evaluation.grounds import Rigid, flat
from smartmesh_ros.tools.evaluation.measures import GRAVITY
from smartmesh_ros.tools.evaluation.scene import Bodies, Scene
from studies.accuracy import setup_of
from studies.configurations import OURS, RATE, Configuration, rivals, robot_configurations
from studies.engines.engine import Contacts, Engine, Simulation
from studies.matrix.arena import square
from studies.pages import ROOT, fill, number, table
from studies.robots.robot import FRICTION, HUSKY, RobotEngine, robot_scene
from studies.robots.robot import setup_of as setup_of_robots

# Contacts count that carry more than this share of the weight. They slip above this speed [m/s]: maps leave open by up
# to 6 cm/s how ground that tilts under a body moves along x and y.
PRESSED, SLIPS = 0.01, 0.1
length = partial(np.linalg.norm, axis=-1)


class Residuals(NamedTuple):
    """Residuals of P contacts, each (P,).

    ``signorini``: the smaller of the gap after the step, relative to how far a body falls in a step from rest, and the
    normal force relative to the weight. ``normal_speeds`` [m/s]: towards or away from the ground. ``depths`` [m]: after
    the step. ``beyond``: friction outside the cone, relative to its radius. Where a contact slips, else NaN: ``angles``
    [rad] between friction and the direction against slip, ``used``: friction relative to the cone's radius, and
    ``dissipated``: its power relative to the largest. All zero where the laws hold; ``used`` and ``dissipated`` one.
    """

    signorini: FloatArray
    normal_speeds: FloatArray
    depths: FloatArray
    beyond: FloatArray
    angles: FloatArray
    used: FloatArray
    dissipated: FloatArray


def residuals(contacts: Contacts, weight: float, friction: float, dt: float) -> Residuals:
    """Return the residuals of the contacts that press in a step of ``dt`` [s], of bodies of one ``weight`` [N] and
    coefficient of ``friction``; their velocities are relative to the ground."""
    pressed = contacts.normal_forces > PRESSED * weight
    normals, gaps, velocities, forces, frictions = (np.asarray(column[pressed], np.float64) for column in contacts[2:])
    normal_speeds = np.sum(velocities * normals, axis=1)
    against = normal_speeds[:, None] * normals - velocities  # the direction against slip
    gaps = gaps + dt * normal_speeds
    used = length(frictions) / (friction * forces)
    angles = np.arctan2(length(np.cross(frictions, against)), np.sum(frictions * against, axis=1))
    slipping = np.where(length(against) > SLIPS, 1.0, np.nan)
    return Residuals(
        signorini=np.minimum(np.maximum(gaps, 0.0) / (GRAVITY * dt**2), forces / weight),
        normal_speeds=np.abs(normal_speeds),
        depths=np.maximum(-gaps, 0.0),
        beyond=np.maximum(used - 1.0, 0.0),
        angles=slipping * angles,
        used=slipping * used,
        dissipated=slipping * used * np.cos(angles),
    )


def joined(parts: Sequence[Residuals]) -> Residuals:
    """Return the residuals of several steps as one."""
    return Residuals(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def spread(ends_w: FloatArray) -> tuple[float, float]:
    """Return the standard deviation of positions (N, 3) about their mean, and the largest distance of two of them."""
    deviation = np.sqrt(np.mean(length(ends_w - ends_w.mean(axis=0)) ** 2))
    return float(deviation), float(length(ends_w[:, None] - ends_w).max())


# Bodies have 1 kg.
BOX: dict[str, Any] = {"shape": "box", "size": (0.5, 0.4, 0.3)}
SLOPE, WAVES, ROUGH = {"kind": "slope", "angle": 20}, {"kind": "waves"}, {"kind": "noise"}
STAIRS = {"kind": "stairs", "rise": 0.3, "tread": 0.5}
ASKEW = (0.5, 1.0, 0.0)  # a velocity [m/s] along no axis of the world, which a solver could prefer
HUSKY_MASS = 44.063  # [kg]


def scene_of(name: str, ground: dict[str, Any], seconds: float = 1.25, settle: float = 0.25, **bodies: Any) -> Scene:
    """Return a scene of twelve bodies, or as many as ``bodies`` says, on a map of 10 m."""
    return Scene(
        name=name, title=name, ground=ground, grid=(41, 0.25), duration=seconds, settle=settle,
        map_rate=240.0 if ground == WAVES else 0.0, bodies=Bodies(**{"count": 12, "spread": (3.0, 3.0), **bodies}),
    )  # fmt: skip


# Balls start without spin: they slip, then roll. Boxes slide, or stay where they are.
TRIALS = (
    scene_of("slope", SLOPE, settle=0.05, drop=0.0, velocity=ASKEW, friction=0.3),
    scene_of("slope", SLOPE, drop=0.0, velocity=ASKEW, friction=0.3, **BOX),
    scene_of("slope", SLOPE, drop=0.0, **BOX),
    scene_of("waves", WAVES),
    scene_of("waves", WAVES, **BOX),
    scene_of("drop", ROUGH, settle=0.0, drop=0.3, velocity=ASKEW),
    scene_of("drop", ROUGH, settle=0.0, drop=0.3, velocity=ASKEW, **BOX),
)
LONE: dict[str, Any] = {"count": 1, "spread": (0.03, 0.02), "drop": 0.001}
COURSES = (
    scene_of("box slides to rest", {"kind": "flat"}, 1.5, velocity=(2.0, 0.7, 0.0), **LONE, **BOX),
    scene_of("ball on waves", WAVES, 2.0, velocity=ASKEW, **LONE),
    scene_of("box tumbles down stairs", STAIRS, 2.0, velocity=(-2.0, 0.3, 0.0), **LONE, **BOX),
)


def entered(configuration: Configuration, scene: Scene, shift: Any = (0.0, 0.0, 0.0)) -> Engine:
    """Return an engine with the bodies of a scene, moved by a ``shift`` (3,) [m]."""
    heights = np.asarray(scene.make_ground().heights(0.0), np.float64)
    starts = [replace(one, position=tuple(np.add(one.position, shift).tolist())) for one in scene.starts()]
    engine: Engine = configuration.build(setup_of(scene, heights, configuration.rate, starts))
    return engine


def residuals_in(
    engine: Simulation, dt: float, span: tuple[float, float], weight: float, friction: float, scene: Scene | None = None
) -> Residuals | None:
    """Return the residuals of all contacts in steps of ``dt`` [s] from the first to the second time of a ``span`` [s],
    on ground of a ``scene`` or at rest; None if the engine does not tell contacts."""
    parts, ground = [], scene.make_ground() if scene else None
    with engine:
        for step in range(round(span[1] / dt)):
            now, then = (ground.heights((step + late) * dt).astype(np.float64) if ground else None for late in (0, 1))
            if scene and scene.moves:
                engine.set_ground(engine.ready(now))
            before = engine.velocities()
            engine.step()
            contacts = engine.contacts()
            if contacts is None:
                return None
            if step * dt >= span[0] and contacts.bodies.size:
                contacts = completed(contacts, (engine.velocities() - before)[:, :3] / dt)
                if scene and now is not None and then is not None:
                    contacts.velocities_w[:, 2] -= scene.surface((then - now) / dt).below(contacts.points_w)
                parts.append(residuals(contacts, weight, friction, dt))
    return joined(parts)


def completed(contacts: Contacts, accelerations_w: FloatArray) -> Contacts:
    """Return contacts with the friction that an engine keeps to itself, of bodies of 1 kg with one contact: what their
    ``accelerations_w`` (N, 3) [m/s^2] leave to it."""
    alone = np.bincount(contacts.bodies)[contacts.bodies] == 1
    untold = np.isnan(contacts.frictions_w[:, 0]) & alone
    rest = accelerations_w[contacts.bodies] - contacts.normal_forces[:, None] * contacts.normals_w
    rest[:, 2] += GRAVITY
    return contacts._replace(frictions_w=np.where(untold[:, None], rest, contacts.frictions_w))


def end_in(configuration: Configuration, scene: Scene, shift: FloatArray) -> FloatArray:
    """Return where a body is (3,) [m] at the end of a scene, whose start is moved by a ``shift`` (3,) [m]. Ground that
    moves is told at 60 Hz."""
    ground, dt = scene.make_ground(), 1.0 / configuration.rate
    with entered(configuration, scene, shift) as engine:
        for step in range(round(scene.duration / dt)):
            if scene.moves and step % round(configuration.rate / 60.0) == 0:
                engine.set_ground(engine.ready(np.asarray(ground.heights(step * dt), np.float64)))
            engine.step()
        return np.array(engine.positions()[0])


def husky_entered(configuration: Configuration, ground: MovingGround, start: FloatArray, speed: float) -> RobotEngine:
    """Return an engine with a husky whose middle starts at ``start`` (3,) [m] with wheels of a ``speed`` [rad/s]."""
    engine: RobotEngine = configuration.build(setup_of_robots(HUSKY, ground, start[None], configuration.rate, speed))
    return engine


def end_of_husky(configuration: Configuration, shift: FloatArray) -> FloatArray:
    """Return where a husky is (3,) [m] that drove over rough ground for a second."""
    scene = robot_scene(HUSKY, "maps", 0.1)
    with husky_entered(configuration, scene.ground, scene.starts[0] + shift, HUSKY.speed) as engine:
        for _ in range(round(configuration.rate)):
            engine.step()
        return np.array(engine.links().centres[0])


def residuals_of_husky(configuration: Configuration) -> Residuals | None:
    """Return the residuals of a husky that slides with braked wheels, None if the engine does not tell contacts. The
    ground falls by 30 degrees along no axis of the world, nor of the robot."""
    plane = flat(square(31, 0.1))
    fall = np.tan(np.radians(30.0)) * (plane.x * ASKEW[0] + plane.y * ASKEW[1]) / np.hypot(*ASKEW[:2])
    engine = husky_entered(configuration, Rigid(plane.geometry, -fall), np.array([0.0, 0.0, 0.35]), 0.0)
    return residuals_in(engine, 1.0 / configuration.rate, (0.5, 1.5), HUSKY_MASS * GRAVITY, FRICTION)


PAGE = ROOT / "docs" / "laws.md"
# Runs, and how far their starts are from the middle one at most [m].
RUNS, FURTHEST = 100, 0.5e-6
ATTACHED = {"attached": True, "physics": PhysicsConfig(sleep=False)}
ROBOTS = {one.name: one for one in robot_configurations(quick=False)}
HEAD = (
    "gap and force", "normal speed [mm/s]", "depth [mm]", "beyond the cone [%]", "off the slip [deg]",
    "friction / cone", "dissipated / largest",
)  # fmt: skip


def competitors() -> list[Configuration]:
    """Return the engines that are compared, ours first; Rapier only as it is more accurate."""
    attached = Configuration(name="defaults, bodies attached", family="ours", engine="smartmesh", options=ATTACHED)
    others = [one for one in rivals() if one.rate == RATE and not one.for_sliding and one.name != "Rapier, 240 Hz"]
    return [OURS[0], attached, *others]


def laws(groups: Sequence[str]) -> str:
    """Return the table of residuals: a row for each group of scenes and engine, and for each engine's husky."""
    found: dict[str, list[Residuals | None]] = {}
    for group, one in product(groups, competitors()):
        row = found[f"{group}: {one.name}"] = []
        for scene in (scene for scene in TRIALS if scene.name == group):
            span, friction = (scene.settle, scene.duration), scene.bodies.friction
            row.append(residuals_in(entered(one, scene), 1.0 / one.rate, span, GRAVITY, friction, scene))
    driving = [ROBOTS[one.name] for one in competitors() if one.name in ROBOTS]
    found |= {f"husky: {one.name}": [residuals_of_husky(one)] for one in driving}
    return table(["scenes: engine", *HEAD], [[name, *figures(parts)] for name, parts in found.items()])


def figures(parts: Sequence[Residuals | None]) -> list[str]:
    """Return the cells of a row: mean and 99 % of what should be zero, mean of what should be one."""
    told = [part for part in parts if part is not None]
    if not told:
        return ["-"] * len(HEAD)
    *zeros, used, dissipated = joined(told)
    units = (1.0, 1e3, 1e3, 1e2, np.degrees(1.0))
    cells = [
        f"{_of(unit * values, np.mean)} / {_of(unit * values, partial(np.percentile, q=99))}"
        for unit, values in zip(units, zeros, strict=True)
    ]
    return [*cells, _of(used, np.mean), _of(dissipated, np.mean)]


def _of(values: FloatArray, statistic: Callable[[FloatArray], Any]) -> str:
    """Return a statistic of what is not NaN; rounding errors are zero."""
    known = values[np.isfinite(values)]
    return number(round(float(statistic(known)), 4)) if known.size else "-"


def drifts(runs: int) -> str:
    """Return the table of spreads [mm]: a row for each engine, a column for each scene."""
    rows = []
    for one in competitors():
        cells = [_spread(partial(end_in, one, scene), runs) for scene in COURSES]
        driven = _spread(partial(end_of_husky, ROBOTS[one.name]), runs) if one.name in ROBOTS else "-"
        rows.append([one.name, *cells, driven])
    return table(["engine", *(scene.name for scene in COURSES), "husky drives"], rows)


def _spread(run: Callable[[FloatArray], FloatArray], runs: int) -> str:
    """Return standard deviation and largest difference of the ends of runs from starts within a ball of `FURTHEST`."""
    shifts = np.random.default_rng(1).uniform(-1.0, 1.0, (runs, 3)) * FURTHEST / np.sqrt(3.0)
    return " / ".join(number(1e3 * value) for value in spread(np.array([run(shift) for shift in shifts])))


def main() -> None:
    """Runs the study."""
    text = f"{laws(['slope', 'waves', 'drop'])}\n\n{drifts(RUNS)}"
    print(text)
    fill(PAGE, {"laws": text})
