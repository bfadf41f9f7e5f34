"""Running times: the report's tables measured again, on larger maps and for more bodies."""

from studies.bench.cli import main

__all__ = ["main"]
