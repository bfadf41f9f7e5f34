"""Compilation of scalar loops."""

from typing import Any

import numba

OPTIONS = {"nopython": True, "error_model": "numpy", "no_cfunc_wrapper": True}


def compiled(function: Any) -> Any:
    """Return the function as machine code."""
    return numba.jit(**OPTIONS)(function)


def inlined(function: Any) -> Any:
    """Return the function as machine code that is copied into its callers."""
    return numba.jit(forceinline=True, **OPTIONS)(function)
