"""What the picture of the guide shows is so."""

from pathlib import Path

import numpy as np

from studies.matrix.picture import corrected, draw_box, noisy, ways


def test_the_picture_is_drawn(tmp_path: Path) -> None:
    draw_box(tmp_path / "box.png", seconds=0.2)
    assert (tmp_path / "box.png").read_bytes().startswith(b"\x89PNG")


def test_only_corrections_leave_a_box_on_the_ground() -> None:
    *others, ours = ways(0.01)
    assert corrected(ours, 0.1).max() < 0.1005
    assert all(corrected(way, 0.1).max() > 0.2 for way in others)


def test_only_corrections_keep_a_box_within_the_noise() -> None:
    *others, ours = ways(0.01)
    assert np.abs(noisy(ours, 0.01, 2.0)[240:]).max() < 0.01
    assert all(np.abs(noisy(way, 0.01, 2.0)[240:]).max() > 0.02 for way in others)
