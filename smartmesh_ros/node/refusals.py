"""Refused input and failures, counted by reason and logged once per reason and period."""

import traceback
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from time import monotonic
from typing import Any

from smartmesh_ros.errors import InputError

# Time between two log lines of the same cause [s].
LOG_PERIOD = 5.0
# Time without an answer, such as at a start, that is no reason for a warning [s].
GRACE = 5.0

# Longest text to log or answer [characters], because an error may quote a peer's whole message.
LONGEST_TEXT = 1000


def shortened(text: str) -> str:
    """Return the text, without its middle if it is too long to log."""
    return text if len(text) <= LONGEST_TEXT else f"{text[: LONGEST_TEXT // 2]} ... {text[-LONGEST_TEXT // 2 :]}"


def unexpected(error: Exception, reason: str = "failed") -> InputError:
    """Return a refusal for an error of Python or a library, with its kind and the line of code."""
    where = traceback.extract_tb(error.__traceback__)[-1]
    return InputError(reason, f"{type(error).__name__}: {error} ({Path(where.filename).name}:{where.lineno})")


def reason_of(error: Exception) -> str:
    """Return the word by which an error is counted."""
    if isinstance(error, InputError):
        return error.reason
    return "pybullet" if type(error).__module__ == "pybullet" else "dds"  # nodes without physics do not import it


class Refusals:
    """Counts refused input and logs it at a limited rate, on the clock ``now`` [s]."""

    def __init__(self, logger: Any, now: Callable[[], float] = monotonic) -> None:
        self.counts: Counter[str] = Counter()
        self._now = now
        self._logger = logger
        self._logged: dict[str, tuple[float, int]] = {}

    def add(self, source: str, error: Exception) -> None:
        """Records that a message or call on ``source`` was refused, or that a part of the node failed."""
        key = f"{source}: {reason_of(error)}"
        self.counts[key] += 1
        now = self._now()
        last, count = self._logged.get(key, (-LOG_PERIOD, 0))
        if now - last >= LOG_PERIOD:
            more = self.counts[key] - count - 1
            repeated = f" ({more} more since the last line)" if more else ""
            text = shortened(str(error))
            self._logger.warning(f"{source} refused: {text}{repeated}")
            self._logged[key] = (now, self.counts[key])
