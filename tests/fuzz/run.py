"""``make fuzz``: spoilt messages for every topic, service and parameter of ``terrain_collider``.

Each share of the messages goes to a node in a process of its own, whose end is noticed; a message that made it end or
broke a rule is kept in ``out/fuzz/``. Ends with 1 if there was any.
"""

import argparse
import json
import multiprocessing
import os
import sys
import tempfile
import traceback
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np
from rclpy.serialization import serialize_message

from smartmesh_ros.node.inputs.adapters import ADAPTERS
from tests.fuzz import seeds
from tests.fuzz.mutations import mutated, spoil
from tests.fuzz.target import FindingError, Target, target
from tests.fuzz.wire import over_the_wire

# Every node takes one of these inputs, and changes of the terrain mean one of these two.
SETTINGS = [(name, changes) for changes in ("motion", "correction") for name in ("heightmap", *ADAPTERS)]
OFTEN = ("heightmap", "heightmap_update", "spawn_body")
# Of each kind of input, so many seeds are kept to be spoilt and spliced.
POOL = 60


def stream(target: Target, count: int, rng: np.random.Generator) -> Iterator[tuple[str, bytes]]:
    """So many messages with their input: good ones now and then, so that there is terrain and there are bodies; the
    others with spoilt fields or spoilt bytes."""
    pools: dict[str, list[bytes]] = {name: [] for name in target.inputs}
    names = [name for name in pools for _ in range(3 if name in OFTEN else 1)]
    for _ in range(count):
        name = names[int(rng.integers(len(names)))]
        pool, chance = pools[name], rng.random()
        if pool and chance > 0.5:
            others = pools[names[int(rng.integers(len(names)))]] if rng.random() < 0.1 else pool
            yield name, mutated(pool[int(rng.integers(len(pool)))], others or pool, rng)
            continue
        message = seeds.make(name, rng)
        if name == "restore_state" and target.saved is not None:
            message.state = target.saved
        for _ in range(int(rng.integers(1, 5)) if pool and chance > 0.2 else 0):
            spoil(message, rng)
        data = serialize_message(message)
        if len(pool) < POOL and (not pool or chance <= 0.2):
            pool.append(data)
        yield name, data


def attack(terrain_input: str, changes: str, count: int, seed: int, record: Path | None = None) -> dict[str, Any]:
    """Gives ``count`` messages to one node and returns the counts. Raises `FindingError`."""
    with target(terrain_input, record, changes) as node:
        for name, data in stream(node, count, np.random.default_rng(seed)):
            node.give(name, data)
        return node.result()


def _work(count: int, seed: int, folder: Path) -> None:
    try:
        result = attack(*SETTINGS[seed % len(SETTINGS)], count, seed, folder / "last")
    except FindingError as finding:
        result = {"finding": traceback.format_exc()[-3000:], "name": finding.name, "bytes": finding.data.hex()}
    (folder / "result.json").write_text(json.dumps(result))


def shard(count: int, seed: int) -> dict[str, Any]:
    """`attack` in a process of its own; a finding or a crash is returned under ``finding``."""
    memory = Path("/dev/shm")  # each message is written down before it is given
    with tempfile.TemporaryDirectory(dir=memory if memory.is_dir() else None) as name:
        folder = Path(name)
        process = multiprocessing.get_context("spawn").Process(target=_work, args=(count, seed, folder))
        process.start()
        process.join()
        file = folder / "result.json"
        if file.exists():
            return dict(json.loads(file.read_text()))
        last = (folder / "last").read_bytes() if (folder / "last").exists() else b""
        input_name, _, data = last.partition(b"\n")
        return {"finding": f"the process ended with {process.exitcode}", "name": input_name.decode(errors="replace"),
                "bytes": data.hex()}  # fmt: skip


def main() -> None:
    """Runs the shares one after the other and writes what became of the messages."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--messages", type=int, default=120_000)
    parser.add_argument("--share", type=int, default=4_000, help="messages to one node")
    parser.add_argument("--wire", type=int, default=10_000, help="messages beyond these, over DDS to a node process")
    parser.add_argument("--jobs", type=int, default=1, help="nodes at the same time")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=Path, default=Path("out/fuzz"))
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    start, findings = monotonic(), 0
    totals: dict[str, Counter[str]] = {"counts": Counter(), "reasons": Counter(), "compared": Counter()}
    with ThreadPoolExecutor(options.jobs) as pool:
        shares = range(-(-options.messages // options.share))
        jobs = {pool.submit(shard, options.share, options.seed + index): options.seed + index for index in shares}
        for job in as_completed(jobs):
            seed, result = jobs[job], job.result()
            if "finding" in result:
                findings += 1
                print(f"{seed}: FINDING {result['name']}: {result['finding']}", flush=True)
                (options.out / f"finding_{seed}.json").write_text(json.dumps(result))
                continue
            for name, total in totals.items():
                total.update(result[name])
            print(f"{seed}: {sum(result['counts'].values())} messages, {monotonic() - start:.0f} s", flush=True)
    wire = over_the_wire(options.wire, options.seed) if options.wire else {}
    summary = {"messages": totals["counts"].total(), "seconds": round(monotonic() - start), "findings": findings,
               **totals.pop("compared"), **wire}  # fmt: skip
    print(json.dumps(summary))
    (options.out / "summary.json").write_text(json.dumps({**summary, **totals}, indent=1, sort_keys=True))
    sys.exit(1 if findings else 0)


if __name__ == "__main__":
    main()
