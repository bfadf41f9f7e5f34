"""``make soil``: soil against closed forms and a measured wheel, and its cost; fills docs/soil_tables.md."""

import argparse
from dataclasses import replace
from time import thread_time
from timeit import Timer

import numpy as np

from smartmesh_ros import BodyState, Box, HeightMap, Soil, World
from smartmesh_ros.soil.config import known_soils, soil_named
from smartmesh_ros.tools.evaluation.measures import GRAVITY
from studies.pages import ROOT, fill, table
from studies.soil.trials import K10, SMOOTH, free_slip, plate_sinkage, undamped, wheel_forces
from studies.soil.vehicles import WARTHOG, Cart, drive, roll, set_down

# Boxes: mass [kg], side [m], and the fall onto the soil [m].
BOXES = ((20.0, 0.2, 0.0), (5e3, 1.0, 0.0), (5e4, 2.0, 0.0), (5e3, 1.0, 0.1))
SET_DOWN_ON = ("dry_sand", "lunar", "clay", "hit_lss1")


def boxes() -> str:
    """Return the table of boxes that are set down on the ground, and of one that falls onto it: their sinkage, and
    when they moved at less than 0.1 mm/s for good."""
    rows = []
    for name in known_soils():
        rows.append([name])
        for mass, side, fall in BOXES:
            grid, last = 0.1 * side, 0.0
            with World(HeightMap(np.zeros((41, 41)), resolution=grid)) as world:
                world.ground.set_soil(Soil(world.terrain, name, spacing=0.5 * grid))
                place = BodyState((20.03 * grid, 20.07 * grid, 0.5 * side + fall))
                world.spawn("box", Box(side, side, side), mass, place)
                for _ in range(960):
                    world.step()
                    if abs(world.state("box").linear[2]) > 1e-4:
                        last = world.time
                sunk = world.ground.on_soil()["box"].sinkage
            wanted = plate_sinkage(soil_named(name), side, GRAVITY * mass / side**2)
            off = 100.0 * (sunk / wanted - 1.0)
            rows[-1].append(f"{1e3 * wanted:.2f}: {1e3 * sunk:.2f} ({off:+.1f} %), {last:.2f} s")
    heads = (f"{mass:g} kg, {side:g} m{f', falls {fall:g} m' if fall else ''}" for mass, side, fall in BOXES)
    return table(["soil", *heads], rows)


def forced_slip() -> str:
    """Return the table of the measured wheel at forced slips."""
    soil, rows = undamped(soil_named("k10_sand")), []
    for slip, pull, load, sinkage in SMOOTH:
        wheel = replace(K10, load=load)
        one, other = roll(wheel, soil, slip), wheel_forces(soil, wheel, slip)
        sinkages = (f"{1e3 * found:.1f}" for found in (sinkage, one.sinkage, other.sinkage))
        pulls = (f"{found / load:+.2f}" for found in (pull, one.pull, other.pull))
        rows.append([f"{slip:g}", *sinkages, *pulls])
    head = ["slip", "sinkage [mm]: measured", "soil", "integrals", "pull / load: measured", "soil", "integrals"]
    return table(head, rows)


def carts() -> str:
    """Return the table of carts that drive."""
    rows = []
    for name in known_soils():
        soil = soil_named(name)
        for cart, what, speed, grid in ((Cart(), "12 kg", 0.3, 0.02), (WARTHOG, "268 kg", 0.5, 0.05)):
            row, loaded, worst = [name, what], 1.0, 0.0
            for each in (undamped(soil), soil):
                found = drive(cart, each, speed=speed, grid=grid)
                row.append(f"{found.slip:.3f} ({free_slip(each, cart.wheel, speed=speed):.3f})")
                loaded, worst = min(loaded, 1.0 - found.unloaded), max(worst, found.worst)
            rows.append([*row, f"{100.0 * loaded:.1f} %", f"{worst:.2f}"])
    slips = ["slip without damping (integrals)", "with it (integrals)"]
    return table(["soil", "cart", *slips, "steps under load", "largest load"], rows)


def set_downs() -> str:
    """Return the table of 100 bodies that are set down."""
    found = [set_down(number, SET_DOWN_ON[(number // 2 + number // 8) % 4]) for number in range(100)]
    rising, moving = max(run.rose for run in found), sum(run.speed > 0.05 for run in found)
    rows = [[str(len(found)), f"{1e3 * rising:.2f}", str(moving)]]
    return table(["bodies", "energy rose by at most [mm of height]", "still rolling after 2 s"], rows)


def cost() -> str:
    """Return the table of the median processor time of a step with a cart that drives [ms]."""
    rows = []
    for what, cart, grid in (
        ("12 kg, 5 cm", Cart(), 0.05), ("12 kg, 2 cm", Cart(), 0.02), ("268 kg, 5 cm", WARTHOG, 0.05)
    ):  # fmt: skip
        rows.append([what])
        for spacing in (0.0, 0.02, 0.01, 0.005):  # [m], 0 = no soil
            with World(HeightMap(np.zeros((round(3.0 / grid), round(5.0 / grid))), resolution=grid)) as world:
                world.spawn_robot("cart", cart.urdf, BodyState((1.0, 1.5, cart.radius + 0.051)))
                if spacing:
                    world.ground.set_soil(Soil(world.terrain, "dry_sand", spacing=spacing))
                world.step(120)
                for joint in world.joints("cart"):
                    world.drive("cart", joint.name, 0.3 / cart.radius, 20.0 * GRAVITY * cart.mass)
                took = Timer(world.step, timer=thread_time).repeat(480, 1)
            rows[-1].append(f"{1e3 * np.median(took):.2f}")
    return table(["cart, map", "no soil", "spacing 20 mm", "spacing 10 mm", "spacing 5 mm"], rows)


PAGE = ROOT / "docs" / "soil_tables.md"
# The blocks of the page.
BLOCKS = {"boxes": boxes, "wheel": forced_slip, "carts": carts, "set-downs": set_downs, "cost": cost}


def main() -> None:
    """Run the study, and write its tables into its page."""
    parser = argparse.ArgumentParser(prog="python -m studies soil", description=__doc__)
    parser.add_argument("--only", choices=list(BLOCKS), help="run one part")
    chosen = parser.parse_args().only
    found = {name: make() for name, make in BLOCKS.items() if chosen in (None, name)}
    for name, content in found.items():
        print(f"\n{name}\n{content}")
    fill(PAGE, found)
