"""Checks of sizes that all adapters share, made before memory is taken."""

from smartmesh_ros.errors import InputError


def require_cells(cells: int, max_samples: int) -> None:
    """Raises `InputError` where there are more cells than allowed."""
    if cells > max_samples:
        raise InputError("size", f"{cells} samples are more than terrain.max_samples = {max_samples}")


def require_length(what: str, actual: int, wanted: int) -> None:
    """Raises `InputError` where there is not as much data as the sizes say."""
    if actual != wanted:
        raise InputError("length", f"{what} has {actual} values; its sizes say {wanted}")
