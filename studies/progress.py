"""One line on the terminal that tells what a study is doing."""

from __future__ import annotations

import sys
from time import perf_counter


class Progress:
    """Shows lines in place of one another on the standard error output, behind the time since it was made."""

    def __init__(self) -> None:
        self._began = perf_counter()

    def __call__(self, line: str) -> None:
        """Show a line."""
        print(f"\r\033[K{perf_counter() - self._began:5.0f} s  {line}", end="", file=sys.stderr, flush=True)
