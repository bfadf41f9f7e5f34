"""How scalar loops are compiled: the only place that knows Numba.

Without a working Numba the same functions run as Python, hundreds of times slower, and one warning says so.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar

P = ParamSpec("P")
R = TypeVar("R")

try:
    import numba
except Exception as error:  # noqa: BLE001  # Numba raises its own exceptions where it does not support the NumPy there is
    numba = None
    _PROBLEM = f"{type(error).__name__}: {error}"

_warnings: set[str] = set()


def compiled(function: Callable[P, R]) -> Callable[P, R]:
    """The function as machine code, kept on disk between runs; no fast-math, so that equal input gives equal bits.

    The cache lies beside the source, or in the user's cache folder where that cannot be written to.
    """
    if numba is None:
        _warn(
            f"Numba does not work here ({_PROBLEM}): smartmesh_ros runs several hundred times slower. Install it: "
            "apt install python3-numba, or pip install numba"
        )
        return function
    options: dict[str, Any] = {"error_model": "numpy"}
    try:
        return numba.njit(cache=True, **options)(function)  # type: ignore[no-any-return]
    except RuntimeError:  # no folder to keep it in
        _warn("Numba finds no folder to keep machine code in, so every start compiles again; set NUMBA_CACHE_DIR")
        return numba.njit(**options)(function)  # type: ignore[no-any-return]


def _warn(message: str) -> None:
    """Warns once."""
    if not _warnings:
        _warnings.add(message)
        warnings.warn(message, RuntimeWarning, stacklevel=3)
