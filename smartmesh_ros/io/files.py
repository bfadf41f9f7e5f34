"""Heights from files: NumPy arrays, PNG images, GeoTIFF and ESRI ASCII grids (through GDAL)."""

from __future__ import annotations

import math
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.errors import InputError
from smartmesh_ros.io.rasters import GRID_TOLERANCE, FloatGrid, Raster, RasterConfig, from_cells, from_image, scaled
from smartmesh_ros.world.paths import expanded

GEOREFERENCED = (".tif", ".tiff", ".asc")
KINDS = (".npy", ".png", *GEOREFERENCED)


def load(path: str | Path, config: RasterConfig | None = None, max_samples: int = 64_000_000) -> Raster:
    """Return the surface in a file; its ``path`` may be a URI, or begin with ``~``.

    ``config`` places ``.npy`` arrays, ``.png`` images (8 or 16 bit grey) and TIFF images without georeference. GeoTIFF
    and ESRI ASCII files contain their position, resolution, units and no-data value, and need rasterio. The size is
    checked before the values are read. Raises `InputError`.
    """
    path, config = expanded(path), config or RasterConfig()
    if path.suffix.lower() not in KINDS:
        raise InputError("file", f"{path} has an unknown file type; terrain files end in {', '.join(KINDS)}")
    try:
        if not path.is_file():
            where = "" if path.is_absolute() else f" in {Path.cwd()}"
            raise InputError("file", f"there is no file {path}{where}")
        if path.suffix.lower() in GEOREFERENCED:
            return _georeferenced(path, config, max_samples)
        values = _array(path, max_samples) if path.suffix.lower() == ".npy" else _image(path, max_samples)
    except InputError:
        raise
    except Exception as error:  # noqa: BLE001  # those of the libraries and of the folder have no common base
        cause = error.__cause__ if path.suffix.lower() in GEOREFERENCED else None  # rasterio refers to it
        raise InputError("file", f"{path} cannot be read: {cause or error}") from None
    return from_image(values, config)


def _array(path: Path, max_samples: int) -> NDArray[Any]:
    try:
        mapped = np.load(path, mmap_mode="r", allow_pickle=False)
    except (ValueError, EOFError):  # NumPy's words propose to load it unsafely
        words = "cannot be read: it is no array of numbers; write one by numpy.save"
        raise InputError("file", f"{path} {words}") from None
    if not isinstance(mapped, np.ndarray):
        raise InputError("type", f"{path} is an archive of arrays, as of numpy.savez; write one array by numpy.save")
    _require_size(path, mapped.shape, max_samples)
    if mapped.dtype.kind not in "fiu":
        raise InputError("type", f"{path} holds {mapped.dtype}; heights must be real numbers")
    return np.asarray(mapped)


def _image(path: Path, max_samples: int) -> NDArray[Any]:
    try:
        from PIL.PngImagePlugin import PngImageFile
    except ModuleNotFoundError:
        raise _missing(path, "Pillow", "pillow", "python3-pil") from None
    with PngImageFile(path) as image:  # Image.open takes other formats too, and has a limit of its own
        _require_size(path, (image.height, image.width), max_samples)
        if image.mode not in ("L", "I", "I;16"):
            raise InputError("type", f"{path} is an image of mode {image.mode}; heights need 8 or 16 bit grey")
        return np.asarray(image)


def _require_size(path: Path, shape: tuple[int, ...], max_samples: int) -> None:
    if len(shape) != 2:
        raise InputError("length", f"{path} has shape {shape}; heights must be (rows, columns)")
    if shape[0] * shape[1] > max_samples:
        raise InputError("size", f"{path} has {shape[0]} x {shape[1]} samples; the maximum is {max_samples}")


def _missing(path: Path, library: str, wheel: str, package: str) -> InputError:
    return InputError(
        "missing", f"{path} needs {library}, which is not installed; pip install {wheel}, or apt install {package}"
    )


_FOOT, _SURVEY_FOOT = 0.3048, 1200.0 / 3937.0
# Lengths of units [m] by the names that files use for the unit of heights.
UNITS = {
    **dict.fromkeys(("m", "metre", "metres", "meter", "meters"), 1.0),
    **dict.fromkeys(("ft", "foot", "feet", "international foot"), _FOOT),
    **dict.fromkeys(("us survey foot", "us survey feet", "foot_us", "us-ft", "ftus", "sft"), _SURVEY_FOOT),
    **{"mm": 1e-3, "cm": 1e-2, "dm": 0.1, "km": 1e3, "kilometre": 1e3, "kilometer": 1e3, "centimetre": 1e-2},
}
# The transform of a file without one, (a, b, c, d, e, f): x = a column + b row + c, y = d column + e row + f.
NO_PLACE = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0)
# Mean change of height from sample to sample [cells] above which a map without a coordinate system is not in metres: a
# mean slope of 87 degrees. A grid in degrees exceeds it by far, because a degree is 111 km.
STEEPEST = 20.0
# Cells below which such a map is not in metres even if it is flat [m]: three seconds of arc are 0.00083 degrees.
SMALLEST = 1e-3


def _georeferenced(path: Path, config: RasterConfig, max_samples: int) -> Raster:
    """Return the surface in a file that contains its place and units, in metres. ``config`` converts the heights in
    metres, and places a file that contains no place. Raises `InputError`."""
    try:
        import rasterio
    except ModuleNotFoundError:
        raise _missing(path, "rasterio", "rasterio", "python3-rasterio") from None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", rasterio.errors.NotGeoreferencedWarning)
        with rasterio.open(path) as source:
            _require_size(path, (source.height, source.width), max_samples)
            band = _heights_band(path, source)
            horizontal = _unit(path, source.crs)
            config = _in_metres(path, source, band, horizontal, config)
            masked = source.read(band, masked=True)
            if source.driver == "AAIGrid" and source.nodata is None:
                masked = np.ma.masked_equal(masked, -9999)  # the default of the format, which GDAL ignores
            place, crs = np.array(source.transform[:6], np.float64), source.crs
            points = source.gcps[0] or source.rpcs
    with np.errstate(over="ignore"):  # a no-data value may be the lowest of float64
        values = masked.astype(np.float32).filled(np.nan)
    if np.array_equal(place, NO_PLACE):
        if crs is not None or points:
            raise InputError(
                "geometry", f"{path} has no transform from cells to metres; rectify it, e.g. with gdalwarp"
            )
        return from_image(values, config)
    raster = _placed(path, np.ascontiguousarray(scaled(values, config)[::-1]), *(horizontal * place).tolist())
    if crs is None:
        _require_metres(path, raster)
    return raster


def _heights_band(path: Path, source: Any) -> int:
    """Return the number of the one band with heights; a band of transparency marks missing heights."""
    kinds = [kind.name for kind in source.colorinterp]
    bands = [number for number, kind in enumerate(kinds, 1) if kind != "alpha"]
    if len(bands) != 1:
        raise InputError(
            "bands", f"{path} has {len(kinds)} bands ({', '.join(kinds)}); heights need a file of one band, as "
            "gdal_translate -b 1 makes of the first",
        )  # fmt: skip
    if kinds[bands[0] - 1] == "palette":
        raise InputError("bands", f"{path} holds numbers of colours, which are no heights; export the heights")
    if source.subdatasets:
        raise InputError("bands", f"{path} holds {len(source.subdatasets)} images; heights need a file of one")
    if "complex" in (kind := source.dtypes[bands[0] - 1]):
        raise InputError("type", f"{path} holds {kind}; heights must be real numbers")
    return bands[0]


def _unit(path: Path, crs: Any) -> float:
    """Return the length of the horizontal unit of a coordinate system [m]; without one, metres are assumed."""
    if crs is None:
        return 1.0
    if crs.is_geographic:
        raise InputError("geometry", f"{path} is in degrees ({crs}); reproject it to metres, e.g. to UTM")
    described = crs.to_dict(projjson=True)
    if described["type"] in ("GeodeticCRS", "VerticalCRS"):
        raise InputError("geometry", f"{path} has no horizontal axes ({crs}); reproject it to metres, e.g. to UTM")
    for part in described.get("components", ()):
        if part["coordinate_system"]["axis"][-1]["direction"] == "down":
            raise InputError("geometry", f"{path} holds depths ({part['name']}), which grow downwards; negate them")
    return float(crs.units_factor[1])


def _in_metres(path: Path, source: Any, band: int, horizontal: float, config: RasterConfig) -> RasterConfig:
    """Return the conversion of the values in a band to heights: its scale, offset and unit, then ``config``.

    Heights without a unit are in the unit of the coordinate system, as other programs take them.
    """
    name = (source.units[band - 1] or "").strip()
    unit = UNITS.get(name.lower()) if name else horizontal
    if unit is None:
        raise InputError("unit", f"{path} has heights in {name!r}, which is no known unit of length; convert them to m")
    scale, offset = source.scales[band - 1], source.offsets[band - 1]
    return replace(config, scale=config.scale * unit * scale, offset=config.scale * unit * offset + config.offset)


def _placed(path: Path, heights: FloatGrid, a: float, b: float, c: float, d: float, e: float, f: float) -> Raster:
    """Return heights, last row of the file first, as a raster. ``a`` to ``f``: its transform, see `NO_PLACE` [m].

    The raster's cells are the squares that fit best. Samples may be off by `GRID_TOLERANCE`.
    """
    rows, columns = heights.shape
    if a * e - b * d > 0.0:
        problem = "the first row must be at the top, where y is largest, e.g. as gdalwarp writes it"
        raise InputError("geometry", f"{path} has rows that do not run from top to bottom: {problem}")
    x, y = 0.5 * (a - e), 0.5 * (d + b)  # a step along columns; one along rows is that turned by -90 degrees
    resolution = math.hypot(x, y)
    off = 0.5 * (columns * math.hypot(a - x, d - y) + rows * math.hypot(b - y, e + x))
    if not off <= GRID_TOLERANCE * resolution:
        raise InputError(
            "geometry",
            f"{path} has cells that are not square: a column is ({a:g}, {d:g}) m, a row ({b:g}, {e:g}) m; resample it, "
            "e.g. with gdalwarp -tr",
        )
    middle = (0.5 * (a * columns + b * rows) + c, 0.5 * (d * columns + e * rows) + f)
    # Outer corner of the first cell in the last row.
    corner = (middle[0] - 0.5 * (columns * x - rows * y), middle[1] - 0.5 * (columns * y + rows * x), 0.0)
    return from_cells(heights, corner=corner, yaw=math.atan2(y, x), resolution=resolution)


def _require_metres(path: Path, raster: Raster) -> None:
    """Raise `InputError` if a map without a coordinate system cannot be in metres, but may be in degrees."""
    last_row, last_column = raster.geometry.rows - 1, raster.geometry.columns - 1
    corners = raster.geometry.to_world([0, 0, last_row, last_row], [0, last_column, 0, last_column])
    if (np.abs(corners).max(axis=0) > (360.0, 90.0)).any():
        return
    resolution = raster.geometry.resolution
    steps = [np.abs(np.diff(raster.heights, axis=axis)) for axis in (0, 1)]
    known = np.concatenate([step[np.isfinite(step)] for step in steps])
    steepness = float(known.mean(dtype=np.float64)) / resolution if len(known) else 0.0
    if steepness > STEEPEST or resolution < SMALLEST:
        raise InputError(
            "geometry",
            f"{path} has no coordinate system, cells of {resolution:g}, and heights that differ by {steepness:.3g} "
            "cells from sample to sample, so it must be in degrees; give it its coordinate system (a .prj file, or "
            "gdal_edit.py -a_srs EPSG:4326), and reproject it to metres",
        )
