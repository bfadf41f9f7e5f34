"""What holds for all tests."""

import os

from hypothesis import settings

from tests.examples import FACTORS

# Tests say nothing of time: a machine may be as slow as it is.
settings.register_profile("steady", deadline=None, derandomize=True)  # the same examples in every run
# HYPOTHESIS_PROFILE=random looks for new ones, many times as many; what fails is kept as an @example.
settings.register_profile(
    "random", deadline=None, derandomize=False, print_blob=True, max_examples=100 * FACTORS["random"]
)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "steady"))
