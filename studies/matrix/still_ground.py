"""Rows on ground that stays as it is: ghosts, theory of rigid bodies, sizes and shapes."""

import math
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from smartmesh_ros import Box, Cylinder, PhysicsConfig, Sphere
from smartmesh_ros.ground.shapes import Shape
from smartmesh_ros.tools.evaluation.distance import nearest
from smartmesh_ros.tools.evaluation.measures import GRAVITY
from smartmesh_ros.tools.evaluation.scene import lowest
from studies.engines.bullet import bullet_contacts
from studies.engines.engine import EngineBody, Setup, build
from studies.matrix.arena import ANY, Arena, Method, Row, deepest, off

SPEED = 3.0
_CUBE, _SPHERE, _DRUM = Box(0.4, 0.4, 0.4), Sphere(0.2), Cylinder(radius=0.2, height=0.4)
# Where these start and end that go on for a second, not in line with the rows of a wide map.
_START, _END = (-2.0, 0.013, 0.2), (1.0, 0.013, 0.2)
_WIDE: dict[str, Any] = {"size": 101, "resolution": 0.1}
_SMOOTH: dict[str, Any] = {**_WIDE, "physics": PhysicsConfig(friction=0.0)}
_SLIDES = {"linear": (SPEED, 0.0, 0.0)}
_ROLLS = {**_SLIDES, "angular": (0.0, SPEED / 0.2, 0.0)}


def slide_speed(method: Method) -> float:
    """Largest error of speed [mm/s] of a frictionless box, sphere and cylinder, a second after they slid at 3 m/s."""
    worst = 0.0
    for shape in (_CUBE, _SPHERE, _DRUM):
        with Arena(method, **_SMOOTH) as arena:
            arena.spawn("body", shape, _START, **_SLIDES)
            arena.settle(1.0)
            worst = max(worst, abs(float(np.linalg.norm(arena.velocities()[0])) - SPEED))
    return 1e3 * worst


def rolling_energy(method: Method) -> float:
    """Change [%] of the energy of a ball that rolls at 3 m/s for a second."""
    with Arena(method, **_WIDE) as arena:
        arena.spawn("ball", _SPHERE, _START, **_ROLLS)

        def energy() -> float:
            state, inertia = arena.world.state("ball"), 0.4 * 0.2**2
            kinetic = 0.5 * (np.square(state.linear).sum() + inertia * np.square(state.angular).sum())
            return float(kinetic + GRAVITY * state.position[2])

        before = energy()
        arena.settle(1.0)
        return 100.0 * abs(energy() - before) / (0.7 * SPEED**2)


def ripples_against_whole(method: Method) -> float:
    """Error [mm] after a second of eight balls rolling over 5 cm ripples, beyond that of a filtered collider of the
    whole map at the same steps; the truth is that collider at steps 8 times finer."""
    ground = {"kind": "sinusoid", "amplitude": 0.05, "wavelength": 2.0}
    with Arena(method, ground, size=101, resolution=0.1) as arena:
        # Side by side, so that none rolls into another.
        starts = np.stack([np.random.default_rng(3).uniform(-2.0, 2.0, 8), np.linspace(-2.13, 2.07, 8)], axis=1)
        surface = arena.surface()
        bodies = []
        for index, (x, y) in enumerate(starts.tolist()):
            z = float(lowest(surface, Sphere(0.2), np.array([[x, y]]))[0])
            arena.spawn(f"ball_{index}", Sphere(0.2), (x, y, z), linear=(1.0, 0.0, 0.0), angular=(0.0, 5.0, 0.0))
            bodies.append(EngineBody(shape=Sphere(0.2), state=arena.world.state(f"ball_{index}")))
        ends, corner = [], surface.geometry.origin[:2]
        for rate in (240, 8 * 240):
            setup = Setup(heights=surface.heights, resolution=0.1, origin=corner, bodies=bodies, dt=1.0 / rate)
            with build("bullet_trimesh", setup, edge_filter=True) as whole:
                for _ in range(rate):
                    whole.step()
                ends.append(whole.positions())
        arena.settle(1.0)
        whole_off, off = (np.linalg.norm(end - ends[1], axis=1).max() for end in (ends[0], arena.positions()))
        return 1e3 * max(float(off - whole_off), 0.0)


def lay_on_slope(arena: Arena, shape: Box | Sphere, x: float, angle: float) -> None:
    """Adds a box or a ball that lies on a slope which rises along x at an ``angle`` [rad]."""
    height, turn = (0.5 * shape.z, 0.5 * angle) if isinstance(shape, Box) else (shape.radius, 0.0)
    foot = np.array([x, 0.013, x * math.tan(angle)]) + height * np.array([-math.sin(angle), 0.0, math.cos(angle)])
    arena.spawn("body", shape, tuple(foot.tolist()), orientation=(0.0, -math.sin(turn), 0.0, math.cos(turn)))


def _speeds_up(
    shape: Box | Sphere, degrees: float, x: float, seconds: float, theory: Callable[[float], float], method: Method
) -> float:
    """Error [%] of the acceleration of a body from ``x`` [m] down a slope, over so many seconds, against the one
    [m/s^2] that ``theory`` gives by the angle [rad]."""
    with Arena(method, {"kind": "slope", "angle": degrees}, size=101) as arena:
        lay_on_slope(arena, shape, x, math.radians(degrees))
        arena.settle(0.25)
        first = np.linalg.norm(arena.velocities()[0])
        arena.settle(seconds)
        found = (np.linalg.norm(arena.velocities()[0]) - first) / seconds
        return 100.0 * abs(float(found) / theory(math.radians(degrees)) - 1.0)


def slope_holds(method: Method) -> float:
    """How far [mm] a box creeps in a second on 25 degrees, where friction of 0.5 holds it (up to 26.6 degrees)."""
    with Arena(method, {"kind": "slope", "angle": 25.0}) as arena:
        lay_on_slope(arena, Box(0.4, 0.4, 0.2), 0.0, math.radians(25.0))
        return arena.drift(0.5, 1.0)


def bounces(method: Method) -> float:
    """Error [%] of the height that a ball of restitution 0.5, dropped from a metre, comes back to: a quarter."""
    with Arena(method, physics=PhysicsConfig(restitution=0.5)) as arena:
        arena.spawn("ball", Sphere(0.2), (0.013, 0.017, 1.2))
        arena.settle(0.5)
        highest = arena.most(0.5, lambda: arena.positions()[0, 2] - 0.2)
        return 100.0 * abs(highest / 0.25 - 1.0)


def normals(method: Method) -> float:
    """Angle [deg], 99 %, between contact normals of balls rolling over ripples and those of the main mesh."""
    ground = {"kind": "sinusoid", "amplitude": 0.1, "wavelength": 2.0}
    with Arena(method, ground, size=81, resolution=0.1) as arena:
        arena.scatter(8, Sphere(0.2), 2.0, 0.22, linear=(1.0, 0.0, 0.0))
        parts = {(arena.world.bodies[name].uid, -1): index for index, name in enumerate(arena.shapes)}
        chords: list[float] = []
        surface, before = arena.surface(), arena.positions()
        for time in arena.run(1.5):
            if time > 0.5:
                contacts = bullet_contacts(arena.world.client, parts, arena.world.dt)
                pressed = contacts.normal_forces > 0.0
                true = nearest(surface, before[contacts.bodies[pressed]], 0.4).normal
                chords += np.linalg.norm(contacts.normals_w[pressed] - true, axis=1).tolist()
            before = arena.positions()
        angles = np.degrees(2.0 * np.arcsin(0.5 * np.array(chords)))
        return float(np.nanpercentile(angles, 99)) if chords else math.inf


def wide_box(method: Method) -> float:
    """Largest distance [mm] of a corner of a box a metre wide from where it should rest, on cells of 0.5 to 0.05 m."""
    worst = 0.0
    for resolution in (0.5, 0.25, 0.1, 0.05):
        with Arena(method, size=41, resolution=resolution) as arena:
            height = float(arena.rest_of(Box(1.0, 0.9, 0.2), (0.013, 0.017, 0.1))[2])
            worst = max(worst, abs(height - 0.1), abs(float(arena.clearances()[0])))
    return 1e3 * worst


_PLACES = 5


def sinks(
    shape: Shape, ground: dict[str, Any], size: int, resolution: float, drop: float, spread: float, method: Method
) -> float:
    """Penetration [mm], 99 %, where it is deepest of `_PLACES` places within ``spread`` [m] that a body is
    dropped at from ``drop`` [m]; one body at a time, so that none is pushed."""
    found = []
    for place in range(_PLACES):
        with Arena(method, ground, size=size, resolution=resolution) as arena:
            arena.scatter(1, shape, spread, drop, seed=place)
            found.append(deepest(arena, 1.5, 0.75))
    return max(found)


# A ball in a V-shaped trough rests above its bottom by its radius times the secant of the slope.
_REST = 0.3 * math.hypot(1.0, 0.6)
_TROUGH = partial(off, Sphere(0.3), (0.0, 0.013, _REST + 0.02), (ANY, ANY, _REST), ground=lambda x, y: 0.6 * np.abs(x))
_RIPPLES = {"kind": "sinusoid", "amplitude": 0.04, "wavelength": 1.0}
_TWICE = "main mesh, 99 %; twice the tolerance"
_SMALL_BALL = partial(sinks, Sphere(0.05), {"kind": "noise", "deviation": 0.05}, 41, 0.25, 0.06, 3.0)
_LARGE_BALL = partial(sinks, Sphere(1.25), _RIPPLES, 161, 0.05, 1.3, 1.5)
_LARGE_BOX = partial(sinks, Box(2.0, 1.6, 0.3), _RIPPLES, 121, 0.05, 0.2, 1.5)
_LONG = {"kind": "sinusoid", "amplitude": 0.05, "wavelength": 2.0}
_THIN_BOX = partial(sinks, Box(2.0, 0.1, 0.05), _LONG, 61, 0.1, 0.1, 1.5)
_BOXES = partial(sinks, Box(0.4, 0.3, 0.2), {"kind": "noise", "deviation": 0.02}, 61, 0.1, 0.2, 2.0)
_DOWN = partial(_speeds_up, Box(0.4, 0.4, 0.2), 35.0, 2.0, 0.5, lambda a: GRAVITY * (math.sin(a) - 0.5 * math.cos(a)))
_ROLLS_DOWN = partial(_speeds_up, Sphere(0.2), 15.0, 5.0, 1.0, lambda a: 5.0 / 7.0 * GRAVITY * math.sin(a))
_PLANE = "a plane, 1 s at 3 m/s"
ROWS = (
    *(
        Row(f"T1 sliding {name}", partial(off, shape, _START, _END, state=_SLIDES, **_SMOOTH), 1.0, "mm", _PLANE,
            quick=name == "box")
        for name, shape in (("box", _CUBE), ("sphere", _SPHERE), ("cylinder", _DRUM))
    ),
    Row("T1 their speed", slide_speed, 2.0, "mm/s", _PLANE),
    Row("rolling ball", partial(off, _SPHERE, _START, _END, state=_ROLLS, **_WIDE), 1.0, "mm", _PLANE, quick=True),
    Row("its energy", rolling_energy, 0.15, "%", "a plane; 2 mm/s"),
    Row("T2 ripples of 5 cm", ripples_against_whole, 2.0, "mm", "beyond the whole trimesh's, 1 s"),
    Row("contact normals", normals, 2.8, "deg", "the next facet, 99 %"),
    Row("sliding down 35 deg", _DOWN, 2.0, "%", "theory: g (sin - 0.5 cos)"),
    Row("held on 25 deg", slope_holds, 1.0, "mm", "theory: holds below 26.6 deg, 1 s"),
    Row("rolling down 15 deg", _ROLLS_DOWN, 2.0, "%", "theory: 5/7 g sin"),
    Row("bouncing, e = 0.5", bounces, 20.0, "%", "theory: e^2; PyBullet's bounce"),
    Row("ball in a trough", _TROUGH, 1.0, "mm", "theory: r sec(slope)", quick=True),
    Row("T8 box on 5-50 cm cells", wide_box, 1.0, "mm", "a plane", quick=True),
    Row("ball of a fifth of a cell", _SMALL_BALL, 1.0, "mm", "main mesh, 99 %"),
    Row("ball of 50 cells", _LARGE_BALL, 4.0, "mm", _TWICE),
    Row("box of 40 cells on ripples", _LARGE_BOX, 4.0, "mm", _TWICE),
    Row("long thin box", _THIN_BOX, 4.0, "mm", _TWICE),
    Row("boxes on noise", _BOXES, 4.0, "mm", "main mesh, 99 %"),
)  # fmt: skip
