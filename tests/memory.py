"""Memory of this process, by what is allocated: resident memory also depends on what the machine has left for it. And
whether processes can share memory as ``config/fastdds.xml`` asks for."""

import ctypes
import gc
import shutil
import sys
from pathlib import Path

import pytest

SHARED = Path("/dev/shm")  # 64 MB in a container that is not given more
needs_shared_memory = pytest.mark.skipif(
    SHARED.is_dir() and shutil.disk_usage(SHARED).total < 1 << 30,
    reason="needs 1 GiB of /dev/shm: docker --shm-size=1g",
)
BLOCK = 64  # of one object of Python, about [bytes]


class Mallinfo(ctypes.Structure):
    """The ``mallinfo2`` of glibc."""

    _fields_ = [
        (name, ctypes.c_size_t)
        for name in ("arena", "free", "small", "maps", "mapped", "most", "free_small", "used", "unused", "releasable")
    ]


def allocated() -> int:
    """Return what C, C++ and Python have allocated and not freed [bytes]."""
    asked = ctypes.CDLL(None).mallinfo2
    asked.restype = Mallinfo
    gc.collect()
    found = asked()
    return int(found.used + found.mapped) + BLOCK * sys.getallocatedblocks()
