"""The URDF of a tracked machine."""

from pathlib import Path


def robot_file() -> Path:
    """Return the URDF of an excavator's undercarriage, with the driven surfaces ``left_track`` and ``right_track``."""
    return Path(__file__).parent / "undercarriage.urdf"
