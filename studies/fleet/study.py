"""``make fleet-study``: capacity of several nodes on one terrain, accuracy of their collisions, and faults.

Nodes run in network namespaces joined by a bridge: UDP between them, no shared memory.
"""

from __future__ import annotations

import argparse
import json
import os
from pathlib import Path
from typing import Any

from studies.fleet import live, network, physics, pictures
from studies.fleet.watcher import load
from studies.fleet.worlds import RATE

PARTS = ("physics", "cost", "capacity", "faults")


def machine() -> str:
    """The machine, by cores and processor."""
    lines = Path("/proc/cpuinfo").read_text().splitlines()
    model = next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), "unknown")
    return f"{os.cpu_count()} cores, {model}"


def run(parts: list[str], *, quick: bool, file: Path) -> dict[str, Any]:
    """Runs some parts and keeps what there is in ``file`` after each."""
    data: dict[str, Any] = json.loads(file.read_text()) if file.is_file() else {}
    data |= {"machine": machine(), "netem": network.delays_are_to_be_had()}
    for part in parts:
        data[f"load before {part}"] = load()
        if part == "physics":
            step = 1e3 / RATE
            delays = (0.0, step, 25.0, 50.0) if quick else (0.0, step, 12.5, 25.0, 37.5, 50.0)
            data[part] = physics.errors(delays, (0.1,) if quick else (0.02, 0.05, 0.1), 1 if quick else 7)
        elif part == "cost":
            data[part] = {count: physics.guest_cost(count, 100) for count in ((50,) if quick else (50, 100, 200))}
        elif part == "capacity":
            data[part] = [
                live.capacity(
                    nodes, start=100 if quick else 200, more=100, most=100 if quick else 2200,
                    seconds=4.0 if quick else 6.0, meet=meet,
                )
                for nodes, meet in (((2, True),) if quick else ((1, True), (2, True), (4, True), (4, False)))
            ]  # fmt: skip
        elif part == "faults":
            data[part] = live.faults(1 if quick else 20)
        file.write_text(json.dumps(data, indent=1))
        print(json.dumps(data[part]), flush=True)
    return data


def main() -> None:
    """Runs the study."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="a minute or two, and few figures")
    parser.add_argument("--only", choices=PARTS, nargs="+", default=list(PARTS), help="these parts only")
    parser.add_argument("--out", type=Path, default=Path("out/fleet"), help="folder of figures and pictures")
    options = parser.parse_args()
    network.enter()
    options.out.mkdir(parents=True, exist_ok=True)
    data = run(options.only, quick=options.quick, file=options.out / "fleet.json")
    if "physics" in data:
        pictures.draw_errors(options.out / "errors.png", data["physics"], data["machine"])
    if "capacity" in data:
        pictures.draw_capacity(options.out / "capacity.png", data["capacity"], data["machine"])
    print(f"wrote {options.out}")


if __name__ == "__main__":
    main()
