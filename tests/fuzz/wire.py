"""Spoilt messages over real DDS to a node in a process of its own."""

import ast

import numpy as np
from rclpy.serialization import serialize_message
from smartmesh_msgs.msg import Heightmap
from std_srvs.srv import Trigger

from smartmesh_ros.tools.testing import Probe, Process
from tests.fuzz import seeds
from tests.fuzz.mutations import mutated
from tests.node.shared import refusals
from tests.node.test_faults import on_map

# Messages between two looks at the patches.
ROUND = 200


def over_the_wire(count: int, seed: int) -> dict[str, int]:
    """Publishes ``count`` spoilt messages on all topics of a node process over DDS. After each round a good map is
    published, and every patch must lie on it. Returns how many messages there were, and how many the node has refused;
    raises if it ends or its patches leave the map."""
    rng = np.random.default_rng(seed)
    with Probe() as probe, probe.running(parameters={"terrain.motion": "hold", "frame_id": "map"}) as process:
        names = list(probe.publishers)
        pools = {name: [serialize_message(seeds.make(name, rng)) for _ in range(20)] for name in names}
        for sent in range(count):
            name = names[int(rng.integers(len(names)))]
            pool = pools[name]
            probe.publishers[name].publish(mutated(pool[int(rng.integers(len(pool)))], pool, rng))
            probe.spin(0.0)
            if (sent + 1) % ROUND == 0:
                require_well(probe, process, rng)
        require_well(probe, process, rng)
        return {"over DDS": count, "over DDS, refused": refusals(probe).total()}


def only_the_single_map(probe: Probe) -> bool:
    """Whether there is no tile but the one without a name; takes those away that the diagnostics name."""
    keys = [key.removeprefix("size of ") for key in probe.diagnostics("terrain") if key.startswith("size of ")]
    others = [name for name in map(ast.literal_eval, keys) if name]
    for name in others:
        probe.publishers["heightmap"].publish(Heightmap(tile=name))
        probe.spin()
    return not others


def require_well(probe: Probe, process: Process, rng: np.random.Generator) -> None:
    """Waits until the node has patches again on a map that it is given, and nowhere else."""
    response = probe.call("reset", Trigger)  # its clocks may have been set to the end of time
    assert response.success
    probe.wait_for(lambda: only_the_single_map(probe), watch=process)
    good = probe.publish_map(rng.normal(size=(30, 30)), resolution=0.25, stamp=Heightmap().header.stamp)
    probe.wait_for(on_map(probe, good), watch=process)
