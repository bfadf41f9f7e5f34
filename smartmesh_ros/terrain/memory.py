"""Memory that is taken as it is written to."""

import math
import mmap

import numpy as np
from numpy.typing import NDArray


def untouched_zeros(shape: tuple[int, ...]) -> NDArray[np.float32]:
    """Zeros, float32, that take memory only where they are written to, in small pages.

    `numpy.zeros` asks for huge pages: each then takes 2 MiB at the first write to it, and the kernel may move other
    memory out of the way for it, for 10 ms and more.
    """
    memory = mmap.mmap(-1, 4 * math.prod(shape), flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
    memory.madvise(mmap.MADV_NOHUGEPAGE)
    return np.frombuffer(memory, np.float32).reshape(shape)
