"""Entries of ``bodies.spawn``."""

import pytest

from smartmesh_ros import Cylinder, InputError
from smartmesh_ros.node.services.body_entries import entries_from


def test_dimensions_have_the_order_of_the_messages() -> None:
    entries = entries_from(["{id: can, shape: cylinder, size: [0.8, 0.25], xy: [0, 0]}"])
    assert entries["can"].shape == Cylinder(height=0.8, radius=0.25)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("{id: x, shape: spere, size: [0.2], xy: [0, 0]}", "no shape 'spere'; did you mean 'sphere'?"),
        ("{id: x, shape: [0.2], xy: [0, 0]}", "no shape [0.2]; choose sphere, box, cylinder, capsule"),
        ("{id: x, xy: [0, 0]}", "needs a shape (sphere, box, cylinder, capsule) and its size, or a urdf"),
        ("{id: x, shape: box, size: [1, 1], xy: [0, 0]}", "BOX needs 3 dimensions [x, y, z], not 2"),
        ("{id: x, shape: box, size: 1, xy: [0, 0]}", "size must be a list of numbers in metres"),
        ("{id: x, shape: sphere, size: [-1], xy: [0, 0]}", "radius of the sphere is -1.0 m"),
        ("{id: x, shape: sphere, size: [1], mas: 3, xy: [0, 0]}", "'mas' is unknown; did you mean 'mass'?"),
        ("{shape: sphere, size: [1], xy: [0, 0]}", "must be a mapping with id"),
    ],
)
def test_a_wrong_entry_is_told_what_would_be_right(text: str, words: str) -> None:
    with pytest.raises(InputError) as caught:
        entries_from([text])
    assert str(caught.value).startswith("bodies.spawn has entry ") and words in str(caught.value)
