"""How a view follows its node: no message of a burst is lost, and none waits for a slow page."""

from argparse import Namespace
from contextlib import suppress
from time import sleep
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from rclpy.serialization import serialize_message
from smartmesh_msgs.msg import ColliderPatch, ColliderPatchArray

from smartmesh_ros.tools.client.remote import Remote
from smartmesh_ros.tools.testing import Probe, heightmap_message

pytest.importorskip("viser", reason="viser is not installed; scripts/workspace run dev view")

from smartmesh_ros.tools.view import main, page


def test_tiles_that_are_published_in_a_burst_are_all_shown(remote: Remote, probe: Probe) -> None:
    maps = probe.publishers["heightmap"]
    remote.watch(set())

    def shown() -> set[str]:
        remote.spin(0.02)
        remote.apply_waiting()
        return set(remote.ground.tiles)

    probe.wait_for(lambda: [shown(), maps.get_subscription_count()][1])
    names = {f"tile_{number}" for number in range(8)}
    for name in names:
        maps.publish(heightmap_message(np.zeros((5, 5)), tile=name))
    assert maps.wait_for_all_acked()
    probe.wait_for(lambda: shown() == names, timeout=20.0)


def test_patches_are_those_of_the_newest_whole_message_and_of_all_changes_after(remote: Remote) -> None:
    rng = np.random.default_rng(0)
    known: dict[str, int] = {}
    for _ in range(30):
        for _ in range(int(rng.integers(5))):
            whole, names = rng.random() < 0.3, rng.choice([*"abcdef"], 2, replace=False).tolist()
            patches = [ColliderPatch(body_id=name, row=int(rng.integers(1000))) for name in names]
            gone = rng.choice([*"abcdef"], 1).tolist()
            message = ColliderPatchArray(incremental=not whole, removed=gone, patches=patches)
            remote._take("collider_patches", serialize_message(message))
            known = {name: row for name, row in known.items() if not whole and name not in gone}
            known |= {patch.body_id: patch.row for patch in patches}
        remote.apply_waiting()
        assert {name: patch.row for name, patch in remote.sight.patches.items()} == known


def test_messages_are_handled_however_long_a_page_takes(monkeypatch: pytest.MonkeyPatch) -> None:
    spent = {"page": 0.0, "messages": 0.0}
    left = iter([0.03] * 20)

    def spend(what: str, seconds: float) -> None:
        spent[what] += seconds
        sleep(seconds)

    made: Any = SimpleNamespace(url="", close=lambda: None, refresh=lambda: spend("page", next(left)))
    monkeypatch.setattr(page, "Page", lambda *_: made)
    remote: Any = SimpleNamespace(name="", missing="", close=lambda: None, spin=lambda time: spend("messages", time))
    options = Namespace(node="n", host="", port=0, rate=100.0, demo=False)
    with suppress(StopIteration):
        main.show(remote, options, SimpleNamespace(asked=False, starting=True))
    assert spent["messages"] > 0.8 * spent["page"] > 0.4
