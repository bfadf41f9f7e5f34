"""The demo's pictures show all of the ground that they begin to show, and every body that their legend names. What ends
the demo, and the rover's search for its robot."""

import subprocess
import sys
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.image import imread
from smartmesh_msgs.msg import TrackedBody, TrackedBodyArray

from smartmesh_ros.errors import InputError
from smartmesh_ros.tools.demo import demo, demo_pictures
from smartmesh_ros.tools.demo.demo_pictures import BODY_COLOURS, Frame
from smartmesh_ros.tools.demo.rover import Rover
from tests.node.shared import made_with

# Balls and boxes in the middle, and a robot that has driven far away.
PLACES = {"ball_0": (0.0, 0.0), "ball_1": (3.0, 1.0), "box_2": (-2.0, -3.0), "husky": (19.0, 8.0)}


def pixels(picture: np.ndarray, kind: str) -> int:
    """Pixels in about the colour of a kind of body, however light falls on it."""
    colour = np.array(to_rgb(BODY_COLOURS[kind]))
    brightness = picture @ colour / (colour @ colour)
    away = np.abs(picture - brightness[..., None] * colour).max(axis=2)
    return int(((away < 0.06) & (brightness > 0.4) & (brightness < 1.1)).sum())


def test_all_of_the_ground_and_every_body_are_in_the_pictures_and_no_other_in_the_legend(tmp_path: Path) -> None:
    x = np.linspace(-25.0, 25.0, 101)
    heights = np.tile(0.5 * np.sin(0.3 * x), (101, 1)).astype(np.float32)
    bodies = {name: (*xy, 0.8) for name, xy in PLACES.items()}
    frames = [Frame(float(time), x, x, heights, np.empty((0, 3, 3)), bodies) for time in range(6)]
    still, _ = demo_pictures.draw(frames, tmp_path)
    picture = np.asarray(imread(still))[..., :3]  # colours (rows, columns, 3)
    for edge in (picture[0], picture[-1], picture[:, 0], picture[:, -1]):
        assert (edge > 0.99).all()
    for row in np.array_split(picture[40:-60], 2):  # of three plans each, without title and legend
        for plan in np.array_split(row, 3, axis=1):
            assert pixels(plan, "husky") > 30, "it went far"
    assert pixels(picture[-60:], "ball") > 5 and pixels(picture[-60:], "husky") > 30
    assert pixels(picture, "can") == 0


def test_what_would_fail_at_the_end_of_the_demo_is_told_at_its_start(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    with pytest.raises(SystemExit, match="name another folder by --out"):
        demo.main(["--out", "/proc/nowhere"])
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    monkeypatch.delitem(sys.modules, "smartmesh_ros.tools.demo.demo_pictures")
    monkeypatch.delattr("smartmesh_ros.tools.demo.demo_pictures")
    with pytest.raises(SystemExit, match="its pictures need matplotlib: pip install matplotlib"):
        demo.main(["--out", str(tmp_path)])


def test_the_demo_fails_when_one_of_its_nodes_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    """Bodies that nobody simulates are not lost either."""
    ended = subprocess.Popen(["false"])
    ended.wait()
    monkeypatch.setattr(demo, "processes", lambda commands: nullcontext(dict.fromkeys(commands, ended)))
    monkeypatch.setattr(demo.Demo, "spawn_all", lambda _: None)
    remote: Any = SimpleNamespace(name="/n", node=SimpleNamespace(create_publisher=lambda *_: None))
    with demo.demo_running(remote) as made, pytest.raises(InputError, match="terrain_source has ended, with 1"):
        made.require_nodes()


def test_a_rover_that_is_there_is_not_spawned_again() -> None:
    """Also one of a run of the node that has ended; else the call is refused five times a second, for ever."""
    calls: list[Any] = []
    asked = SimpleNamespace(add_done_callback=calls.append)
    with made_with(Rover, {}) as node:
        node._maps = SimpleNamespace(get_subscription_count=lambda: 1, publish=lambda _: None)
        node._spawner = SimpleNamespace(service_is_ready=lambda: True, call_async=lambda _: asked)
        for name, count in (("rover", 0), ("other", 1), ("rover", 1), ("other", 2)):
            node._steer(TrackedBodyArray(bodies=[TrackedBody(id=name)]))
            node._call_at = 0.0
            node._start()
            assert len(calls) == count, name
