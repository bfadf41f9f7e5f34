"""Robots on legs on soil: round feet that sink deeper than their middles."""

import numpy as np
import pytest

from smartmesh_ros import BodyState, Sphere
from smartmesh_ros.soil.config import SoilType, soil_named
from studies.soil.trials import least, modulus_of
from tests import legged
from tests.soil.test_soil_world import world_on

# Of the feet of "anymal" [m].
RADIUS = 0.03


def foot_sinkage(soil: SoilType, radius: float, load: float) -> float:
    """Return the sinkage [m] at which a ball carries a ``load`` [N]: its pressures are those of plates as deep."""
    out = np.linspace(0.0, radius, 2001)
    higher = radius - np.sqrt(radius**2 - out**2)

    def carries(sinkage: float) -> bool:
        pressures = modulus_of(soil, 2.0 * radius) * np.maximum(sinkage - higher, 0.0) ** soil.Bekker_n
        return bool(np.trapezoid(pressures * 2.0 * np.pi * out, out) > load)

    return least(carries, 0.0, 10.0 * radius)


@pytest.mark.parametrize("rate", [60.0, 240.0])
@pytest.mark.parametrize("mass", [20.0, 40.0])
def test_a_ball_sinks_as_the_law_says_and_does_not_rock_deeper(mass: float, rate: float) -> None:
    """Soil is stiff where it leaves a flank, and soft where the ball presses it."""
    with world_on("lunar", rate=rate, sleep=False) as world:
        world.spawn("ball", Sphere(0.08), mass, BodyState((2.003, 2.007, 0.0)), on_ground=True)
        world.step(round(2.0 * rate))
        wanted = foot_sinkage(soil_named("lunar"), 0.08, 9.81 * mass)
        assert world.ground.on_soil()["ball"].sinkage == pytest.approx(wanted, rel=0.03)


@pytest.mark.parametrize("soil", ["dry_sand", "lunar"])
def test_a_quadruped_stands_still_on_feet_that_sink_as_the_law_says(soil: str) -> None:
    """Feet whose middles are below the ground of before are not lifted out of it."""
    with world_on(soil) as world:
        body = legged.set_up(world, "anymal", 2.0, 2.0, 0.005)
        world.step(480)
        links = range(-1, world.client.getNumJoints(body.uid))
        weight = 9.81 * sum(world.client.getDynamicsInfo(body.uid, link)[0] for link in links)
        sinkages = {name: found.sinkage for name, found in world.ground.on_soil().items()}
        assert len(sinkages) == 4 and max(sinkages.values()) > RADIUS
        means = dict.fromkeys(sinkages, 0.0)
        for _ in range(240):
            world.step()
            loads = {wrench.body: float(wrench.force[2]) for wrench in world.wrenches()}
            assert sum(loads.values()) == pytest.approx(weight, rel=0.03)
            means = {foot: mean + loads[foot] / 240.0 for foot, mean in means.items()}
        for foot, sinkage in sinkages.items():
            assert sinkage == pytest.approx(foot_sinkage(soil_named(soil), RADIUS, means[foot]), rel=0.1)
        for end in ("front", "hind"):  # it stands straight
            left, right = (sinkages[foot] for foot in sinkages if f"{end}_" in foot)
            assert left == pytest.approx(right, rel=0.015)
        world.step(720)
        assert world.rescues == 0 and world.is_asleep("anymal")
