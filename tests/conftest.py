"""What holds for all tests."""

import hashlib
import os
from pathlib import Path

from hypothesis import settings

from tests.examples import FACTORS

ROOT = Path(__file__).resolve().parents[1]


def _digest_of_sources() -> str:
    """A short hash of the package's sources."""
    digest = hashlib.sha256()
    for file in sorted((ROOT / "smartmesh_ros").rglob("*.py")):
        digest.update(str(file.relative_to(ROOT)).encode() + b"\0" + file.read_bytes() + b"\0")
    return digest.hexdigest()[:16]


# Numba notices when a compiled function changes, but not when one that it calls does: what was compiled from other
# sources is never used again. Set before anything imports the package, and inherited by every process of a test.
os.environ.setdefault("NUMBA_CACHE_DIR", str(ROOT / "build" / "numba" / _digest_of_sources()))

# Tests say nothing of time: a machine may be as slow as it is.
settings.register_profile("steady", deadline=None, derandomize=True)  # the same examples in every run
# HYPOTHESIS_PROFILE=random looks for new ones, many times as many; what fails is kept as an @example.
settings.register_profile(
    "random", deadline=None, derandomize=False, print_blob=True, max_examples=100 * FACTORS["random"]
)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "steady"))
