"""What the soil refuses."""

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from smartmesh_ros import HeightMap, InputError, MotionConfig
from smartmesh_ros.patches.shapes import BodyShape, ball, box, capsule, cylinder, hull
from smartmesh_ros.soil.bodies import GivenBodies
from smartmesh_ros.soil.config import SoilConfig, SoilType
from smartmesh_ros.soil.contact_soil import ContactSoil
from smartmesh_ros.soil.soil import Load, Soil
from smartmesh_ros.soil.soils import soil_named, soils_of
from tests.bodies import TETRAHEDRON
from tests.grounds import level

SAND = {
    "Bekker_Kphi": 1e6, "Bekker_Kc": 0.0, "Bekker_n": 1.0, "Mohr_cohesion": 0.0, "Mohr_friction": 30.0,
    "Janosi_shear": 0.01,
}  # fmt: skip


REST = (*(0.0,) * 6, 1.0, *(0.0,) * 6)  # of a body


def of_kinds(kinds: np.ndarray) -> Soil:
    return Soil(HeightMap(np.zeros((20, 20)), resolution=1.0), ["lunar", "clay"], GivenBodies(), kinds=kinds)


def with_shape(shape: BodyShape) -> None:
    GivenBodies().put("a", shape, REST)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: SoilType(**{**SAND, "Bekker_Kphi": -1.0}), "Bekker_Kphi is -1"),
        (lambda: SoilType(**{**SAND, "Bekker_n": math.nan}), "Bekker_n is nan"),
        (lambda: SoilType(**{**SAND, "Mohr_friction": 90.0}), "Mohr_friction is 90"),
        (lambda: SoilType(**{**SAND, "elastic_K": 5e5}), "not above Bekker_Kphi"),
        (lambda: soil_named("cheese"), "no soil 'cheese'; known: dry_sand"),
        (lambda: SoilConfig(flow=1.5), "flow"),
        (lambda: SoilConfig(slides=-1), "slides"),
        (lambda: SoilConfig(load_time=math.inf), "load_time"),
        (lambda: of_kinds(np.zeros((3, 3), np.uint8)), "kinds"),
        (lambda: of_kinds(np.full((20, 20), 2)), "kinds"),
        (lambda: of_kinds(np.zeros((20, 20))), "kinds"),
        (lambda: with_shape(box((1.0, 0.0, 1.0))), r"press the soil|dimensions"),
        (lambda: with_shape(ball(-1.0)), r"press the soil|dimensions"),
        (lambda: with_shape(hull(TETRAHEDRON)), r"press the soil|dimensions"),
        (lambda: with_shape(cylinder(1.0, math.nan)), r"press the soil|dimensions"),
        (lambda: with_shape(capsule(1e7, 1.0)), r"press the soil|dimensions"),
        (lambda: with_shape(capsule(1.0, -1.0)), r"press the soil|dimensions"),
        (lambda: GivenBodies().put("a", ball(1.0), (0.0,) * 13), "unit quaternion"),
        (lambda: ContactSoil(level(), "lunar", spacing=0.0), "spacing"),
        (lambda: ContactSoil(level(), "porridge"), "no soil"),
        (lambda: ContactSoil(level(101, 10.0), "lunar"), r"on cells of 10 m; it must be above 0\.01 m"),
        (lambda: ContactSoil(level(1000, 5.0), "lunar"), "raise spacing"),
        *((lambda soil=soil: ContactSoil(level(), soil), "is no soil; give a SoilType") for soil in (5, [5], None)),
        (lambda: ContactSoil(level(motion=MotionConfig(changes="correction")), "lunar"), "corrections"),
    ],
)
def test_what_cannot_be_is_refused(make: Callable[[], object], words: str) -> None:
    with pytest.raises(InputError, match=words):
        make()


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


def test_contacts_of_unknown_bodies_are_refused_and_change_nothing() -> None:
    ground = HeightMap(np.zeros((20, 20)), resolution=0.1)
    soil = Soil(ground, "lunar", GivenBodies())
    with pytest.raises(InputError, match="'ghost', which is no known body"):
        soil.press({"ghost": Load(10.0)}, 0.01, 0.01)
    assert soil.results() == {}
    assert not soil.layer.touched.any()
