"""Attached bodies and the ground under them: contacts from the map, sleep, corrections, the step."""
