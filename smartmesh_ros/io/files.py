"""Heights from files: NumPy arrays, PNG images, GeoTIFF and ESRI ASCII grids (through GDAL)."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.errors import InputError
from smartmesh_ros.io.rasters import Raster, RasterConfig, from_cells, from_image, scaled

GEOGRAPHIC = (".tif", ".tiff", ".asc")
KINDS = (".npy", ".png", *GEOGRAPHIC)


def load(path: str | Path, config: RasterConfig | None = None, max_samples: int = 64_000_000) -> Raster:
    """Return the surface in a file.

    ``config`` places ``.npy`` arrays and ``.png`` images (8 or 16 bit grey). GeoTIFF and ESRI ASCII files contain their
    position, their resolution in metres and their no-data value, and need rasterio. The size is checked before the
    values are read. Raises `InputError`.
    """
    path, config = Path(path).expanduser(), config or RasterConfig()
    if path.suffix.lower() not in KINDS:
        raise InputError("file", f"{path} has an unknown file type; terrain files end in {', '.join(KINDS)}")
    if not path.is_file():
        raise InputError("file", f"there is no file {path}")
    try:
        if path.suffix.lower() in GEOGRAPHIC:
            return _geographic(path, config, max_samples)
        values = _array(path, max_samples) if path.suffix.lower() == ".npy" else _image(path, max_samples)
    except (OSError, ValueError, EOFError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError("file", f"{path} cannot be read: {error}") from None
    return from_image(values, config)


def _array(path: Path, max_samples: int) -> NDArray[Any]:
    mapped = np.load(path, mmap_mode="r", allow_pickle=False)
    _require_size(path, mapped.shape, max_samples)
    if mapped.dtype.kind not in "fiu":
        raise InputError("type", f"{path} holds {mapped.dtype}; heights must be real numbers")
    return np.asarray(mapped)


def _image(path: Path, max_samples: int) -> NDArray[Any]:
    try:
        from PIL import Image
    except ModuleNotFoundError:
        raise _missing(path, "Pillow", "pillow", "python3-pil") from None
    with Image.open(path) as image:
        _require_size(path, (image.height, image.width), max_samples)
        if image.mode not in ("L", "I", "I;16", "F"):
            raise InputError("type", f"{path} is an image of mode {image.mode}; heights need 8 or 16 bit grey")
        return np.asarray(image)


def _geographic(path: Path, config: RasterConfig, max_samples: int) -> Raster:
    try:
        import rasterio
    except ModuleNotFoundError:
        raise _missing(path, "rasterio", "rasterio", "python3-rasterio") from None
    with rasterio.open(path) as source:
        _require_size(path, (source.height, source.width), max_samples)
        if source.crs is not None and source.crs.is_geographic:
            raise InputError("geometry", f"{path} is in degrees ({source.crs}); reproject it to metres, e.g. to UTM")
        place = source.transform
        resolution = math.hypot(place.a, place.d)
        # Rows run from top to bottom: the second axis must be the first one rotated by -90 degrees.
        skew = math.hypot(place.b - place.d, place.e + place.a)
        if not skew <= 1e-6 * resolution:
            problem = "cells that are not square, or rows that do not run from top to bottom"
            raise InputError("geometry", f"{path} has {problem}: {tuple(place)[:6]}")
        values = source.read(1, masked=True).astype(np.float32).filled(np.nan)
    heights = np.ascontiguousarray(scaled(values, config)[::-1])
    # Outer corner of the first cell in the last row.
    corner = (place.b * len(heights) + place.c, place.e * len(heights) + place.f, 0.0)
    return from_cells(heights, corner=corner, yaw=math.atan2(place.d, place.a), resolution=resolution)


def _require_size(path: Path, shape: tuple[int, ...], max_samples: int) -> None:
    if len(shape) != 2:
        raise InputError("length", f"{path} has shape {shape}; heights must be (rows, columns)")
    if shape[0] * shape[1] > max_samples:
        raise InputError("size", f"{path} has {shape[0]} x {shape[1]} samples; the maximum is {max_samples}")


def _missing(path: Path, library: str, wheel: str, package: str) -> InputError:
    return InputError(
        "missing", f"{path} needs {library}, which is not installed; pip install {wheel}, or apt install {package}"
    )
