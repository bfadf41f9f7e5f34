"""Bytes of real messages, spoilt in the ways that wires, bugs and enemies spoil them."""

import struct

import numpy as np

_WORDS = (0, 1, 2, 3, 7, 255, 256, 65535, 2**24, 2**31 - 1, 2**31, 2**32 - 2, 2**32 - 1)
_REALS = (0.0, -0.0, 1.0, -1.0, 1e-310, 1e-30, 1e6, 1e9, -1e9, 1e30, 1e155, 1e300, -1.7e308,
          float("nan"), float("inf"), float("-inf"))  # fmt: skip


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


def _place(data: bytearray, size: int, rng: np.random.Generator) -> int:
    """Where a number of ``size`` bytes may lie, as CDR aligns it; the first bytes, where counts are, more often."""
    last = max(0, (len(data) - 4 - size) // size)
    return 4 + size * int(rng.integers(min(last, 24) + 1 if rng.random() < 0.5 else last + 1))


def _flip(data: bytearray, _: list[bytes], rng: np.random.Generator) -> None:
    for _ in range(int(rng.integers(1, 9))):
        data[int(rng.integers(4, len(data)))] ^= 1 << int(rng.integers(8))


def _byte(data: bytearray, _: list[bytes], rng: np.random.Generator) -> None:
    data[int(rng.integers(4, len(data)))] = int(rng.integers(256))


def _word(data: bytearray, _: list[bytes], rng: np.random.Generator) -> None:
    at = _place(data, 4, rng)
    [now] = struct.unpack_from("<I", data, at)
    new = _WORDS[int(rng.integers(len(_WORDS)))] if rng.random() < 0.6 else now + int(rng.integers(-3, 4))
    struct.pack_into("<I", data, at, new % 2**32)


def _real(data: bytearray, _: list[bytes], rng: np.random.Generator) -> None:
    value = _REALS[int(rng.integers(len(_REALS)))]
    if rng.random() < 0.5 and len(data) >= 12:
        struct.pack_into("<d", data, _place(data, 8, rng), value)
    else:
        with np.errstate(over="ignore"):
            data_at = _place(data, 4, rng)
            data[data_at : data_at + 4] = np.float32(value).tobytes()


def _scale(data: bytearray, _: list[bytes], rng: np.random.Generator) -> None:
    """A double made larger or smaller, so that it still means something."""
    if len(data) >= 12:
        at = _place(data, 8, rng)
        [now] = struct.unpack_from("<d", data, at)
        with np.errstate(all="ignore"):
            struct.pack_into("<d", data, at, float(np.float64(now) * 10.0 ** float(rng.integers(-9, 10))))


def _truncate(data: bytearray, _: list[bytes], rng: np.random.Generator) -> None:
    del data[int(rng.integers(0 if rng.random() < 0.1 else 4, len(data))) :]


def _extend(data: bytearray, _: list[bytes], rng: np.random.Generator) -> None:
    data += rng.bytes(int(rng.integers(1, 64)))


def _repeat(data: bytearray, _: list[bytes], rng: np.random.Generator) -> None:
    start = int(rng.integers(4, len(data)))
    end = min(len(data), start + int(rng.integers(1, 128)))
    data[start:start] = data[start:end]


def _splice(data: bytearray, others: list[bytes], rng: np.random.Generator) -> None:
    other = others[int(rng.integers(len(others)))]
    at = int(rng.integers(4, len(data)))
    data[at:] = other[at : at + 4096]


_MUTATIONS = (_flip, _byte, _word, _word, _real, _real, _scale, _truncate, _extend, _repeat, _splice)
