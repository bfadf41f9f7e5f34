"""A node that tests share: what each leaves behind is taken away."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np
from smartmesh_msgs.srv import RemoveBodies
from std_srvs.srv import SetBool, Trigger

from smartmesh_ros.testing import Probe, heightmap_message

NOTHING = {"simulated": "0", "tracked": "0", "patches": "0"}


def clear(probe: Probe) -> None:
    """Takes all bodies and all terrain away, sets the node's time to zero and lets it run, until the node says so.

    Parameters and counts of what was refused stay as they are.
    """
    assert probe.call("pause", SetBool, data=False).success
    asked: set[str] = set()

    def empty() -> bool:
        probe.publish_bodies({})
        probe.publish_poses([])
        if names := [body.id for body in probe.latest("body_states").bodies]:
            probe.call("remove_bodies", RemoveBodies, ids=names)
        found = probe.diagnostics_by_task()
        for name in _tiles(found["terrain"]) - asked:  # one that is gone already would be refused, and counted
            asked.add(name)
            probe.publishers["heightmap"].publish(heightmap_message(np.zeros((0, 0)), tile=name, stamp=probe.now()))
        assert probe.call("reset", Trigger).success  # stamps too: the last test may have set them ahead
        return found["terrain"]["tiles"] == "0" and NOTHING.items() <= found["bodies"].items()

    probe.wait_for(empty)


def _tiles(terrain: Mapping[str, str]) -> set[str]:
    """Names of the tiles that the diagnostics list."""
    return {found[1] for key in terrain if (found := re.fullmatch(r"size of '(.*)'", key))}
