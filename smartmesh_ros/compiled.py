"""How scalar loops are compiled: the only place that knows Numba.

Without a working Numba the same functions run as Python, hundreds of times slower, and one warning says so.
"""

from __future__ import annotations

import hashlib
import os
import pickle
import tempfile
import warnings
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

from smartmesh_ros import machine_code

P = ParamSpec("P")
R = TypeVar("R")

try:
    import numba
    from numba.core.compiler import CompileResult
    from numba.core.dispatcher import Dispatcher
    from numba.core.serialize import dumps
except Exception as error:  # noqa: BLE001  # Numba raises its own exceptions where it does not support the NumPy there is
    numba = None
    _PROBLEM = f"{type(error).__name__}: {error}"

# No fast-math, so that equal input gives equal bits. Nothing here is called from C, which the wrapper would be for.
OPTIONS = {"error_model": "numpy", "no_cfunc_wrapper": True}
# The processor that machine code in a complete folder is for; see `machine_code`.
GENERIC = "generic"

_warnings: set[str] = set()
# Takes the place of compiled functions while their arguments are recorded; see `smartmesh_ros.compiling`.
instead: Callable[[Any], Any] | None = None
# Whether several processes fill one folder now, so that a function that one of them compiles is waited for.
shared = False


def compiled(function: Callable[P, R]) -> Callable[P, R]:
    """The function as machine code, kept on disk between runs as `machine_code` says; equal input gives equal bits."""
    if numba is None:
        _warn(
            f"Numba does not work here ({_PROBLEM}): smartmesh_ros runs several hundred times slower. Install it: "
            "apt install python3-numba, or pip install numba"
        )
        return function
    made = numba.njit(**OPTIONS)(function)
    if not isinstance(made, Dispatcher):  # NUMBA_DISABLE_JIT
        return function
    made._cache = KeptCode(function)  # type: ignore[attr-defined]
    return made if instead is None else instead(made)


class KeptCode:
    """The machine code of one function: a file for each signature and processor, which carries its own checksum.

    Takes the place of Numba's cache of a dispatcher. A file is written beside and renamed, so that readers see whole
    ones only, and no index is shared by those who write.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        self._name = f"{function.__module__}.{function.__qualname__}"
        file = Path(function.__code__.co_filename).resolve()
        if not file.is_relative_to(machine_code.PACKAGE):  # the folder's name does not tell of its sources
            self._name += f"-{machine_code.digest_of_all(file.parent)}"
        self._locks: dict[Any, int] = {}

    @property
    def cache_path(self) -> str:
        """The folder, empty if nothing is kept; Numba asks for it in its statistics."""
        return str(machine_code.folder() or "")

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """What was compiled for a signature, None if nothing was."""
        target_context.refresh()
        loaded = self._load(sig, target_context)
        if loaded is None and shared:
            self._lock(sig, target_context)
            if (loaded := self._load(sig, target_context)) is not None:
                self._unlock(sig)
        return loaded

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keeps what was compiled for a signature, unless the sources have changed since they were imported."""
        try:
            folder = machine_code.folder()
            lasting = not data.library.has_dynamic_globals and all(part.can_cache for part in data.lifted)
            if folder is not None and lasting and (shared or not machine_code.sources_changed()):
                content = dumps((sig, data._reduce()))
                with suppress(OSError):  # a full disk, or an installation that cannot be written to
                    _write(folder / self._file(sig, _processor(data.codegen)), content)
        finally:
            self._unlock(sig)

    def _load(self, sig: Any, target_context: Any) -> Any:
        folder = machine_code.folder()
        if folder is None:
            return None
        for processor in dict.fromkeys((GENERIC, _processor(target_context.codegen()))):
            path = folder / self._file(sig, processor)
            try:
                kept, reduced = pickle.loads(_read(path))
                if kept == sig:
                    return CompileResult._rebuild(target_context, *reduced)
            except FileNotFoundError:
                continue
            except Exception as error:  # noqa: BLE001  # damaged files fail in any way
                machine_code.say_once(
                    f"machine code in {folder} is damaged ({path.name}: {error}); what cannot be read is compiled again"
                )
                with suppress(OSError):
                    path.unlink()
        return None

    def _file(self, sig: Any, processor: str) -> str:
        return f"{self._name}-{hashlib.sha256(str(sig).encode()).hexdigest()[:16]}.{processor}"

    def _lock(self, sig: Any, target_context: Any) -> None:
        """Waits until no other process compiles for the signature.

        Who compiles a function waits for those it calls, and never the other way round: nobody waits for ever.
        """
        folder = machine_code.folder()
        if folder is not None:
            path = folder / (self._file(sig, _processor(target_context.codegen())) + ".lock")
            self._locks[sig] = lock = os.open(path, os.O_RDWR | os.O_CREAT)
            machine_code.wait_for(lock)

    def _unlock(self, sig: Any) -> None:
        if (lock := self._locks.pop(sig, None)) is not None:
            os.close(lock)


def omitted(default: Any) -> Any:
    """The type of an argument that a call leaves at its ``default``."""
    return numba.types.Omitted(default)


def _processor(codegen: Any) -> str:
    """A name of the processor that is compiled for, with its features."""
    triple, name, features = codegen.magic_tuple()
    return GENERIC if name == GENERIC else f"{name}-{hashlib.sha256(f'{triple}{features}'.encode()).hexdigest()[:8]}"


def _write(path: Path, content: bytes) -> None:
    """Writes a file with its checksum in front, all of it or nothing."""
    descriptor, temporary = tempfile.mkstemp(dir=path.parent, prefix=path.name)
    try:
        with os.fdopen(descriptor, "wb") as file:
            file.write(hashlib.sha256(content).digest() + content)
        Path(temporary).chmod(0o644)  # for users other than the one who installed
        Path(temporary).replace(path)
    except OSError:
        Path(temporary).unlink(missing_ok=True)
        raise


def _read(path: Path) -> bytes:
    """The content of a file; raises `ValueError` if it is not the one that was written."""
    content = path.read_bytes()
    if hashlib.sha256(content[32:]).digest() != content[:32]:
        raise ValueError("its checksum is wrong")
    return content[32:]


def _warn(message: str) -> None:
    """Warns once."""
    if not _warnings:
        _warnings.add(message)
        warnings.warn(message, RuntimeWarning, stacklevel=3)
