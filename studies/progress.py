"""One line on the terminal that tells what a study is doing."""

from __future__ import annotations

import sys
from time import perf_counter


class Progress:
    """Shows lines in place of one another on the standard error output, behind the time since it was made."""

    def __init__(self) -> None:
        self._began = perf_counter()

    @property
    def elapsed(self) -> float:
        """Time since it was made [s]."""
        return perf_counter() - self._began

    def __call__(self, line: str) -> None:
        """Show a line."""
        print(f"\r\033[K{self.elapsed:5.0f} s  {line}", end="", file=sys.stderr, flush=True)
