"""A process that runs pieces of cases with the code of a folder."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from smartmesh_ros.errors import InputError
from smartmesh_ros.terrain.grid import FloatArray
from studies.before_after import worker


class Piece(NamedTuple):
    """One run of a case, as `Worker.run` writes it: a row for each of S steps in ``taken`` (S, 6), and T samples of
    N bodies. Of robots also ``links`` (L,), their names, and ``fields`` (T, L), numbers of samples of the fields."""

    taken: FloatArray
    times: FloatArray
    positions: FloatArray
    orientations: FloatArray
    links: Any
    fields: Any


class Side:
    """A worker on the code of ``folder``, the directory that holds ``smartmesh_ros/``. Use it as a context manager."""

    def __init__(self, folder: Path, *, count_calls: bool = False) -> None:
        package = (folder / "smartmesh_ros").resolve()
        if not (package / "__init__.py").is_file():
            raise InputError("before", f"{folder} holds no smartmesh_ros/; name a checkout of this repository")
        # -P: the script's own folder is no place to import from.
        command = [sys.executable, "-P", str(Path(worker.__file__)), *(["--count-calls"] if count_calls else [])]
        path = os.pathsep.join([str(folder.resolve()), os.environ.get("PYTHONPATH", "")]).rstrip(os.pathsep)
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env={**os.environ, "PYTHONPATH": path}
        )
        found = Path(self._read()["package"]).resolve().parent
        if found != package:
            self.close()
            raise InputError("before", f"{folder} was asked for, but the code that runs lies in {found}")

    def __enter__(self) -> Side:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def run(self, case_folder: Path) -> Piece:
        """One piece; raises `InputError` where the code cannot run the case."""
        out = case_folder / "piece.npz"
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps({"folder": str(case_folder), "out": str(out)}) + "\n")
        self._process.stdin.flush()
        error = self._read()["error"]
        if error:
            raise InputError("before", error)
        with np.load(out) as written:
            return Piece(*(written[name] for name in Piece._fields))

    def close(self) -> None:
        """Ends the process."""
        if self._process.stdin is not None:
            self._process.stdin.close()
        try:
            self._process.wait(timeout=10.0)
        except subprocess.TimeoutExpired:
            self._process.kill()

    def _read(self) -> dict[str, Any]:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line:
            raise InputError("before", f"a side ended with code {self._process.wait()}; see its output above")
        found: dict[str, Any] = json.loads(line)
        return found
