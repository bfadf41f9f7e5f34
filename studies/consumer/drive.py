"""MuJoCo in a separate process, in real time, on ground from topics.

python -m studies.consumer.drive CASE.json RESULT.json
"""

from __future__ import annotations

import json
import math
import sys
from dataclasses import asdict, dataclass
from pathlib import Path
from time import monotonic, perf_counter, process_time

import numpy as np

from smartmesh_ros.ground.shapes import Sphere
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.tools.evaluation.clearance import clearances
from studies.consumer.cases import Case, TrueGround
from studies.consumer.map_ground import MapGround
from studies.consumer.rover import RADIUS, STEP, Rover
from studies.consumer.served_ground import ServedGround

# How long the first ground may take [s].
PATIENCE = 120.0
# The rover starts here [m], drops from so high [m], and is judged once it has settled for so long [s].
START_X, DROP, SETTLE = -6.0, 0.01, 2.0
# Steps from one message about the wheels to the next, from one look for messages when the loop is late, and from one
# position that is judged to the next.
TRACKING, LOOKING, JUDGED = 4, 4, 5


@dataclass(frozen=True, kw_only=True)
class Drive:
    """Result of a drive. ``ages`` [s]: age of the ground in every step. ``clearance`` [m]: from each wheel to the true
    ground, negative = penetration. ``lost``: wheels without ground, counted in every step, and wheels whose centre is
    below the ground. ``messages``: number received. ``taking`` [s]: time of reading each message, if known. ``steps``,
    ``updates``, ``cpu`` [s]: MuJoCo's steps, updates of its ground, and processor time of the process. ``memory``
    [MiB]: maximum resident memory. ``late`` [s]: maximum delay behind real time. ``way`` [m]: distance that the rover
    drove. ``node``: number of cores that the node used, NaN without a node."""

    ages: list[float]
    clearance: list[float]
    lost: int
    messages: int
    taking: list[float]
    steps: float
    updates: float
    cpu: float
    memory: float
    late: float
    way: float
    node: float = math.nan


def drive(case: Case) -> Drive:
    """Drives the rover for the length of a case."""
    truth = TrueGround(case)
    ground: ServedGround | MapGround
    if case.source == "patches":
        ground = ServedGround()
    else:
        ground = MapGround(truth.geometry.rows, truth.geometry.columns, case.resolution)
    try:
        return drive_on(case, truth, ground)
    finally:
        ground.close()


def drive_on(case: Case, truth: TrueGround, ground: ServedGround | MapGround) -> Drive:
    """Drives the rover on ``ground``, in step with its clock."""
    rover = Rover(ground.fields())
    _place(rover, truth, ground.now())
    end = monotonic() + PATIENCE
    while not ground.ready(rover):
        if monotonic() > end:
            raise TimeoutError(f"no ground after {PATIENCE:g} s")
        ground.spin(0.02)
    begin, cpu, messages = ground.now(), process_time(), ground.received
    _place(rover, truth, begin)
    count = round(case.seconds / STEP)
    ages, wheels = np.empty(count), np.empty((count, 4, 3))
    lost, late, stepping, updating = 0, 0.0, 0.0, 0.0
    for k in range(count):
        due = begin + k * STEP
        while (left := due - ground.now()) > 0.0:
            ground.spin(left)
        if k % LOOKING == 0:
            ground.spin(0.0)
        late = max(late, -left)
        start = perf_counter()
        lost += ground.update(rover, due)
        middle = perf_counter()
        rover.step()
        updating, stepping = updating + middle - start, stepping + perf_counter() - middle
        if k % TRACKING == 0:
            ground.track(rover, due + STEP)
        ages[k], wheels[k] = ground.age(ground.now()), rover.wheels()
    cpu = process_time() - cpu
    memory = _most_memory()
    clearance = _judge(truth, wheels, begin)
    return Drive(
        ages=ages.tolist(), clearance=clearance.ravel().tolist(), lost=lost + int((clearance < -RADIUS).sum()),
        messages=ground.received - messages, taking=getattr(ground, "costs", []), steps=stepping, updates=updating,
        cpu=cpu, memory=memory, late=late, way=float(np.linalg.norm(wheels[-1].mean(axis=0) - wheels[0].mean(axis=0))),
    )  # fmt: skip


def _place(rover: Rover, truth: TrueGround, now: float) -> None:
    """Puts the rover at its start, just above the ground of ``now`` [s]."""
    rover.place(START_X, 0.0, 0.0)
    wheels = rover.wheels()
    below = truth.around(wheels, 2.0 * RADIUS, now).below(wheels)
    rover.place(START_X, 0.0, float(below.max()) + RADIUS + DROP)


def _judge(truth: TrueGround, wheels: FloatArray, begin: float) -> FloatArray:
    """Return clearances (n, 4) [m] of a subset of the wheels' positions (steps, 4, 3) [m] from the true ground."""
    chosen = range(round(SETTLE / STEP), len(wheels), JUDGED)
    shape, unturned = Sphere(RADIUS), np.tile([0.0, 0.0, 0.0, 1.0], (4, 1))
    found = []
    for k in chosen:
        now = begin + (k + 1) * STEP  # positions are those after the step
        found.append(clearances(truth.around(wheels[k], 2.0 * RADIUS, now), shape, wheels[k], unturned))
    return np.array(found).reshape(-1, 4)


def _most_memory() -> float:
    """Resident memory of this process, at the most so far [MiB]; 0 where the system does not tell."""
    status = Path("/proc/self/status")
    lines = status.read_text().splitlines() if status.is_file() else []
    return next((float(line.split()[1]) / 1024.0 for line in lines if line.startswith("VmHWM")), 0.0)


def main() -> None:
    """Runs one case."""
    case = Case(**json.loads(Path(sys.argv[1]).read_text()))
    Path(sys.argv[2]).write_text(json.dumps(asdict(drive(case))))


if __name__ == "__main__":
    main()
