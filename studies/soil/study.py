"""``make soil``: soil against closed forms and a measured wheel, and its cost; fills pages in docs/."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from time import thread_time

import numpy as np
from matplotlib.figure import Figure

from smartmesh_ros.ground.shapes import Box, Shape, Sphere
from smartmesh_ros.ground.state import BodyState
from smartmesh_ros.soil.bodies import BulletBodies
from smartmesh_ros.soil.config import SoilConfig
from smartmesh_ros.soil.soil import Soil
from smartmesh_ros.soil.soils import soil_named, soils_of
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.world.world import World
from studies.markdown import table
from studies.pages import ROOT, fill
from studies.soil import steps
from studies.soil.arcs import WheelForces, wheel_forces
from studies.soil.steps import wheel_table
from studies.soil.trials import (
    K10,
    RIGID,
    SMOOTH,
    TOWED,
    PlateTrial,
    TowedWheel,
    Wheel,
    plate_sinkage,
    sled_shear,
    wheel_sinkage,
    wheel_work,
)

DOCS = ROOT / "docs"
PICTURES = DOCS / "images" / "soil"
SPACINGS = (0.005, 0.01, 0.02, 0.04)
PRESSURES = (5e3, 10e3, 20e3)


def plates() -> str:
    """Return the table of plates: closed form, and the worst deviation on each grid."""
    rows = []
    for name in soils_of():
        soil = soil_named(name)
        wanted = [plate_sinkage(soil, PlateTrial.edge, pressure) for pressure in PRESSURES]
        row = [name, " / ".join(f"{1e3 * value:.2f}" for value in wanted)]
        for spacing in SPACINGS:
            worst = 0.0
            for pressure, value in zip(PRESSURES, wanted, strict=True):
                trial = PlateTrial(name, spacing=spacing)
                trial.press(pressure, 1.5)
                worst = max(worst, abs(trial.sinkage / value - 1.0))
            row.append(f"{100.0 * worst:.2f} %")
        trial = PlateTrial(name, spacing=0.02)
        trial.press(10e3, 1.0)
        trial.press(10e3, 0.5, pull=0.02)
        row.append(f"{100.0 * (trial.shear / sled_shear(soil, 10e3, trial.pulled) - 1.0):+.2f} %")
        rows.append(row)
    head = ["soil", "closed form at 5 / 10 / 20 kPa [mm]", *(f"{1e3 * d:g} mm grid" for d in SPACINGS), "sled, 10 mm"]
    return table(head, rows)


def wheels() -> str:
    """Return the table of towed wheels."""
    rows = []
    for name in soils_of():
        soil = soil_named(name)
        row = [name, f"{1e3 * wheel_sinkage(soil, TOWED):.2f}"]
        for spacing, elastic in ((0.005, RIGID), (0.01, RIGID), (0.02, RIGID), (0.01, soil.elastic_K)):
            wheel = TowedWheel(name, spacing=spacing, elastic=elastic)
            wheel.roll(0.3)
            sunk = wheel.sinkage / wheel_sinkage(soil, TOWED) - 1.0
            work = wheel.resistance / wheel_work(soil, TOWED, wheel.sinkage) - 1.0
            row.append(f"{100.0 * sunk:+.1f} / {100.0 * work:+.1f} %")
        rows.append(row)
    head = ["soil", "closed form [mm]", "5 mm grid", "10 mm grid", "20 mm grid", "10 mm grid, elastic_K 2e8"]
    return table(head, rows)


def measured() -> str:
    """Return the table of the measured wheel, and draw its chart."""
    ours, theirs = [], []
    for run in SMOOTH:
        wheel = Wheel(radius=K10.radius, width=K10.width, load=run.load)
        trial = TowedWheel("k10_sand", wheel, spacing=0.005, slip=run.slip if run.slip else 1e-6, elastic=2e8)
        trial.roll(0.2)
        ours.append(WheelForces(trial.sinkage, trial.pull))
        rigid = replace(soil_named("k10_sand"), elastic_K=1e13, damping_R=0.0)  # carries nothing behind the wheel
        theirs.append(wheel_forces(rigid, wheel, run.slip, sinks_by_slip=False))
    draw(ours, theirs)
    return wheel_table("Wong-Reece", ours, theirs)


def draw(ours: Sequence[WheelForces], theirs: Sequence[WheelForces]) -> None:
    """Draw sinkage and pull against slip."""
    slips, loads = [run.slip for run in SMOOTH], np.array([run.load for run in SMOOTH])
    figure = Figure(figsize=(10, 4), layout="tight")
    axes = figure.subplots(1, 2)
    curves = ((SMOOTH, "ko", "measured"), (ours, "C0o-", "this soil, 5 mm grid"), (theirs, "C1--", "Wong-Reece"))
    for axis, figure_of, name, unit in (
        (axes[0], "sinkage", "sinkage [mm]", np.full(len(loads), 1e3)), (axes[1], "pull", "pull / load", 1.0 / loads)
    ):  # fmt: skip
        for found, style, label in curves:
            axis.plot(slips, unit * [getattr(run, figure_of) for run in found], style, label=label)
        axis.set_xlabel("slip")
        axis.set_ylabel(name)
        axis.grid(alpha=0.3)
    axes[0].legend()
    PICTURES.mkdir(parents=True, exist_ok=True)
    figure.savefig(PICTURES / "wheel.png", dpi=90)


def cost() -> str:
    """Return the table of the time of an update."""
    rows = []
    kinds: list[tuple[str, Shape, int, float]] = [
        ("1 ball of 0.1 m, rolling", Sphere(0.1), 1, 0.5), ("100 balls of 0.1 m, rolling", Sphere(0.1), 100, 0.5),
        ("100 boxes of 0.1 m, at rest", Box(0.1, 0.1, 0.1), 100, 0.0),
        ("100 boxes of 0.2 m, at rest", Box(0.2, 0.2, 0.2), 100, 0.0),
    ]  # fmt: skip
    for what, shape, number, speed in kinds:
        early, late = times(shape, number, speed)
        rows.append([what, f"{early:.3f}", f"{late:.3f}"])
    return table(["bodies on a 20 mm grid, updates at 60 Hz", "first 0.5 s [ms]", "after 1.5 s [ms]"], rows)


def times(shape: Shape, number: int, speed: float) -> tuple[float, float]:
    """Return the median processor times of an update [ms] while bodies sink, and later."""
    with World(HeightMap(np.zeros((1001, 1001)), resolution=0.02)) as world:
        for index in range(number):
            place = (2.0 + 1.6 * (index % 10), 2.0 + 1.6 * (index // 10), 0.0)
            world.spawn(f"b{index}", shape, 10.0, BodyState(place, linear=(speed, 0.0, 0.0)), on_ground=True)
        soil = Soil(world.terrain, "dry_sand", BulletBodies(world.client, world))
        took = []
        for _ in range(120):
            world.step(4)
            contacts = world.contacts()
            start = thread_time()
            soil.apply(contacts, 4 * world.dt, world.time)
            took.append(1e3 * (thread_time() - start))
    return float(np.median(took[1:30])), float(np.median(took[90:]))


def boxes() -> str:
    """Return the table of boxes that PyBullet sets onto soil, by their contacts alone."""
    rows = []
    for name in ("dry_sand", "lunar"):
        wanted = plate_sinkage(soil_named(name), 0.2, 5e3)
        for spacing in (0.01, 0.02, 0.04):
            row = [name, f"{1e3 * spacing:g}", f"{1e3 * wanted:.2f}"]
            for every in (1, 4):
                side = round(4.0 / spacing) + 1
                with World(HeightMap(np.zeros((side, side)), resolution=spacing)) as world:
                    world.spawn("box", Box(0.2, 0.2, 0.2), 5e3 * 0.04 / 9.81, BodyState((2.003, 2.007, 0.1005)))
                    soil = Soil(world.terrain, name, BulletBodies(world.client, world), SoilConfig())
                    last = 0.0
                    for _ in range(480 // every):
                        for _ in range(every - 1):
                            world.step()
                            soil.note(world.contacts())
                        world.step()
                        if soil.apply(world.contacts(), every * world.dt, world.time):
                            last = world.time
                    sunk = 0.1 - world.state("box").position[2]
                    rest = "sleeps" if world.is_asleep("box") else "awake"
                row.append(f"{1e3 * sunk:.2f} ({100.0 * (sunk / wanted - 1.0):+.0f} %), {last:.2f} s, {rest}")
            rows.append(row)
    updates = "update at each step (240 Hz)", "update at each fourth step (60 Hz) by the mean of four"
    return table(["soil", "grid [mm]", "closed form [mm]", *updates], rows)


def nodes() -> str:
    """Return the table of the rate that the nodes hold."""
    from studies.soil.nodes import rates  # needs ROS

    return rates()


# The blocks of each page.
PAGES = {
    "soil_tables.md": {
        "plates": plates, "towed wheels": wheels, "measured wheel": measured, "boxes in steps": steps.boxes,
        "wheel in steps": steps.forced_slip, "carts in steps": steps.carts, "set-downs in steps": steps.set_downs,
        "cost of steps": steps.cost,
    },
    "soil_between_steps.md": {"boxes": boxes, "cost of soil": cost, "rate of nodes": nodes},
}  # fmt: skip


def main() -> None:
    """Run the study, and write its tables into its pages."""
    names = [name for blocks in PAGES.values() for name in blocks]
    parser = argparse.ArgumentParser(prog="python -m studies soil", description=__doc__)
    parser.add_argument("--only", choices=names, help="run one part")
    chosen = parser.parse_args().only
    for page, blocks in PAGES.items():
        found = {name: make() for name, make in blocks.items() if chosen in (None, name)}
        for name, content in found.items():
            print(f"\n{name}\n{content}")
        fill(DOCS / page, found)


if __name__ == "__main__":
    main()
