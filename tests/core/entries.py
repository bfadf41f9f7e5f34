"""What tests give to functions of the core, and how it is spoilt."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from smartmesh_ros.core import CORE
from smartmesh_ros.terrain.motion import CLOCK

REFUSED = (TypeError, ValueError)
Arguments = dict[str, Any]
ROWS, COLUMNS = 70, 130  # of maps: several blocks, and parts of some

# What is hardly ever an array that the core can take.
SPOILT: dict[str, Callable[[np.ndarray], Any]] = {
    "None": lambda a: None,
    "list": lambda a: a.tolist(),
    "number": lambda a: 1.0,
    "other precision": lambda a: a.astype({"float32": np.float64, "float64": np.float32}.get(a.dtype.name, np.int64)),
    "integers": lambda a: a.astype(np.int32),
    "objects": lambda a: a.astype(object),
    "byte order": lambda a: a.astype(a.dtype.newbyteorder()) if a.dtype.itemsize > 1 else a.astype(">i2"),
    "strided": lambda a: np.repeat(a, 2, axis=-1)[..., ::2],
    "Fortran order": lambda a: np.asfortranarray(np.concatenate([a, a]))[: len(a)],
    "reversed": lambda a: a[::-1],
    "one axis fewer": lambda a: a[0],
    "one axis more": lambda a: a[None],
    "one row fewer": lambda a: a[:-1],
    "one column fewer": lambda a: np.ascontiguousarray(a[..., :-1]),
    "misaligned": lambda a: np.frombuffer(b"\0" + a.tobytes(), a.dtype, a.size, 1).reshape(a.shape),
    "empty": lambda a: a[:0],
    "empty rows": lambda a: np.ascontiguousarray(a[..., :0]),
    "huge without memory": lambda a: np.broadcast_to(a.ravel()[:1], (1 << 20,) * a.ndim),
}


class Entry(NamedTuple):
    """A function of the core, and what makes its arguments anew.

    ``written``: arrays that it writes to. ``rows``: arrays of any number of rows. ``any_shape``: arrays of any shape.
    ``optional``: arguments that may be None. ``within``: arguments that name rows of a table, and how many it has.
    ``finite``: numbers, and arrays of numbers, that must be finite.
    """

    function: Callable[..., Any]
    made: Callable[[], Arguments]
    written: tuple[str, ...] = ()
    rows: tuple[str, ...] = ()
    any_shape: tuple[str, ...] = ()
    optional: tuple[str, ...] = ()
    within: tuple[tuple[str, int], ...] = ()
    finite: tuple[str, ...] = ()

    def arrays(self) -> list[str]:
        return [name for name, value in self.made().items() if isinstance(value, np.ndarray)]

    def fits(self, name: str, spoilt: Any, right: np.ndarray) -> bool:
        """Return True if a spoilt array is as good as the right one."""
        if not isinstance(spoilt, np.ndarray):
            return spoilt is None and name in self.optional
        if (spoilt.dtype, spoilt.ndim) != (right.dtype, right.ndim):
            return False
        if not (spoilt.flags.c_contiguous and spoilt.flags.aligned):
            return False
        same_rows = name in self.rows or len(spoilt) == len(right)
        return name in self.any_shape or (same_rows and spoilt.shape[1:] == right.shape[1:])


def new_grid(**fields: float) -> Any:
    """Return a height map of the core, with these fields in its clocks."""
    grid = CORE.Grid(ROWS, COLUMNS)
    grid.clocks[...] = clock_bytes(*grid.clocks.shape[:2], **fields)
    return grid


def clock_bytes(*shape: int, **fields: float) -> np.ndarray:
    """Return clocks of these fields as the core takes them."""
    clocks = np.zeros(shape, CLOCK)
    for name, value in fields.items():
        clocks[name] = value
    return clocks.view(np.uint8).reshape(*shape, CLOCK.itemsize)


def grid_of(heights: np.ndarray, resolution: float = 0.1) -> Any:
    """Return a height map of the core whose first sample is at the origin."""
    grid = CORE.Grid(*heights.shape)
    grid.heights[...] = heights
    grid.place(0.0, 0.0, 0.0, 0.0, resolution)
    return grid
