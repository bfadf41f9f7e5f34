"""How many examples a property is tried on."""

import os

from hypothesis import settings

# How many times as many examples as usual each profile tries; see conftest.py.
FACTORS = {"steady": 1, "random": 20}


def examples(count: int) -> settings:
    """Settings for a property that is tried on so many examples, on more by the random profile."""
    return settings(max_examples=count * FACTORS.get(os.environ.get("HYPOTHESIS_PROFILE", "steady"), 1), deadline=None)
