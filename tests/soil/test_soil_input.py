"""What the soil refuses."""

from pathlib import Path

import numpy as np
import pytest

from smartmesh_ros import HeightMap, InputError
from smartmesh_ros.patches.shapes import BodyShape, ball, box, capsule, cylinder, hull
from smartmesh_ros.soil.bodies import GivenBodies
from smartmesh_ros.soil.config import SoilConfig, SoilType
from smartmesh_ros.soil.soil import Load, Soil
from smartmesh_ros.soil.soils import soil_named, soils_of
from tests.bodies import TETRAHEDRON

SAND = {
    "Bekker_Kphi": 1e6, "Bekker_Kc": 0.0, "Bekker_n": 1.0, "Mohr_cohesion": 0.0, "Mohr_friction": 30.0,
    "Janosi_shear": 0.01,
}  # fmt: skip


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"Bekker_Kphi": -1.0}, "Bekker_Kphi is -1"),
        ({"Bekker_n": float("nan")}, "Bekker_n is nan"),
        ({"Mohr_friction": 90.0}, "Mohr_friction is 90"),
        ({"elastic_K": 5e5}, "not above Bekker_Kphi"),
    ],
)
def test_impossible_soils_are_refused(values: dict[str, float], words: str) -> None:
    with pytest.raises(InputError, match=words):
        SoilType(**{**SAND, **values})


def test_an_unknown_soil_is_refused_with_those_there_are() -> None:
    with pytest.raises(InputError, match="no soil 'cheese'; known: dry_sand"):
        soil_named("cheese")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("sand: {Bekker_Kphi: 1e6}", "lacks Bekker_Kc"),
        ("sand: {stiffness: 3}", "has no parameter 'stiffness'"),
        ("[1, 2]", "holds no soils"),
        ("sand: {", "cannot be read"),
    ],
)
def test_bad_files_are_refused(tmp_path: Path, text: str, words: str) -> None:
    file = tmp_path / "soils.yaml"
    file.write_text(text)
    with pytest.raises(InputError, match=words):
        soils_of(file)


@pytest.mark.parametrize(("name", "value"), [("flow", 1.5), ("slides", -1), ("load_time", float("inf"))])
def test_impossible_settings_are_refused(name: str, value: float) -> None:
    with pytest.raises(InputError, match=name):
        SoilConfig(**{name: value})  # type: ignore[arg-type]


def test_contacts_of_unknown_bodies_are_refused_and_change_nothing() -> None:
    ground = HeightMap(np.zeros((20, 20)), resolution=0.1)
    soil = Soil(ground, "lunar", GivenBodies())
    with pytest.raises(InputError, match="'ghost', which is no known body"):
        soil.press({"ghost": Load(10.0)}, 0.01, 0.01)
    assert soil.results() == {}
    assert not soil.layer.touched.any()


@pytest.mark.parametrize("kinds", [np.zeros((3, 3), np.uint8), np.full((20, 20), 2), np.zeros((20, 20))])
def test_maps_of_soils_that_do_not_fit_are_refused(kinds: np.ndarray) -> None:
    with pytest.raises(InputError, match="kinds"):
        Soil(HeightMap(np.zeros((20, 20))), ["lunar", "clay"], GivenBodies(), kinds=kinds)


@pytest.mark.parametrize(
    "shape",
    [
        box((1.0, 0.0, 1.0)), ball(-1.0), hull(TETRAHEDRON), cylinder(1.0, float("nan")), capsule(1e7, 1.0),
        capsule(1.0, -1.0),
    ],
)  # fmt: skip
def test_impossible_shapes_are_refused(shape: BodyShape) -> None:
    with pytest.raises(InputError, match=r"press the soil|dimensions"):
        GivenBodies().put("a", shape, (*(0.0,) * 6, 1.0, *(0.0,) * 6))


def test_impossible_states_are_refused() -> None:
    with pytest.raises(InputError, match="unit quaternion"):
        GivenBodies().put("a", ball(1.0), (0.0,) * 13)
