"""The package's one exception, refused input, and what helps to write its messages."""

from __future__ import annotations

import difflib
import math
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from numbers import Integral, Real
from typing import Any, TypeGuard, TypeVar

T = TypeVar("T")


def suggestion(word: str, known: Iterable[str]) -> str:
    """Return a hint that suggests the known word that is most similar, empty if none is similar."""
    similar = difflib.get_close_matches(word, [*known], n=1)
    return f"; did you mean {similar[0]!r}?" if similar else ""


def listed(words: Sequence[str], most: int = 5, between: str = ", ") -> str:
    """Return the first ``most`` words as text, and how many more there are."""
    more = [f"and {len(words) - most} more"] if len(words) > most else []
    return between.join([*words[:most], *more])


def counted(count: int, one: str = "body", many: str = "bodies") -> str:
    """Return a number of things as text."""
    return f"{count} {one if count == 1 else many}"


def is_number(value: object) -> TypeGuard[float]:
    """Return True if a value is a real number of Python or NumPy that fits a float, and no truth value."""
    real = isinstance(value, Real) and not isinstance(value, bool)
    return real and (value != value or not math.isnan(as_float(value)))


def as_float(value: Any) -> float:
    """Return a number as a float; NaN, which is in no range, for what is none."""
    try:
        return math.nan if isinstance(value, str | bytes) else float(value)
    except (TypeError, ValueError, OverflowError):
        return math.nan


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


@contextmanager
def naming(what: str) -> Iterator[None]:
    """Begin the message of an `InputError` of the block with ``what`` was refused."""
    try:
        yield
    except InputError as error:
        raise InputError(error.reason, f"{what}: {error}") from None


def require_body_name(name: Any) -> None:
    """Raise `InputError` unless a name can be that of a body, in topics and tables, too."""
    if not (isinstance(name, str) and name.isprintable() and name.strip() and "/" not in name):
        raise InputError("empty_id", f"{name!r} cannot name a body; a name is printable text, not blank, without '/'")


def require(good: bool, reason: str, what: str, value: object, wanted: str) -> None:
    """Raise `InputError` unless a ``value`` is ``good``; ``what``: the setting, ``wanted``: what it must be."""
    if not good:
        raise InputError(reason, f"{what} is {value!r}; it must be {wanted}")


def require_choice(value: object, choices: Collection[str], reason: str, what: str) -> None:
    """Raise `InputError` unless a value is one of some texts."""
    require(isinstance(value, str) and value in choices, reason, what, value, f"one of {(*choices,)}")


def require_flag(value: object, reason: str, what: str) -> None:
    """Raise `InputError` unless a value is a truth value of Python or NumPy."""
    good = type(value).__name__ in ("bool", "bool_")  # those of NumPy, which is not imported for this
    require(good, reason, what, value, "True or False")


def named(name: Any, known: Mapping[str, T], reason: str, what: str) -> T:
    """Return what is known by a ``name``; raises `InputError` if there is none. ``what``: its kind."""
    try:
        return known[name]
    except (KeyError, TypeError):
        there = listed([*map(repr, known)]) or "none yet"
        hint = suggestion(str(name), known)
        raise InputError(reason, f"there is no {what} {name!r}{hint}; known: {there}") from None


def require_not_negative(settings: Any, of_what: str) -> None:
    """Raise `InputError` unless all fields of a dataclass are numbers from zero on."""
    for name, value in vars(settings).items():
        require(as_float(value) >= 0.0, "parameter", f"{name} of {of_what}", value, "zero or more")


def checked_count(count: Any, reason: str, what: str) -> int:
    """Return a count, or a seed of random numbers; raises `InputError` if it is no whole number from 0 on."""
    if type(count) is int and count >= 0:  # a tenth of the time, for each step of a world
        return count
    whole = isinstance(count, Integral) and not isinstance(count, bool)
    require(whole and count >= 0, reason, what, count, "a whole number from 0 on")
    return int(count)
