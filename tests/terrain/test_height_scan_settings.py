"""Height scans refuse settings that cannot be, and say what would be right."""

import math
from typing import Any

import pytest

from smartmesh_ros import HeightScan, InputError


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"size": (1.0,)}, "size of a height scan is (1.0,); it must be 2 numbers"),
        ({"size": (-1.0, 1.0)}, "size"),
        ({"size": ("1", 1.0)}, "size"),
        ({"size": (math.nan, 1.0)}, "size"),
        ({"spacing": 0.0}, "above 0"),
        ({"spacing": 0.001}, "at most 100000 points"),
        ({"spacing": None}, "spacing of a height scan is None; it must be a number"),
        ({"offset": (0.0, 0.0)}, "3 numbers"),
        ({"offset": (0.0, math.inf, 0.0)}, "offset"),
        ({"order": "zx"}, "one of ('xy', 'yx')"),
        ({"values": "depth"}, "one of ('height', 'clearance')"),
        ({"distribution": "pink"}, "one of ('uniform', 'normal')"),
        ({"noise": -0.1}, "noise"),
        ({"noise": True}, "noise"),
        ({"clip": (1.0, -1.0)}, "a lower and a higher bound"),
        ({"scale": math.inf}, "finite"),
        ({"delay": 11.0}, "0 to 10 s"),
        ({"seed": -1}, "whole number"),
        ({"seed": 0.5}, "whole number"),
    ],
)
def test_settings_that_cannot_be_are_refused(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError) as refused:
        HeightScan.of("isaac_lab", **changes)
    assert refused.value.reason == "height_scan"
    assert words in str(refused.value)


def test_an_unknown_layout_is_refused() -> None:
    with pytest.raises(InputError, match="choose one of"):
        HeightScan.of("isaac_gym")
