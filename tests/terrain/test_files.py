"""Terrain from files."""

import sys
from pathlib import Path

import numpy as np
import pytest
import rasterio
from PIL import Image
from rasterio.transform import Affine

from smartmesh_ros.errors import InputError
from smartmesh_ros.io.files import load
from smartmesh_ros.io.rasters import Raster, RasterConfig
from smartmesh_ros.terrain.heightmap import HeightMap

HEIGHTS = np.arange(12, dtype=np.float32).reshape(3, 4)  # first row at the top


def at(raster: Raster, x: float, y: float) -> float:
    return float(HeightMap(raster.heights, geometry=raster.geometry).at([[x, y]], 0.0).heights[0])


def test_arrays_and_pictures_are_placed_by_the_configuration(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", HEIGHTS)
    Image.fromarray(HEIGHTS.astype(np.uint8)).save(tmp_path / "b.png")
    Image.fromarray((HEIGHTS * 1000).astype(np.uint16)).save(tmp_path / "c.png")
    for name, scale in (("a.npy", 1.0), ("b.png", 1.0), ("c.png", 0.001)):
        raster = load(tmp_path / name, RasterConfig(scale=scale, resolution=2.0, origin=(10.0, 20.0, 0.0)))
        assert at(raster, 10.0, 24.0) == pytest.approx(0.0)
        assert at(raster, 16.0, 24.0) == pytest.approx(3.0)
        assert at(raster, 10.0, 20.0) == pytest.approx(8.0)


def test_an_esri_ascii_grid_brings_its_place_and_its_holes(tmp_path: Path) -> None:
    file = tmp_path / "dem.asc"
    file.write_text(
        "ncols 4\nnrows 3\nxllcorner 100.0\nyllcorner 200.0\ncellsize 5.0\nNODATA_value -9999\n"
        "0 1 2 3\n4 5 6 7\n8 9 -9999 11\n"
    )
    raster = load(file)
    assert at(raster, 102.5, 212.5) == 0.0  # the middle of the first cell
    assert at(raster, 117.5, 212.5) == 3.0
    assert at(raster, 102.5, 202.5) == 8.0
    assert np.isnan(at(raster, 112.5, 202.5))


def write_tiff(path: Path, transform: Affine, crs: str = "EPSG:32633") -> Path:
    with rasterio.open(
        path, "w", driver="GTiff", height=3, width=4, count=1, dtype="float32", crs=crs, transform=transform, nodata=7.0
    ) as target:
        target.write(HEIGHTS, 1)
    return path


def test_a_geotiff_may_be_turned(tmp_path: Path) -> None:
    place = Affine.translation(1000.0, 2000.0) @ Affine.rotation(30.0) @ Affine.scale(2.0, -2.0)
    raster = load(write_tiff(tmp_path / "dem.tif", place))
    assert raster.geometry.yaw == pytest.approx(np.pi / 6)
    for row in range(3):
        for column in range(4):
            x, y = place @ (column + 0.5, row + 0.5)
            wanted = HEIGHTS[row, column] if HEIGHTS[row, column] != 7.0 else np.nan
            cell = np.rint(raster.geometry.to_grid(np.array([x, y])))
            assert np.abs(raster.geometry.to_grid(np.array([x, y])) - cell).max() < 1e-6
            assert raster.heights[*cell.astype(int)] == pytest.approx(wanted, nan_ok=True)


def test_what_cannot_be_terrain_is_refused_by_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    square = Affine.scale(2.0, -2.0)
    np.save(tmp_path / "cube.npy", np.zeros((3, 3, 3)))
    np.save(tmp_path / "words.npy", np.array([["a", "b"], ["c", "d"]]))
    np.save(tmp_path / "objects.npy", np.array([[{}, {}], [{}, {}]], object), allow_pickle=True)
    np.save(tmp_path / "large.npy", np.zeros((200, 200)))
    Image.new("RGB", (4, 4)).save(tmp_path / "colour.png")
    (tmp_path / "broken.png").write_bytes(b"\x89PNG\r\n\x1a\nnothing")
    (tmp_path / "broken.npy").write_bytes(b"nothing")
    (tmp_path / "broken.tif").write_bytes(b"nothing")
    write_tiff(tmp_path / "degrees.tif", square, "EPSG:4326")
    write_tiff(tmp_path / "oblong.tif", Affine.scale(2.0, -3.0))
    write_tiff(tmp_path / "upside_down.tif", Affine.scale(2.0, 2.0))
    for name, words in (
        ("absent.npy", "there is no file"),
        ("map.stl", "unknown file type"),
        ("cube.npy", "shape"),
        ("words.npy", "real numbers"),
        ("objects.npy", "cannot be read"),
        ("large.npy", "200 x 200"),
        ("colour.png", "RGB"),
        ("broken.png", "cannot be read"),
        ("broken.npy", "cannot be read"),
        ("broken.tif", "cannot be read"),
        ("degrees.tif", "reproject"),
        ("oblong.tif", "not square"),
        ("upside_down.tif", "top to bottom"),
    ):
        with pytest.raises(InputError, match=words):
            load(tmp_path / name, max_samples=10_000)
    monkeypatch.setitem(sys.modules, "rasterio", None)
    with pytest.raises(InputError, match="pip install rasterio"):
        load(tmp_path / "degrees.tif")
