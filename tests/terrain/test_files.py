"""Terrain from files."""

import re
import struct
import sys
import warnings
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from PIL import Image
from rasterio.control import GroundControlPoint
from rasterio.enums import ColorInterp
from rasterio.transform import Affine

from smartmesh_ros import HeightMap, InputError
from smartmesh_ros.io.files import load
from smartmesh_ros.io.rasters import RasterConfig

HEIGHTS = np.arange(12, dtype=np.float32).reshape(3, 4)  # first row at the top
HEAD = "ncols 4\nnrows 3\nxllcorner 100.0\nyllcorner 200.0\ncellsize 5.0\nNODATA_value -9999\n"  # of an ASCII grid


def height_at(raster: Any, x: float, y: float) -> float:
    return float(HeightMap(raster.heights, geometry=raster.geometry).at([[x, y]], 0.0).heights[0])


def test_arrays_pictures_and_tiffs_without_a_place_are_placed_and_scaled_by_the_configuration(
    tmp_path: Path, recwarn: pytest.WarningsRecorder
) -> None:
    np.save(tmp_path / "a.npy", HEIGHTS)
    Image.fromarray(HEIGHTS.astype(np.uint8)).save(tmp_path / "b.png")
    Image.fromarray((HEIGHTS * 1000).astype(np.uint16)).save(tmp_path / "c.png")
    write_tiff(tmp_path / "d.tif", None, None, nodata=None)
    for name, scale in (("a.npy", 1.0), ("b.png", 1.0), ("c.png", 0.001), ("d.tif", 1.0)):
        placed = {"resolution": 2.0, "origin": (10.0, 20.0, 5.0)}
        raster = load(tmp_path / name, RasterConfig(scale=scale, offset=0.5, **placed))
        assert height_at(raster, 10.0, 24.0) == pytest.approx(5.5)
        assert height_at(raster, 16.0, 24.0) == pytest.approx(8.5)
        assert height_at(raster, 10.0, 20.0) == pytest.approx(13.5)
        holed = load(tmp_path / name, RasterConfig(scale=scale, offset=0.5, zero_is_hole=True, first_row="bottom"))
        assert np.array_equal(np.isnan(holed.heights), HEIGHTS == 0.0)
    assert not recwarn.list


@pytest.mark.parametrize("head", [HEAD, HEAD.replace("NODATA_value -9999\n", "")])
def test_an_esri_ascii_grid_brings_its_place_and_its_holes(tmp_path: Path, head: str) -> None:
    """The value of missing heights is -9999 unless the file names another."""
    file = tmp_path / "dem.asc"
    file.write_text(head + "0 1 2 3\n4 5 6 7\n8 9 -9999 11\n")
    raster = load(file)
    assert height_at(raster, 102.5, 212.5) == 0.0  # the middle of the first cell
    assert height_at(raster, 117.5, 212.5) == 3.0
    assert height_at(raster, 102.5, 202.5) == 8.0
    assert np.isnan(height_at(raster, 112.5, 202.5))


def write_tiff(
    path: Path,
    transform: Affine | None,
    crs: str | None = "EPSG:32633",
    *,
    heights: Any = HEIGHTS,
    units: Any = None,
    scaling: tuple[float, float] | None = None,
    **options: Any,
) -> Path:
    rows, columns = heights.shape
    given = {"count": 1, "dtype": "float32", "nodata": 7.0, "crs": crs, "transform": transform} | options
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # rasterio warns of files without georeference
        with rasterio.open(path, "w", driver="GTiff", height=rows, width=columns, **given) as target:
            for band in range(1, target.count + 1):
                target.write(heights.astype(given["dtype"]), band)
            if units is not None:
                target.units = units
            if scaling is not None:
                target.scales, target.offsets = ((value,) for value in scaling)
    return path


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"first_row": "botom"}, r"first_row is 'botom'; it must be one of \('top', 'bottom'\)"),
        ({"first_row": HEIGHTS}, r"it must be one of \('top', 'bottom'\)"),
        ({"scale": "2"}, "scale is '2'; it must be a finite number"),
        ({"origin": "abc"}, "the origin is 'abc'; it must be three finite numbers"),
        ({"origin": None}, "the origin is None; it must be three finite numbers"),
        ({"zero_is_hole": HEIGHTS}, "it must be True or False"),
        *(({"material_layers": given}, "a list of texts such as 'friction=slip'") for given in (5, [5], "friction")),
    ],
)
def test_a_configuration_that_means_nothing_is_refused(wrong: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError, match=words):
        RasterConfig(**wrong)


UTM, FEET, SURVEY = "EPSG:32633", 0.3048, 1200 / 3937  # [m]


@pytest.mark.parametrize(
    ("crs", "units", "scaling", "horizontal", "vertical", "level"),
    [
        ("EPSG:3089", None, None, SURVEY, SURVEY, 0.0),  # US survey feet; heights too, as nothing else is said
        ("EPSG:2222", None, None, FEET, FEET, 0.0),  # international feet
        ("EPSG:2227+5703", None, None, SURVEY, 1.0, 0.0),  # heights in metres
        ("EPSG:32633+8228", None, None, 1.0, FEET, 0.0),  # heights in feet
        (UTM, "ft", None, 1.0, FEET, 0.0),
        (UTM, "US survey foot", None, 1.0, SURVEY, 0.0),
        (UTM, "cm", None, 1.0, 0.01, 0.0),
        (None, "Meter", None, 1.0, 1.0, 0.0),
        ('LOCAL_CS["plan",UNIT["foot",0.3048]]', None, None, FEET, FEET, 0.0),
        (UTM, None, (0.5, 100.0), 1.0, 0.5, 100.0),
        ("EPSG:3089", "ft", (0.5, 100.0), SURVEY, 0.5 * FEET, 100.0 * FEET),
        (UTM, None, (0.1, -1e7), 1.0, 0.1, -1e7),
    ],
)
def test_units_scale_and_offset_of_a_geotiff_are_converted_to_metres(
    tmp_path: Path, crs: str | None, units: str | None, scaling: Any, horizontal: float, vertical: float, level: float
) -> None:
    """The parameters then apply to metres."""
    place = Affine.translation(5000.0, 3000.0) @ Affine.scale(30.0, -30.0)
    file = write_tiff(
        tmp_path / "dem.tif", place, crs, units=units and (units,), scaling=scaling, dtype="int16", nodata=7
    )
    raster = load(file, RasterConfig(scale=2.0, offset=-2.0 * level + 1.0))
    assert raster.geometry.resolution == pytest.approx(30.0 * horizontal, rel=1e-9)
    first = raster.geometry.to_world(2, 0)
    assert first == pytest.approx((5015.0 * horizontal, 2985.0 * horizontal), rel=1e-9)
    wanted = np.where(HEIGHTS == 7, np.nan, 2.0 * vertical * HEIGHTS + 1.0)[::-1]
    assert raster.heights == pytest.approx(wanted, rel=1e-6, nan_ok=True)


@pytest.mark.parametrize(("kind", "nodata"), [("float64", np.finfo(np.float64).min), ("int16", -32768)])
def test_no_data_values_of_any_type_are_holes_without_a_word(
    tmp_path: Path, kind: str, nodata: float, recwarn: pytest.WarningsRecorder
) -> None:
    heights = np.where(HEIGHTS == 5, nodata, HEIGHTS)
    file = write_tiff(tmp_path / "dem.tif", Affine.scale(2.0, -2.0), heights=heights, dtype=kind, nodata=nodata)
    assert np.array_equal(np.isnan(load(file).heights[::-1]), HEIGHTS == 5)
    assert not recwarn.list


def test_transparency_marks_holes(tmp_path: Path) -> None:
    file = write_tiff(tmp_path / "dem.tif", Affine.scale(2.0, -2.0), count=2, dtype="uint8", nodata=None)
    with rasterio.open(file, "r+") as target:
        target.colorinterp = (ColorInterp.gray, ColorInterp.alpha)
        target.write(np.where(HEIGHTS == 5, 0, 255).astype(np.uint8), 2)
    heights = load(file).heights[::-1]
    assert np.array_equal(np.isnan(heights), HEIGHTS == 5)
    assert np.array_equal(heights[HEIGHTS != 5], HEIGHTS[HEIGHTS != 5])


@pytest.mark.parametrize(("error", "is_taken"), [(13e-6, True), (1e-4, True), (1e-3, False)])
def test_cells_may_be_turned_and_as_oblong_as_their_samples_stay_in_place(
    tmp_path: Path, error: float, is_taken: bool
) -> None:
    heights = np.arange(718.0 * 300.0).reshape(718, 300)
    place = Affine.translation(1e5, 2e6) @ Affine.rotation(20.0) @ Affine.scale(300.0, -300.0 * (1.0 + error))
    file = write_tiff(tmp_path / "dem.tif", place, heights=heights)
    if not is_taken:
        with pytest.raises(InputError, match="not square"):
            load(file)
        return
    raster = load(file)
    for row, column in ((0, 0), (0, 299), (717, 0), (717, 299), (300, 100)):
        off = raster.geometry.to_world(717 - row, column) - np.array(place @ (column + 0.5, row + 0.5))
        assert np.hypot(*off) <= 0.1 * 300.0
        assert raster.heights[717 - row, column] == heights[row, column]


@pytest.mark.parametrize(
    ("cell", "grade"),
    [(1 / 10800, 0.01), (1 / 1200, 0.01), (1 / 1200, 0.0), (1 / 120, 0.01), (1 / 60, 0.01), (0.25, 0.01)],
)
@pytest.mark.parametrize("suffix", [".asc", ".tif"])
def test_degrees_without_a_coordinate_system_are_refused(
    tmp_path: Path, suffix: str, cell: float, grade: float
) -> None:
    heights = grade * 111_000 * cell * np.arange(24.0).reshape(4, 6)
    with pytest.raises(InputError, match="degrees"):
        load(write_grid(tmp_path / f"dem{suffix}", cell, (-105.56, 40.09), heights))
    # The same in a plan's coordinates, far from those of the globe, is steep and not in degrees.
    if cell > 1e-3:
        assert load(write_grid(tmp_path / f"far{suffix}", cell, (5e5, 4e6), heights)).geometry.rows == 4


def write_grid(path: Path, cell: float, corner: tuple[float, float], heights: Any) -> Path:
    rows, columns = heights.shape
    if path.suffix == ".tif":
        place = Affine.translation(corner[0], corner[1] + rows * cell) @ Affine.scale(cell, -cell)
        return write_tiff(path, place, None, heights=heights, nodata=None)
    head = f"ncols {columns}\nnrows {rows}\nxllcorner {corner[0]}\nyllcorner {corner[1]}\ncellsize {cell:.12g}\n"
    path.write_text(head + "\n".join(" ".join(f"{value:.6f}" for value in row) for row in heights) + "\n")
    return path


@pytest.mark.parametrize("cell", [0.002, 0.01, 0.05, 1.0])
def test_small_maps_in_metres_without_a_coordinate_system_are_taken(tmp_path: Path, cell: float) -> None:
    """Stairs of 17 cm, and gravel as steep as 60 degrees."""
    x = np.arange(200) * cell
    stairs = np.tile(0.17 * np.floor(x / 0.3), (50, 1))
    gravel = 1.7 * cell * np.random.default_rng(1).uniform(size=(50, 200))
    for heights in (stairs, gravel):
        raster = load(write_grid(tmp_path / "dem.asc", cell, (0.0, 0.0), heights))
        assert raster.heights[::-1] == pytest.approx(heights, abs=1e-5)
        assert raster.geometry.resolution == pytest.approx(cell, rel=1e-9)


SQUARE = Affine.scale(2.0, -2.0)
CORNERS = [GroundControlPoint(row, column, 2.0 * column, -2.0 * row) for row in (0, 3) for column in (0, 4)]


def palette(path: Path) -> None:
    with rasterio.open(write_tiff(path, SQUARE, dtype="uint8"), "r+") as target:
        target.write_colormap(1, {0: (0, 0, 0, 255), 1: (255, 0, 0, 255)})


def tiff(transform: Affine | None = SQUARE, *crs: str, **options: Any) -> Any:
    return lambda path: write_tiff(path, transform, *crs, **options)


def array(values: Any) -> Any:
    return lambda path: np.save(path, values, allow_pickle=True)


def picture(*chunks: tuple[bytes, bytes]) -> bytes:
    """The bytes of a PNG with chunks of these names and contents."""
    packed = [struct.pack(">I", len(c)) + n + c + struct.pack(">I", zlib.crc32(n + c)) for n, c in chunks]
    return b"\x89PNG\r\n\x1a\n" + b"".join(packed)


HUGE = picture((b"IHDR", struct.pack(">IIBBBBB", 30_000, 30_000, 8, 0, 0, 0, 0)), (b"IEND", b""))
SPOILT = picture((b"IHDR", struct.pack(">IIBBBBB", 9, 9, 8, 0, 0, 0, 0)), (b"IDAT", b""), (b"\x8bz\xebi", b""))


# Files that cannot be terrain by name: what writes them, and words of the refusal.
WRONG: dict[str, tuple[Any, str]] = {
    "absent.npy": (lambda path: None, "there is no file"),
    f"{300 * 'n'}.npy": (lambda path: None, "cannot be read"),
    "map.stl": (lambda path: None, "unknown file type"),
    "cube.npy": (array(np.zeros((3, 3, 3))), "shape"),
    "words.npy": (array([["a", "b"], ["c", "d"]]), "real numbers"),
    "objects.npy": (array(np.array([[{}, {}], [{}, {}]], object)), "no array of numbers; write one by numpy.save"),
    "empty.npy": (lambda path: path.write_bytes(b""), "cannot be read: it is no array of numbers; write one by"),
    "archive.npy": (lambda path: np.savez(path.open("wb"), HEIGHTS), "an archive of arrays"),
    "large.npy": (array(np.zeros((200, 200))), "200 x 200"),
    "large.tif": (tiff(heights=np.zeros((200, 200))), "200 x 200"),
    "colour.png": (Image.new("RGB", (4, 4)).save, "RGB"),
    "huge.png": (lambda path: path.write_bytes(HUGE), "30000 x 30000 samples; the maximum is"),
    "photo.png": (lambda path: Image.new("L", (4, 4)).save(path, "JPEG"), "not a PNG file"),
    "spoilt.png": (lambda path: path.write_bytes(SPOILT), "broken PNG file"),
    "broken.png": (lambda path: path.write_bytes(b"\x89PNG\r\n\x1a\nnothing"), "cannot be read"),
    "broken.npy": (lambda path: path.write_bytes(b"nothing"), "cannot be read: it is no array of numbers; write one"),
    "broken.tif": (lambda path: path.write_bytes(b"nothing"), "cannot be read"),
    "short.asc": (lambda path: path.write_text(HEAD + "0 1 2 3\n4 5 6\n"), "cannot be read: .*File short"),
    "degrees.tif": (tiff(SQUARE, "EPSG:4326"), "reproject"),
    "oblong.tif": (tiff(Affine.scale(2.0, -3.0)), "not square"),
    "upside_down.tif": (tiff(Affine.scale(2.0, 2.0)), "top to bottom"),
    "sheared.tif": (tiff(Affine.shear(10.0) @ SQUARE), "not square"),
    "earth_centred.tif": (tiff(SQUARE, "EPSG:4978"), "no horizontal axes"),
    "depths.tif": (tiff(SQUARE, "EPSG:32633+5715", GEOTIFF_VERSION="1.1"), "grow downwards"),
    "parsecs.tif": (tiff(units=("parsec",)), "'parsec'"),
    "photo.tif": (tiff(count=3, dtype="uint8"), r"3 bands \(red, green, blue\)"),
    "two.tif": (tiff(count=2), "2 bands"),
    "complex.tif": (tiff(dtype="complex64", nodata=None), "real numbers"),
    "no_place.tif": (tiff(None), "gdalwarp"),
    "points.tif": (tiff(None, gcps=CORNERS), "gdalwarp"),
    "palette.tif": (palette, "numbers of colours"),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_cannot_be_terrain_is_refused_by_name(tmp_path: Path, name: str) -> None:
    write, words = WRONG[name]
    write(tmp_path / name)
    with pytest.raises(InputError, match=words):
        load(tmp_path / name, max_samples=10_000)


def test_a_file_that_is_not_there_is_refused_with_the_folder_in_which_it_was_looked_for() -> None:
    """That is the folder itself where no user has the name after the tilde."""
    with pytest.raises(InputError, match=f"there is no file ~nobody_here/dem.npy in {re.escape(str(Path.cwd()))}$"):
        load("~nobody_here/dem.npy")


def test_without_rasterio_it_is_said_how_to_install_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = write_tiff(tmp_path / "dem.tif", SQUARE)
    monkeypatch.setitem(sys.modules, "rasterio", None)
    with pytest.raises(InputError, match="pip install rasterio"):
        load(file)
