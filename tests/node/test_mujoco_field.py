"""Patches as height fields of MuJoCo, and the program of the page on other simulators."""

import subprocess
import sys
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from smartmesh_ros.errors import InputError
from smartmesh_ros.ground.quaternions import X, Y, Z, about, product
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.trimesh import grid_triangles
from smartmesh_ros.tools.client import Patch, write_field
from smartmesh_ros.tools.testing import TIMEOUT, Probe
from tests.bodies import rotation
from tests.node.shared import blocks

mujoco = pytest.importorskip("mujoco", reason="MuJoCo is not installed; scripts/workspace run dev view studies")

PAGE = "docs/other_simulators.md"
STEP = 0.1


def simulator(
    size: str = "10 10 2 1", samples: int = 33, mocap: str = "true", where: str = "0 0 1", pose: str = ""
) -> tuple[Any, Any]:
    model = mujoco.MjModel.from_xml_string(f"""
    <mujoco>
      <asset>
        <hfield name="other" nrow="5" ncol="5" size="1 1 1 1"/>
        <hfield name="ground" nrow="{samples}" ncol="{samples}" size="{size}"/>
      </asset>
      <worldbody>
        <body name="other" mocap="true" pos="0 0 -50"><geom type="hfield" hfield="other"/></body>
        <body name="ground" mocap="{mocap}"><geom type="hfield" hfield="ground" {pose}/></body>
        <body name="ball" pos="{where}"><freejoint/><geom size="0.2" mass="1"/></body>
      </worldbody>
    </mujoco>""")
    return model, mujoco.MjData(model)


def patch_of(heights: np.ndarray) -> Patch:
    """A patch whose first vertex is at the origin."""
    rows, columns = heights.shape
    y, x = STEP * np.mgrid[:rows, :columns]
    return Patch(
        name="wheel", kind="heightfield", tile="", row=0, column=0, stride=1, deviation=0.0, linear_w=np.zeros(3),
        angular_w=np.zeros(3), vertices_w=np.stack([x, y, heights], axis=-1).reshape(-1, 3),
        triangles=grid_triangles(rows, columns).astype(np.uint32),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("level", "roll", "holes"),
    [(0.0, 0.0, 0), (300.0, 0.0, 0), (-300.0, 0.0, 1), (0.0, 0.2, 0), (0.0, 0.5, 0), (0.0, 0.2, 1)],
)
def test_a_field_is_the_surface_of_its_patch(level: float, roll: float, holes: int) -> None:
    """Rays cast down on it hit the patch's triangles, wherever the patch lies and however it is turned, as on a deck
    that rolls and pitches; also at an edge, where its first rows are holes."""
    place, turn = (3.0, -2.0, 1.0), rotation(product(product(about(Z, 0.4), about(Y, 0.7 * roll)), about(X, roll)))
    heights = np.random.default_rng(2).normal(level, 0.0 if roll else 0.1, (6, 9))
    patch = patch_of(heights)
    vertices = patch.vertices_w @ turn.T + place
    vertices[: 9 * holes, 2] = np.nan
    model, data = simulator()
    write_field(model, data, "ground", replace(patch, vertices_w=vertices))
    mujoco.mj_forward(model, data)
    [geom] = np.flatnonzero(model.geom_bodyid == model.body("ground").id)
    flat = HeightMap(heights - level, resolution=STEP)
    for own in np.random.default_rng(3).uniform([0.01, 0.01 + STEP * holes], [0.79, 0.49], (50, 2)):
        at = turn @ (*own, level) + place + (0.0, 0.0, 5.0)
        distance = mujoco.mj_rayHfield(model, data, int(geom), at, np.array([0.0, 0.0, -1.0]), np.zeros(3))
        assert distance == pytest.approx(5.0 - flat.at([own], 0.0).heights[0], abs=2e-5)


@pytest.mark.parametrize("level", [-3.0, 300.0])
def test_a_ball_lies_on_ground_at_any_height_and_falls_through_holes(level: float) -> None:
    heights = np.full((9, 9), level)
    holes = heights.copy()
    holes[2:7, 2:7] = np.nan
    for ground, falls in ((heights, False), (holes, True), (np.full((9, 9), np.nan), True)):
        model, data = simulator(where=f"0.4 0.4 {level + 0.3}")
        write_field(model, data, "ground", patch_of(ground))
        mujoco.mj_step(model, data, 1000)
        height = data.body("ball").xpos[2] - level
        assert height < -0.1 if falls else height == pytest.approx(0.2, abs=1e-3)


@pytest.mark.parametrize(
    ("options", "relief", "message"),
    [
        ({"size": "10 10 0.5 1"}, 0.8, r"spans 0\.8 m .* elevation of 0\.5 m; make the third number of its size 0\.8"),
        ({"size": "0.5 0.5 2 1"}, 0.0, r"reaches 1 x 1 m .* compiled for 0\.5 x 0\.5 m; give it a size at least"),
        ({"samples": 16}, 0.0, r"takes 21 x 21 samples .* room for 256; give it nrow x ncol of 441 or more"),
        ({"mocap": "false"}, 0.0, r"on a body that cannot be moved; give it mocap='true'"),
        ({"pose": 'pos="0 0 0.3"'}, 0.0, "has a pose in its body, which is moved: leave its pos and its orientation"),
    ],
)
def test_what_would_lose_bodies_is_refused_and_nothing_is_written(
    options: dict[str, Any], relief: float, message: str
) -> None:
    heights = np.zeros((9, 9))
    heights[4, 4] = relief
    model, data = simulator(**options)
    before = model.hfield_data.copy(), data.mocap_pos.copy(), model.hfield_size.copy()
    with pytest.raises(InputError, match=message):
        write_field(model, data, "ground", patch_of(heights))
    for old, new in zip(before, (model.hfield_data, data.mocap_pos, model.hfield_size), strict=True):
        np.testing.assert_array_equal(old, new)


def test_an_unknown_field_and_a_patch_that_is_no_grid_are_refused() -> None:
    model, data = simulator()
    for name, words in (("soil", r"no height field 'soil'; it has \['other', 'ground'\]"), (2, "it has 2, from 0 on")):
        with pytest.raises(InputError, match=words):
            write_field(model, data, name, patch_of(np.zeros((9, 9))))
    with pytest.raises(InputError, match="is no grid, but triangles of a general mesh"):
        write_field(model, data, "ground", replace(patch_of(np.zeros((3, 3))), kind="trimesh"))


def test_the_program_of_the_page_runs_as_it_stands(probe: Probe) -> None:
    """In a bowl 3 m up: the ball comes to rest on its ground."""
    [program] = [code for code in blocks(PAGE, "python") if "import mujoco" in code]
    [command] = [text for text in blocks(PAGE, "bash") if "terrain_collider" in text]
    assert len(program.splitlines()) <= 32
    ros, run, package, collider, *arguments = command.split()
    assert [ros, run, package, collider] == ["ros2", "run", "smartmesh_ros", "terrain_collider"]
    x, y = np.meshgrid(*[0.1 * (np.arange(81) - 40)] * 2)
    bowl = 3.0 + 0.1 * (x * x + y * y)
    with probe.running(arguments=arguments) as node:
        simulation = subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True)

        def ended() -> bool:
            probe.publish_map(bowl, resolution=0.1, origin=(-4.0, -4.0, 0.0))
            return simulation.poll() is not None

        try:
            probe.wait_for(ended, timeout=2.0 * TIMEOUT, watch=node)
        finally:
            simulation.kill()
            output, _ = simulation.communicate()
    assert simulation.returncode == 0
    at_x, at_y, at_z = (float(word) for word in output.split()[-3:])
    assert at_z - 0.2 == pytest.approx(3.0 + 0.1 * (at_x**2 + at_y**2), abs=0.01)
