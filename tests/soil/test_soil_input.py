"""What the soil refuses."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from smartmesh_ros import HeightMap, InputError, MotionConfig, Soil, SoilType
from smartmesh_ros.soil.config import soil_named, soils_of
from tests.grounds import level

SAND = {
    "Bekker_Kphi": 1e6, "Bekker_Kc": 0.0, "Bekker_n": 1.0, "Mohr_cohesion": 0.0, "Mohr_friction": 30.0,
    "Janosi_shear": 0.01,
}  # fmt: skip


def of_kinds(kinds: np.ndarray) -> Soil:
    return Soil(HeightMap(np.zeros((20, 20)), resolution=1.0), ["lunar", "clay"], kinds=kinds)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: SoilType(**{**SAND, "Bekker_Kphi": -1.0}), "Bekker_Kphi is -1"),
        (lambda: SoilType(**{**SAND, "Mohr_friction": 90.0}), "Mohr_friction is 90"),
        (lambda: SoilType(**{**SAND, "elastic_K": 5e5}), "not above Bekker_Kphi"),
        (lambda: soil_named("cheese"), "no soil 'cheese'; known: dry_sand"),
        (lambda: of_kinds(np.zeros((3, 3), np.uint8)), r"shape \(3, 3\)"),
        (lambda: of_kinds(np.full((20, 20), 2)), "kinds are up to 2"),
        (lambda: of_kinds(np.full((20, 20), 255)), "255 to 255"),
        (lambda: of_kinds(np.zeros((20, 20))), "whole numbers"),
        (lambda: Soil(level(), "lunar", spacing=0.0), "spacing"),
        (lambda: Soil(level(101, 10.0), "lunar"), r"on cells of 10 m; it must be above 0\.01 m"),
        (lambda: Soil(level(1000, 5.0), "lunar"), "raise spacing"),
        *((lambda soil=soil: Soil(level(), soil), "is no soil; give a SoilType") for soil in (5, [5], None)),
        (lambda: Soil(level(motion=MotionConfig(changes="correction")), "lunar"), "corrections"),
    ],
)
def test_what_cannot_be_is_refused(make: Callable[[], object], words: str) -> None:
    with pytest.raises(InputError, match=words):
        make()


def test_parameters_of_numpy_are_those_of_python() -> None:
    given = {name: np.float32(value) for name, value in SAND.items()}
    assert SoilType(**given) == SoilType(**{name: float(value) for name, value in given.items()})


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
