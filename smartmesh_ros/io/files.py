"""Heights from files: NumPy arrays, PNG images, GeoTIFF and ESRI ASCII grids (through GDAL)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.errors import InputError
from smartmesh_ros.io import georeferenced
from smartmesh_ros.io.rasters import Raster, RasterConfig, from_image

GEOREFERENCED = (".tif", ".tiff", ".asc")
KINDS = (".npy", ".png", *GEOREFERENCED)


def load(path: str | Path, config: RasterConfig | None = None, max_samples: int = 64_000_000) -> Raster:
    """Return the surface in a file.

    ``config`` places ``.npy`` arrays, ``.png`` images (8 or 16 bit grey) and TIFF images without georeference. GeoTIFF
    and ESRI ASCII files contain their position, resolution, units and no-data value, and need rasterio. The size is
    checked before the values are read. Raises `InputError`.
    """
    path, config = Path(path).expanduser(), config or RasterConfig()
    if path.suffix.lower() not in KINDS:
        raise InputError("file", f"{path} has an unknown file type; terrain files end in {', '.join(KINDS)}")
    if not path.is_file():
        raise InputError("file", f"there is no file {path}")
    try:
        if path.suffix.lower() in GEOREFERENCED:
            return _georeferenced(path, config, max_samples)
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


def _georeferenced(path: Path, config: RasterConfig, max_samples: int) -> Raster:
    try:
        import rasterio
    except ModuleNotFoundError:
        raise _missing(path, "rasterio", "rasterio", "python3-rasterio") from None
    return georeferenced.read(rasterio, path, config, max_samples)


def _require_size(path: Path, shape: tuple[int, ...], max_samples: int) -> None:
    if len(shape) != 2:
        raise InputError("length", f"{path} has shape {shape}; heights must be (rows, columns)")
    if shape[0] * shape[1] > max_samples:
        raise InputError("size", f"{path} has {shape[0]} x {shape[1]} samples; the maximum is {max_samples}")


def _missing(path: Path, library: str, wheel: str, package: str) -> InputError:
    return InputError(
        "missing", f"{path} needs {library}, which is not installed; pip install {wheel}, or apt install {package}"
    )
