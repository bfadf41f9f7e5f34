"""A tracked machine on ground that heaves up under it: the way, and the speeds of its tracks."""

from __future__ import annotations

from pathlib import Path


def robot_file() -> Path:
    """Return the URDF of an excavator's undercarriage, with the driven surfaces ``left_track`` and ``right_track``."""
    return Path(__file__).parent / "undercarriage.urdf"
