"""The package's one exception: refused input."""


class InputError(ValueError):
    """The input was refused as a whole; nothing was changed.

    ``reason`` is a short, stable word for counters (``"length"``, ``"region"``, ...); the message says what was wrong
    and what would be right.
    """

    def __init__(self, reason: str, message: str) -> None:
        super().__init__(message)
        self.reason = reason
