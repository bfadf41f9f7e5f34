"""Capacity of fleets on separate networks, and recovery from faults."""

from __future__ import annotations

import math
from statistics import median
from time import monotonic
from typing import Any

from smartmesh_ros.node.fleet.layout import WAVES
from smartmesh_ros.node.fleet.plan import FleetPlan
from studies.fleet.watcher import Site, load, site

# Real time, as far as it counts; bodies start so far apart [m], in squares of so many on a side, one to a quarter of
# the terrain, whose bodies share a node.
REAL_TIME, APART, SIDE = 0.98, 1.0, 24
NOBODY = "/nobody"  # a peer that is never heard


def places(count: int, first: int) -> list[tuple[float, float]]:
    """Where balls start [m]: one after the other in each quarter."""
    found = []
    for number in range(first, first + count):
        quarter, place = number % 4, number // 4
        x, y = (APART * (index + 0.5) for index in (place % SIDE, place // SIDE))
        found.append((x if quarter % 2 else -x, y if quarter // 2 else -y))
    return found


def capacity(nodes: int, *, start: int, more: int, most: int, seconds: float, meet: bool = True) -> dict[str, Any]:
    """Add bodies until the slowest node of a fleet falls behind real time; return the real-time factors at each number
    and the network traffic of a node [bytes/s]. ``meet``: True = bodies of different nodes collide."""
    # What is measured is how late nodes are: none is taken for dead for it.
    front = {"spread": "tiles", "tile_size": APART * SIDE, "timeout": 20.0}
    alone = {} if meet else {"bodies.peers": [NOBODY]}
    plan = FleetPlan(count=nodes, source=WAVES, front=front, parameters={"bodies.timeout": 20.0, **alone})
    runs = []
    with site(plan, with_bodies=False) as fleet:
        count = 0
        while count < most:
            added = start if count == 0 else more
            fleet.watcher.spawn(places(added, count), count)
            count += added
            fleet.watcher.spin(2.0)
            run = measure(fleet, seconds)
            runs.append({"bodies": count, **run})
            which = "" if meet else " by themselves"
            print(
                f"{nodes} nodes{which}, {count:5d} bodies: real-time factor {run['real_time']:.3f}, "
                f"{run['busy']:.2f} s of processor time a simulated second, "
                f"{run['sent'] / 1e6:.2f} MB/s sent by a node, load {load():.1f}",
                flush=True,
            )
            if run["real_time"] < REAL_TIME - 0.05:
                break
    return {"nodes": nodes, "meet": meet, "runs": runs, "carried": carried(runs), "load": load()}


def measure(fleet: Site, seconds: float) -> dict[str, float]:
    """Run a fleet; return the slowest node's real-time factor, the maximum processor time of a node for a simulated
    second [s], which hardly depends on other load, and the bytes a second that a node sent and received.
    """
    watcher, machines = fleet.watcher, fleet.machines
    for timings in watcher.timings.values():
        timings.clear()
    before, start = [machine.traffic() for machine in machines], monotonic()
    used = [machine.processor_time() for machine in machines]
    watcher.spin(seconds)
    span = monotonic() - start
    taken = [(machine.processor_time() - was) / span for machine, was in zip(machines, used, strict=True)]
    factors = []
    for timings in watcher.timings.values():
        window = sum(timing.window_s for timing in timings)
        simulated = sum(timing.real_time_factor * timing.window_s for timing in timings)
        factors.append(simulated / window if window else 0.0)
    pairs = [(machine.traffic(), was) for machine, was in zip(machines, before, strict=True)]
    sent, received = (sum(now[way] - was[way] for now, was in pairs) / span / len(machines) for way in (0, 1))
    busy = max(cpu / max(factor, 1e-9) for cpu, factor in zip(taken, factors, strict=True))
    return {"real_time": min(factors), "busy": busy, "sent": sent, "received": received}


def carried(runs: list[dict[str, Any]]) -> float:
    """Return the number of bodies at which the real-time factor crosses the bound, interpolated between the last number
    within the bound and the first one beyond; the last number if all are within."""
    within = 0
    for run in runs:
        if run["real_time"] < REAL_TIME:
            last = next((r for r in reversed(runs) if r["bodies"] == within), None)
            if last is None:
                return 0.0
            share = (last["real_time"] - REAL_TIME) / max(last["real_time"] - run["real_time"], 1e-9)
            return float(within + share * (run["bodies"] - within))
        within = run["bodies"]
    return float(within)


def faults(times: int, bodies: int = 30) -> dict[str, Any]:
    """Kill and restart the fullest of three nodes, then cut off and rejoin the fullest node, repeatedly; return the
    times [s] until every body is on one connected node, and the minimum number of bodies afterwards."""
    plan = FleetPlan(count=3, source={**WAVES, "wave.amplitude": 0.0}, parameters={"bodies.timeout": 2.0})
    found: dict[str, list[float]] = {"kill": [], "join": [], "cut": [], "heal": []}
    least = bodies
    with site(plan) as fleet:
        watcher = fleet.watcher
        watcher.spawn(places(bodies, 0), 0)
        watcher.wait_for(lambda: watcher.each_once(bodies), "bodies")
        for number in range(times):
            victim = watcher.fullest()

            def without(index: int) -> bool:
                heard = monotonic() - watcher.heard[watcher.nodes[index]]
                return heard > 1.0 and watcher.each_once(bodies)

            fleet.machines[victim].kill()
            found["kill"].append(watcher.wait_for(lambda: without(victim), "bodies of the killed node"))  # noqa: B023
            fleet.start_node(victim)
            found["join"].append(watcher.wait_for(lambda: joined(fleet, victim), "node that joins"))  # noqa: B023
            cut = watcher.fullest()
            fleet.machines[cut].connect(on=False)
            found["cut"].append(watcher.wait_for(lambda: without(cut), "bodies of the node that is cut off"))  # noqa: B023
            fleet.machines[cut].connect(on=True)
            found["heal"].append(
                watcher.wait_for(lambda: joined(fleet, cut) and watcher.each_once(bodies), "network")  # noqa: B023
            )
            least = min(least, len(watcher.owners()))
            print(f"fault {number + 1}: " + ", ".join(f"{k} {v[-1]:.1f} s" for k, v in found.items()), flush=True)
        again = int(watcher.front.get("spawned again", 0))
    return {
        "bodies": bodies, "least": least, "spawned_again": again, "times": times, "load": load(),
        **{name: {"median": median(of), "most": max(of)} for name, of in found.items() if of},
    }  # fmt: skip


def joined(fleet: Site, index: int) -> bool:
    """Return True if the watcher and the front receive a node's states again."""
    watcher = fleet.watcher
    heard = monotonic() - watcher.heard.get(watcher.nodes[index], -math.inf) < 1.0
    return heard and watcher.complete()
