"""Messages spoilt as wires, bugs and enemies spoil them: field by field, and in their bytes."""

import struct
from array import array
from typing import Any

import numpy as np
from rosidl_parser.definition import AbstractString, Array, BasicType, NamespacedType

_WORDS = (0, 1, 2, 3, 7, 255, 256, 65535, 2**24, 2**31 - 1, 2**31, 2**32 - 2, 2**32 - 1)
_REALS = (0.0, -0.0, 1.0, -1.0, 1e-310, 1e-30, 1e6, 1e9, -1e9, 1e30, 1e155, 1e300, -1.7e308,
          float("nan"), float("inf"), float("-inf"))  # fmt: skip
_NAMES = ("", "map", "odom", "a", "ball", "rover", "body_0", "robot", "robot/wheel", "x" * 300, "\u00e4\u6f22", "a\nb")


def spoil(message: Any, rng: np.random.Generator) -> None:
    """Set a field of a message, or of one in it, to a value that its type can hold and hardly anybody means."""
    fields = list(message.get_fields_and_field_types())
    if not fields:
        return
    chosen = int(rng.integers(len(fields)))
    name, slot = fields[chosen], message.SLOT_TYPES[chosen]
    if isinstance(slot, NamespacedType):
        spoil(getattr(message, name), rng)
    elif isinstance(slot, (BasicType, AbstractString)):
        setattr(message, name, _extreme(slot, rng))
    else:
        values, element = getattr(message, name), slot.value_type
        place = int(rng.integers(len(values))) if len(values) else 0
        if not isinstance(slot, Array) and rng.random() < 0.2:
            setattr(message, name, values[:place])
        elif isinstance(element, NamespacedType):
            if len(values):
                spoil(values[place], rng)
        else:
            new = [_extreme(element, rng)]  # in a list, an array.array or one of NumPy
            values[place : place + 1] = new if isinstance(values, (list, np.ndarray)) else array(values.typecode, new)


def _extreme(slot: Any, rng: np.random.Generator) -> Any:
    if isinstance(slot, AbstractString):
        return _NAMES[int(rng.integers(len(_NAMES)))]
    if slot.typename == "boolean":
        return bool(rng.random() < 0.5)
    if slot.typename in ("float", "double"):
        value = _REALS[int(rng.integers(len(_REALS)))]
        with np.errstate(over="ignore"):
            return float(np.float32(value)) if slot.typename == "float" else value
    if slot.typename == "octet":
        return rng.bytes(1)
    bounds = np.iinfo({"char": "uint8"}.get(slot.typename, slot.typename))
    return (0, 1, int(bounds.min), int(bounds.max))[int(rng.integers(4))]


def mutated(data: bytes, others: list[bytes], rng: np.random.Generator) -> bytes:
    """The bytes with one to four changes; the four bytes that say how they are encoded mostly stay."""
    changed = bytearray(data)
    for _ in range(int(rng.integers(1, 5))):
        if len(changed) < 8:
            break
        _MUTATIONS[int(rng.integers(len(_MUTATIONS)))](changed, others, rng)
    if rng.random() < 0.02:
        changed[: min(4, len(changed))] = rng.bytes(min(4, len(changed)))
    return bytes(changed)


def _flip(data: bytearray, _: list[bytes], rng: np.random.Generator) -> None:
    for _ in range(int(rng.integers(1, 9))):
        data[int(rng.integers(4, len(data)))] ^= 1 << int(rng.integers(8))


def _number(data: bytearray, _: list[bytes], rng: np.random.Generator) -> None:
    """A count, or a double, made extreme or a little or much larger or smaller."""
    size = 8 if len(data) >= 12 and rng.random() < 0.4 else 4
    # As CDR aligns it; the first bytes, where counts are, more often.
    last = max(0, (len(data) - 4 - size) // size)
    at = 4 + size * int(rng.integers(min(last, 24) + 1 if rng.random() < 0.5 else last + 1))
    extreme = rng.random() < 0.6
    if size == 8:
        [now] = struct.unpack_from("<d", data, at)
        with np.errstate(all="ignore"):
            new = float(np.float64(now) * 10.0 ** float(rng.integers(-9, 10)))
        struct.pack_into("<d", data, at, _REALS[int(rng.integers(len(_REALS)))] if extreme else new)
    elif rng.random() < 0.3:
        with np.errstate(over="ignore"):
            data[at : at + 4] = np.float32(_REALS[int(rng.integers(len(_REALS)))]).tobytes()
    else:
        [now] = struct.unpack_from("<I", data, at)
        new = _WORDS[int(rng.integers(len(_WORDS)))] if extreme else now + int(rng.integers(-3, 4))
        struct.pack_into("<I", data, at, new % 2**32)


def _splice(data: bytearray, others: list[bytes], rng: np.random.Generator) -> None:
    """Bytes of this message, of another one or of chance, or none, before others or in place of all that follow."""
    at = int(rng.integers(0 if rng.random() < 0.1 else 4, len(data)))
    source = (b"", bytes(data), rng.bytes(64), others[int(rng.integers(len(others)))])[int(rng.integers(4))]
    start = int(rng.integers(len(source) + 1))
    end = at if rng.random() < 0.5 and source else len(data)
    data[at:end] = source[start : start + int(rng.integers(1, 4096))]


_MUTATIONS = (_flip, _number, _number, _splice)
