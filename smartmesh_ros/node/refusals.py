"""Refused input: counted by reason, logged once per reason and period."""

from collections import Counter
from time import monotonic
from typing import Any

from smartmesh_ros.errors import InputError

# Seconds between two log lines of the same topic and reason.
LOG_PERIOD = 5.0

# A message may quote what a peer sent; so much of it is logged or answered [characters].
LONGEST = 1000


def shortened(text: str) -> str:
    """The text, its middle left out where it is too long to log."""
    return text if len(text) <= LONGEST else f"{text[: LONGEST // 2]} ... {text[-LONGEST // 2 :]}"


class Refusals:
    """Counts what was refused and logs it without flooding."""

    def __init__(self, logger: Any) -> None:
        self.counts: Counter[str] = Counter()
        self._logger = logger
        self._logged: dict[str, tuple[float, int]] = {}

    def add(self, source: str, error: InputError) -> None:
        """Notes that a message or call of ``source`` was refused."""
        key = f"{source}: {error.reason}"
        self.counts[key] += 1
        now = monotonic()
        last, count = self._logged.get(key, (-LOG_PERIOD, 0))
        if now - last >= LOG_PERIOD:
            more = self.counts[key] - count - 1
            repeated = f" ({more} more since the last line)" if more else ""
            text = shortened(str(error))
            self._logger.warning(f"{source} refused: {text}{repeated}")
            self._logged[key] = (now, self.counts[key])
