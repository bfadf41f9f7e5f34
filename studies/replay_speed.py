"""``make replay-speed``: how much faster than real time a replay runs; the table of docs/replay.md."""

import tempfile
from collections.abc import Callable, Iterator
from contextlib import nullcontext
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
import pybullet_data
from sensor_msgs.msg import JointState

from smartmesh_ros.startup.executables import silence_pybullet
from smartmesh_ros.tools.testing import heightmap_message

Message = tuple[str, float, Any]
PAGE = Path("docs/replay.md")
HUSKY = f"{{id: husky, urdf: {pybullet_data.getDataPath()}/husky/husky.urdf, xy: [0, 0], above: 0.3}}"
WHEELS = [f"{place}_wheel" for place in ("front_left", "front_right", "rear_left", "rear_right")]
BOX = "{{id: box_{0}, shape: box, size: [0.4, 0.3, 0.2], mass: 2.0, xy: [{1:.2f}, {2:.2f}], clearance: 0.05}}"
BOXES = [BOX.format(k, 1.6 * (k % 10) - 7.2, 1.6 * (k // 10) - 7.2) for k in range(100)]
MAP_PERIOD, BEGIN, LENGTH = 0.1, 0.5, 4.0  # of the maps; what is not measured, and the end of what is [s]
OUTPUTS = {"without outputs": (), "with `body_states`": ("body_states",), "with all outputs": None}


def waves(side: int, spacing: float, *, drives: bool) -> Iterator[Message]:
    """Yield maps of waves around the origin, and commands to the wheels of a robot that turns on the spot."""
    x = spacing * (np.arange(side) - side // 2)
    for time in np.arange(0.0, LENGTH, MAP_PERIOD).tolist():
        heights = np.tile(0.03 * np.sin(x - 2.0 * time), (side, 1))
        yield "heightmap", time, heightmap_message(heights, resolution=spacing, origin=(float(x[0]), float(x[0]), 0.0))
        if drives:
            yield "joint_commands", time + 0.05, JointState(name=WHEELS, velocity=[3.0, -3.0, 3.0, -3.0])


CASES: dict[str, tuple[list[str], Callable[[], Iterator[Message]]]] = {
    "one robot (husky), maps of 41 x 41 at 10 Hz": ([HUSKY], lambda: waves(41, 0.1, drives=True)),
    "100 boxes on waves, maps of 201 x 201 at 10 Hz": (BOXES, lambda: waves(201, 0.1, drives=False)),
    "one robot, maps of 1024 x 1024 at 10 Hz": ([HUSKY], lambda: waves(1024, 0.05, drives=True)),
}


def speed(bodies: list[str], messages: list[Message], topics: tuple[str, ...] | None) -> float:
    """Return simulated seconds per second of processor time, with outputs (None = all) written to a file."""
    from smartmesh_ros.tools.replay.mcap_file import McapFile
    from smartmesh_ros.tools.replay.replay import Replay

    with tempfile.TemporaryDirectory() as folder:
        file = None if topics == () else McapFile(Path(folder) / "out.mcap")
        replaying = Replay(messages, {"bodies.spawn": bodies}, file=file, topics=topics or ())
        with replaying as replay, file or nullcontext():
            replay.run(BEGIN)
            start = process_time()
            replay.run(LENGTH)
            return (LENGTH - BEGIN) / (process_time() - start)


def main() -> None:
    """Measure, and write the table."""
    silence_pybullet()
    from studies.pages import fill, number, short, table

    rows = []
    for case, (bodies, make) in CASES.items():
        messages = list(make())
        rows.append([case, *(number(speed(bodies, messages, topics)) for topics in OUTPUTS.values())])
        print(" | ".join(rows[-1]), flush=True)
    fill(PAGE, {"speed": f"Measured on {short()}.\n\n{table(['', *OUTPUTS], rows)}"})
