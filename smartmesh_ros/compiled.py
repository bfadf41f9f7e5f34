"""Compilation of scalar loops. No other module imports Numba.

Without a working Numba the same functions run as Python, several hundred times slower, after one warning.
"""

from __future__ import annotations

import hashlib
import os
import pickle
import tempfile
import warnings
from collections.abc import Callable
from contextlib import suppress
from itertools import product
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

from smartmesh_ros import machine_code

P = ParamSpec("P")
R = TypeVar("R")

try:
    import numba
    from numba.core.compiler import CompileResult
    from numba.core.compiler_lock import global_compiler_lock
    from numba.core.registry import CPUDispatcher
    from numba.core.serialize import dumps
except Exception as error:  # noqa: BLE001  # Numba raises its own exceptions if it does not support the installed NumPy
    numba, CPUDispatcher = None, object
    _PROBLEM = f"{type(error).__name__}: {error}"

# No fast-math: equal input must give equal bits. No C wrapper, because no C code calls these functions.
OPTIONS = {"nopython": True, "error_model": "numpy", "no_cfunc_wrapper": True, "no_cpython_wrapper": True}
# Numba's name for the processor that complete folders are compiled for; see `machine_code`.
GENERIC = "generic"
# Mark in the names of files with code that has no wrapper.
INNER = ".inner"

_warnings: set[str] = set()
# Wraps every compiled function while argument types are recorded; see `smartmesh_ros.compiling`.
stand_in: Callable[[Any], Any] | None = None
# True while several processes fill one folder. Each then waits for functions that another one compiles.
shared_folder = False


def compiled(function: Callable[P, R]) -> Callable[P, R]:
    """Return the function as machine code, cached on disk (see `machine_code`); equal input gives equal bits."""
    return _compiled(function, OPTIONS)


def inlined(function: Callable[P, R]) -> Callable[P, R]:
    """Return the function as `compiled` does, with its code copied into compiled callers: for short functions that take
    large tuples such as `MovingGrid`, which each call would copy. Callers take longer to compile."""
    return _compiled(function, OPTIONS | {"forceinline": True})


def _compiled(function: Callable[P, R], options: dict[str, Any]) -> Callable[P, R]:
    if numba is None:
        _warn(
            f"Numba does not work here ({_PROBLEM}): smartmesh_ros runs several hundred times slower. Install it: "
            "apt install python3-numba, or pip install numba"
        )
        return function
    if numba.config.DISABLE_JIT:
        return function
    made = CompiledFunction(function, targetoptions=dict(options))
    return made if stand_in is None else stand_in(made)


class CompiledFunction(CPUDispatcher):
    """Numba's dispatcher, which compiles the wrapper for calls from Python only if Python calls the function.

    Most functions are called by compiled functions alone. Their wrappers would take a fifth of the time to compile.
    """

    def __init__(self, function: Callable[..., Any], *others: Any, **named: Any) -> None:
        super().__init__(function, *others, **named)
        self._cache = CodeCache(function, self)

    @property
    def wrapped(self) -> bool:
        """True if Python can call the code that is compiled from now on."""
        return not self.targetoptions["no_cpython_wrapper"]

    def add_wrapper(self) -> None:
        """Compile the wrapper with the code from now on."""
        with global_compiler_lock:
            if not self.wrapped:
                self.targetoptions["no_cpython_wrapper"] = False
                self.overloads.clear()

    def add_overload(self, cres: Any) -> None:
        """Take compiled code; code without a wrapper is for compiled callers alone."""
        if self.wrapped:
            super().add_overload(cres)
        else:
            self.overloads[tuple(cres.signature.args)] = cres

    def _compile_for_args(self, *arguments: Any, **named: Any) -> Any:
        """Compile for a call from Python, whose types of arguments are new."""
        self.add_wrapper()
        return super()._compile_for_args(*arguments, **named)


class CodeCache:
    """Disk cache of one function's machine code: one file with a checksum for each signature and processor.

    Replaces the cache of a Numba dispatcher. Files are written under a temporary name and then renamed, so that readers
    never see a partial file. Writers share no index. Code with and code without a wrapper are in separate files.
    """

    def __init__(self, function: Callable[..., Any], dispatcher: CompiledFunction) -> None:
        self._name = f"{function.__module__}.{function.__qualname__}"
        file = Path(function.__code__.co_filename).resolve()
        if not file.is_relative_to(machine_code.PACKAGE):  # the folder's digest does not cover these sources
            self._name += f"-{machine_code.digest_of_all(file.parent)}"
        self._dispatcher = dispatcher
        self._locks: dict[Any, int] = {}

    @property
    def cache_path(self) -> str:
        """The folder, or "" without a cache; Numba reads this attribute for its statistics."""
        return str(machine_code.folder() or "")

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return the cached code for a signature, None if there is none."""
        target_context.refresh()
        loaded = self._load(sig, target_context)
        if loaded is None and shared_folder:
            self._lock(sig, target_context)
            if (loaded := self._load(sig, target_context)) is not None:
                self._unlock(sig)
        return loaded

    def save_overload(self, sig: Any, data: Any) -> None:
        """Write the code of a signature to disk, unless the sources have changed since the import."""
        try:
            folder = machine_code.folder()
            cacheable = not data.library.has_dynamic_globals and all(part.can_cache for part in data.lifted)
            if folder is not None and cacheable and (shared_folder or not machine_code.sources_changed()):
                content = dumps((sig, data._reduce()))
                with suppress(OSError):  # full disk or read-only installation
                    _write(folder / self._file(sig, _processor(data.codegen), self._dispatcher.wrapped), content)
        finally:
            self._unlock(sig)

    def _load(self, sig: Any, target_context: Any) -> Any:
        folder = machine_code.folder()
        if folder is None:
            return None
        processors = dict.fromkeys((GENERIC, _processor(target_context.codegen())))
        # Compiled callers may also take code with a wrapper.
        for processor, wrapped in product(processors, (True,) if self._dispatcher.wrapped else (False, True)):
            path = folder / self._file(sig, processor, wrapped)
            try:
                kept, reduced = pickle.loads(_read(path))
                if kept == sig:
                    return CompileResult._rebuild(target_context, *reduced)
            except FileNotFoundError:
                continue
            except Exception as error:  # noqa: BLE001  # unpickling a damaged file may raise anything
                machine_code.log_once(
                    f"machine code in {folder} is damaged ({path.name}: {error}); damaged functions are compiled again"
                )
                with suppress(OSError):
                    path.unlink()
        return None

    def _file(self, sig: Any, processor: str, wrapped: bool) -> str:
        kind = "" if wrapped else INNER
        return f"{self._name}-{hashlib.sha256(str(sig).encode()).hexdigest()[:16]}{kind}.{processor}"

    def _lock(self, sig: Any, target_context: Any) -> None:
        """Wait until no other process compiles this signature, and lock it.

        There is no deadlock: a process that compiles a function waits only for the functions it calls.
        """
        folder = machine_code.folder()
        if folder is not None:
            name = self._file(sig, _processor(target_context.codegen()), self._dispatcher.wrapped)
            path = folder / f"{name}.lock"
            self._locks[sig] = lock = os.open(path, os.O_RDWR | os.O_CREAT)
            machine_code.wait_for(lock)

    def _unlock(self, sig: Any) -> None:
        if (lock := self._locks.pop(sig, None)) is not None:
            os.close(lock)


def omitted(default: Any) -> Any:
    """Return Numba's type of an argument that a call leaves at its ``default``."""
    return numba.types.Omitted(default)


def _processor(codegen: Any) -> str:
    """Return a name of the target processor and its features."""
    triple, name, features = codegen.magic_tuple()
    return GENERIC if name == GENERIC else f"{name}-{hashlib.sha256(f'{triple}{features}'.encode()).hexdigest()[:8]}"


def _write(path: Path, content: bytes) -> None:
    """Write a file atomically, with its checksum in front."""
    descriptor, temporary = tempfile.mkstemp(dir=path.parent, prefix=path.name)
    try:
        with os.fdopen(descriptor, "wb") as file:
            file.write(hashlib.sha256(content).digest() + content)
        Path(temporary).chmod(0o644)  # readable for users other than the one who installed
        Path(temporary).replace(path)
    except OSError:
        Path(temporary).unlink(missing_ok=True)
        raise


def _read(path: Path) -> bytes:
    """Return the content of a file without its checksum; raises `ValueError` if the checksum is wrong."""
    content = path.read_bytes()
    if hashlib.sha256(content[32:]).digest() != content[:32]:
        raise ValueError("its checksum is wrong")
    return content[32:]


def _warn(message: str) -> None:
    """Issue a warning, once in a process."""
    if not _warnings:
        _warnings.add(message)
        warnings.warn(message, RuntimeWarning, stacklevel=3)
