"""Arrays whose memory is allocated when it is written."""

import math
import mmap

import numpy as np
from numpy.typing import NDArray


def untouched_zeros(shape: tuple[int, ...]) -> NDArray[np.float32]:
    """Return float32 zeros whose memory is allocated at the first write, in small pages.

    `numpy.zeros` uses huge pages: the first write to one allocates 2 MiB, and the kernel may need 10 ms and more to
    compact memory for it.
    """
    memory = mmap.mmap(-1, 4 * math.prod(shape), flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
    memory.madvise(mmap.MADV_NOHUGEPAGE)
    return np.frombuffer(memory, np.float32).reshape(shape)
