"""Writes a bag of the demo for the tuner: the maps of the moving elevation model and the commands to the robot's
wheels, and beside the bag a parameter file with the demo's bodies.

scripts/workspace run dev -- python scripts/make_demo_bag.py out/demo_bag
"""

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import yaml

from smartmesh_ros.node.timing.pacing import stamp_of
from smartmesh_ros.scenes.eight import robot_file
from smartmesh_ros.startup.arguments import Parser
from smartmesh_ros.tools.demo.demo import DRIVE, PLACES, ROBOT, SOURCE
from smartmesh_ros.tools.demo.terrain_source import SPECS, make_scene, map_of
from smartmesh_ros.tools.testing import bags

START = 1_700_000_000.0  # stamps in the past, like those of a recorded bag [s]
SECONDS = 8.0  # length of the bag [s]
COMMAND_RATE = 4.0
SHAPES = ("{shape: sphere, size: [0.25]", "{shape: box, size: [0.6, 0.4, 0.3]", "{shape: cylinder, size: [0.4, 0.25]")


def messages() -> Iterator[tuple[str, float, Any]]:
    """Yield (topic, time [s], message) in the order of time."""
    scene = make_scene({**{spec.name: spec.default for spec in SPECS}, **SOURCE})
    rate = float(SOURCE["rate"])  # type: ignore[arg-type]
    for number in range(math.floor(SECONDS * rate)):
        time = START + number / rate
        message = map_of(scene.geometry, scene.heights(number / rate), stamp_of(time))
        yield "/terrain_collider/heightmap", time, message
        if number % round(rate / COMMAND_RATE) == 0:
            yield "/terrain_collider/joint_commands", time, DRIVE


def bodies() -> list[str]:
    """Return the demo's two dozen bodies and its robot, as entries of ``bodies.spawn``."""
    entries = [
        f"{SHAPES[index % 3]}, id: body_{index}, mass: 5.0, xy: [{x:.3f}, {y:.3f}], above: 0.8}}"
        for index, (x, y) in enumerate(PLACES)
    ]
    return [*entries, f"{{id: {ROBOT}, urdf: {robot_file()}, xy: [-4.0, 0.0], above: 0.4}}"]


def write(path: Path) -> Path:
    """Write a bag into a folder that does not exist yet; return the path of the parameter file."""
    bags.write(path, messages())
    file = path.with_suffix(".yaml")
    file.write_text(yaml.safe_dump({"/**": {"ros__parameters": {"bodies.spawn": bodies()}}}, width=200))
    print(f"wrote {path} and {file}")
    return file


if __name__ == "__main__":
    parser = Parser(description=__doc__)
    parser.add_argument("path", type=Path, help="folder of the bag, which does not exist yet")
    write(parser.parse_args().path)
