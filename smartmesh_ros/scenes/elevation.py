"""A real elevation model: the Jacksboro fault, from Matplotlib's sample data (344 x 403 samples)."""

from typing import Any

import numpy as np
from numpy.typing import NDArray


def jacksboro_fault(relief: float | None = None) -> NDArray[np.float32]:
    """Return elevations (344, 403) [m], rows northwards along +y, as measured or scaled to 0 .. ``relief`` [m].

    Raises `ModuleNotFoundError` if Matplotlib is not installed.
    """
    from matplotlib.cbook import get_sample_data

    data: Any = get_sample_data("jacksboro_fault_dem.npz")
    with data:
        elevation = np.asarray(data["elevation"], np.float32)[::-1]  # the file's rows run southwards
    if relief is not None:
        low, high = float(elevation.min()), float(elevation.max())
        elevation = (elevation - low) * np.float32(relief / (high - low))
    return np.ascontiguousarray(elevation, np.float32)
