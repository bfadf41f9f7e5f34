"""What holds for all tests."""

from hypothesis import settings

# Tests say nothing of time: a machine may be as slow as it is.
settings.register_profile("any machine", deadline=None)
settings.load_profile("any machine")
