"""Size checks of all adapters, made before memory is allocated."""

from smartmesh_ros.errors import InputError


def require_cells(cells: int, max_samples: int) -> None:
    """Raises `InputError` if there are more cells than allowed."""
    if cells > max_samples:
        raise InputError("size", f"{cells} samples are more than terrain.max_samples = {max_samples}")


def require_length(what: str, actual: int, wanted: int) -> None:
    """Raises `InputError` if the length of the data does not match the sizes."""
    if actual != wanted:
        raise InputError("length", f"{what} has {actual} values; its sizes say {wanted}")
