"""The one exception of the domain: input that is refused whole."""


class InputError(ValueError):
    """Input that was refused; whatever it was meant to change is as it was before.

    ``reason`` is a short, stable word for counters (``"length"``, ``"region"``, ...); the message says what was wrong
    and what would be right.
    """

    def __init__(self, reason: str, message: str) -> None:
        super().__init__(message)
        self.reason = reason
