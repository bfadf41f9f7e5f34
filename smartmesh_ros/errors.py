"""The package's one exception: refused input."""

from __future__ import annotations


class InputError(ValueError):
    """The input was refused as a whole; nothing was changed.

    ``reason`` is a short, stable word for counters (``"length"``, ``"region"``, ...); the message says what was wrong
    and what would be right.
    """

    def __init__(self, reason: str, message: str) -> None:
        super().__init__(message)
        self.reason = reason

    def __reduce__(self) -> tuple[type[InputError], tuple[str, str]]:
        return type(self), (self.reason, str(self))  # to be sent from another process
