"""Saved states as one file: an ``.npz`` whose arrays hold numbers, and whose text holds the tree that they belong to.

The comment of the file ends it with a SHA-256 of all before, so that a file that was cut off or changed is noticed.
`numpy.load` reads the arrays, without pickles; nothing of a file is run.
"""

from __future__ import annotations

import hashlib
import io
import json
import os
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

from smartmesh_ros.errors import InputError, require

# Version of the contents. A file of another one is refused.
VERSION = 7
FORMAT = "smartmesh_ros state"
# A zip file ends with its comment: this and the digest of all bytes before it, in hexadecimal.
MARK = b"smartmesh_ros state, sha256 "
DIGITS = 64
# The same bytes for the same state: members of a zip file have a date.
NO_DATE = (1980, 1, 1, 0, 0, 0)
FOREIGN = "this is no saved state of smartmesh_ros; save one with save(), save_state() or ~/save_state"


def to_bytes(kind: str, tree: Any) -> bytes:
    """Return a tree of dictionaries, lists, tuples, dataclasses, named tuples, arrays, numbers, texts and what sets its
    own state when it is copied as a file; the ``kind`` says of what."""
    arrays: list[np.ndarray] = []
    text = json.dumps({"format": FORMAT, "version": VERSION, "kind": kind, "tree": _encoded(tree, arrays)})
    file, comment = io.BytesIO(), MARK + b"0" * DIGITS
    with zipfile.ZipFile(file, "w") as archive:
        archive.comment = comment
        for name, array in [
            ("state", np.frombuffer(text.encode(), np.uint8)),
            *((f"a{k}", array) for k, array in enumerate(arrays)),
        ]:
            with archive.open(zipfile.ZipInfo(f"{name}.npy", NO_DATE), "w", force_zip64=True) as member:
                np.lib.format.write_array(member, array, allow_pickle=False)
    return signed(file.getvalue()[: -len(comment)])


def signed(body: bytes) -> bytes:
    """Return a zip file without its comment as one that ends with its digest."""
    return body + MARK + hashlib.sha256(body).hexdigest().encode()


def is_state(data: bytes) -> bool:
    """Return True if a file is a whole saved state."""
    return signed(data[: -len(MARK) - DIGITS]) == data


def from_bytes(data: bytes, kind: str, types: Mapping[str, type]) -> Any:
    """Return the tree in a file of a ``kind``, which has objects of these ``types`` alone, by name. Raises `InputError`
    if the file is no state, was changed, or is of another version or kind."""
    if data[-len(MARK) - DIGITS : -DIGITS] != MARK:
        whole = data[:2] == b"PK" or MARK[:-8] in data
        raise InputError("state", f"{FOREIGN}{'; or it was cut off' if whole else ''}")
    if not is_state(data):
        raise InputError("state", "this saved state was damaged: its digest is not that of its bytes; save it again")
    with foreign_refused(), np.load(io.BytesIO(data), allow_pickle=False) as file:
        head = json.loads(file["state"].tobytes())
        if head["format"] != FORMAT:
            raise InputError("state", FOREIGN)
        _require(head, kind)
        return _decoded(head["tree"], file, types)


@contextmanager
def foreign_refused() -> Iterator[None]:
    """Raise `InputError` for what goes wrong in the block because a file, digest and all, was made by something
    else."""
    try:
        yield
    except InputError:
        raise
    except (ArithmeticError, AttributeError, LookupError, OSError, TypeError, ValueError, zipfile.BadZipFile) as error:
        raise InputError("state", f"{FOREIGN} ({type(error).__name__}: {error})") from None


def read(state: bytes | str | os.PathLike[str]) -> bytes:
    """Return the bytes of a state, or of the file of a name; raises `InputError` if it cannot be read."""
    if isinstance(state, bytes | bytearray | memoryview):
        return bytes(state)
    if not isinstance(state, str | os.PathLike):
        raise InputError("state", f"the saved state is {state!r}; pass its bytes or its file")
    try:
        return Path(state).read_bytes()
    except OSError as error:
        raise InputError("state", f"the saved state cannot be read: {error}") from None


def write(data: bytes, file: str | os.PathLike[str]) -> None:
    """Write a state to a file, as a whole or not at all; raises `InputError` if it cannot be written."""
    require(isinstance(file, str | os.PathLike), "state", "the file of a state", file, "a path")
    path, part = Path(file), Path(f"{os.fspath(file)}.part")
    if path.exists() and not path.is_file():  # a device or a pipe, too, would be replaced
        raise InputError("state", f"the state cannot be saved: {file} is no file; name a file")
    try:
        part.write_bytes(data)
        part.replace(path)
    except (OSError, ValueError) as error:  # ValueError: a zero byte in the path
        with suppress(OSError, ValueError):  # of a path that no file can have
            part.unlink(missing_ok=True)
        raise InputError("state", f"the state cannot be saved: {error}") from None


def filled(array: np.ndarray, kept: Any) -> None:
    """Write a ``kept`` array into another one of the same shape and type. Raises `InputError`."""
    if not isinstance(kept, np.ndarray) or kept.shape != array.shape or kept.dtype != array.dtype:
        found = f"{kept.dtype} {kept.shape}" if isinstance(kept, np.ndarray) else type(kept).__name__
        raise InputError("state", f"an array of a saved state is {found}; it must be {array.dtype} {array.shape}")
    array[...] = kept


def _require(head: dict[str, Any], kind: str) -> None:
    if head["version"] != VERSION:
        newer = "a newer" if head["version"] > VERSION else "an older"
        raise InputError(
            "state",
            f"this state was saved by {newer} smartmesh_ros, in version {head['version']}; this one reads {VERSION}",
        )
    if head["kind"] != kind:
        raise InputError(
            "state", f"this is the saved state of a {head['kind']}, and a {kind} cannot be restored from it"
        )


def _encoded(value: Any, arrays: list[np.ndarray]) -> Any:
    if isinstance(value, np.ndarray):
        arrays.append(value)
        return {"array": len(arrays) - 1}
    if isinstance(value, np.generic):
        return value.item()
    if hasattr(value, "__setstate__"):
        return {"is": type(value).__name__, "state": _encoded(value.__getstate__(), arrays)}
    if is_dataclass(value) and not isinstance(value, type):
        named = {field.name: getattr(value, field.name) for field in fields(value)}
    elif isinstance(value, tuple) and hasattr(value, "_asdict"):
        named = value._asdict()
    elif isinstance(value, dict):
        return {"dict": [[key, _encoded(item, arrays)] for key, item in value.items()]}
    elif isinstance(value, tuple):
        return {"tuple": [_encoded(item, arrays) for item in value]}
    elif isinstance(value, list):
        return [_encoded(item, arrays) for item in value]
    elif value is None or isinstance(value, bool | int | float | str):
        return value
    else:
        raise TypeError(f"a state cannot hold a {type(value).__name__}")
    return {"is": type(value).__name__, "of": {name: _encoded(item, arrays) for name, item in named.items()}}


def _decoded(value: Any, arrays: Any, types: Mapping[str, type]) -> Any:
    if isinstance(value, list):
        return [_decoded(item, arrays, types) for item in value]
    if not isinstance(value, dict):
        return value
    if "array" in value:
        return arrays[f"a{value['array']:d}"]
    if "tuple" in value:
        return tuple(_decoded(item, arrays, types) for item in value["tuple"])
    if "dict" in value:
        return {key: _decoded(item, arrays, types) for key, item in value["dict"]}
    made: Any = types[value["is"]]
    if "state" in value:
        it = made.__new__(made)
        getattr(it, "take_state", it.__setstate__)(_decoded(value["state"], arrays, types))
        return it
    return made(**{name: _decoded(item, arrays, types) for name, item in value["of"].items()})
