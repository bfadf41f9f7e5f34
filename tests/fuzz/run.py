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
from importlib import import_module
from pathlib import Path
from time import monotonic
from typing import Any

import hypothesis
import numpy as np
from hypothesis import strategies as st
from rclpy.serialization import serialize_message
from rosidl_parser.definition import AbstractSequence, AbstractString, Array, BasicType, NamespacedType

from smartmesh_ros.node.inputs.adapters import ADAPTERS
from smartmesh_ros.tools.testing import Probe
from tests.fuzz import seeds
from tests.fuzz.mutations import mutated
from tests.fuzz.target import FindingError, Target
from tests.fuzz.wire import bombard

INPUTS = ("heightmap", *ADAPTERS)
# What changes of the terrain mean: of the nodes that take an input, every other one.
CHANGES = ("motion", "correction")
_NAMES = ("", "map", "odom", "a", "ball", "rover", "body_0", "robot", "robot/wheel", "x" * 300, "\u00e4\u6f22", "a\nb")
# Of each kind of input, so many seeds are kept to be spoilt and spliced.
POOL = 60
# Every so many shares, one of messages that Hypothesis makes.
EXAMPLES = 6


def stream(target: Target, count: int, rng: np.random.Generator) -> Iterator[tuple[str, bytes]]:
    """So many messages with their input: good ones now and then, so that there is terrain and there are bodies."""
    pools: dict[str, list[bytes]] = {name: [] for name in target.inputs}
    names = [name for name in pools for _ in range(3 if name in ("heightmap", "heightmap_update", "spawn_body") else 1)]
    everything: list[bytes] = []
    for _ in range(count):
        name = names[int(rng.integers(len(names)))]
        pool = pools[name]
        if len(pool) < POOL or rng.random() < 0.1:
            good = serialize_message(seeds.make(name, rng))
            if len(pool) < POOL:
                pool.append(good)
                everything.append(good)
            yield name, good
        else:
            others = everything if rng.random() < 0.1 else pool
            yield name, mutated(pool[int(rng.integers(len(pool)))], others, rng)


def messages(kind: Any) -> st.SearchStrategy[Any]:
    """Hypothesis's strategy for messages of a type: every field within what its type can hold."""
    fields = kind.get_fields_and_field_types()
    parts = {name: _values(slot) for name, slot in zip(fields, kind.SLOT_TYPES, strict=True)}
    return st.builds(kind, **parts)


def _values(slot: Any) -> st.SearchStrategy[Any]:
    if isinstance(slot, BasicType):
        return _numbers(slot.typename)
    if isinstance(slot, AbstractString):
        return st.sampled_from(_NAMES) | st.text(max_size=12, alphabet=st.characters(exclude_categories=["Cs"]))
    if isinstance(slot, NamespacedType):
        kind = getattr(import_module(".".join(slot.namespaces)), slot.name)
        if slot.name == "Quaternion":
            return st.just(kind(w=1.0)) | messages(kind)
        return messages(kind)
    if isinstance(slot, Array):
        return st.lists(_values(slot.value_type), min_size=slot.size, max_size=slot.size)
    assert isinstance(slot, AbstractSequence)
    return st.lists(_values(slot.value_type), max_size=4) | st.lists(_values(slot.value_type), min_size=9, max_size=9)


def _numbers(name: str) -> st.SearchStrategy[Any]:
    if name == "boolean":
        return st.booleans()
    if name in ("float", "double"):
        return st.floats(-20.0, 20.0, width=32) | st.floats(width=32 if name == "float" else 64)
    bounds = np.iinfo({"octet": "uint8", "char": "uint8"}.get(name, name))
    return st.integers(0, 4) | st.integers(int(bounds.min), int(bounds.max))


def attack(
    terrain_input: str, count: int, seed: int, record: Path | None = None, changes: str = "motion"
) -> dict[str, Any]:
    """Gives ``count`` messages to one node and returns the counts. Raises `FindingError`."""
    rng = np.random.default_rng(seed)
    with Target(terrain_input, record, changes) as target:
        for name, data in stream(target, count, rng):
            target.give(name, data)
        return target.result()


def attack_with_examples(
    terrain_input: str, count: int, seed: int, record: Path | None = None, changes: str = "motion"
) -> dict[str, Any]:
    """The same with ``count`` messages that Hypothesis makes field by field, in between good ones."""
    rng = np.random.default_rng(seed)
    with Target(terrain_input, record, changes) as target:
        kinds = {name: messages(target.kind(name)) for name in target.inputs}

        @hypothesis.seed(seed)
        @hypothesis.settings(
            max_examples=count, database=None, deadline=None, phases=[hypothesis.Phase.generate],
            suppress_health_check=list(hypothesis.HealthCheck), derandomize=False,
        )  # fmt: skip
        @hypothesis.given(st.data())
        def give(data: st.DataObject) -> None:
            name = data.draw(st.sampled_from(list(kinds)))
            if rng.random() < 0.05:
                target.give(name, serialize_message(seeds.make(name, rng)))
            target.give(name, serialize_message(data.draw(kinds[name])))

        give()
        return target.result()


def _work(terrain_input: str, count: int, seed: int, folder: Path) -> None:
    try:
        attacked = attack_with_examples if seed % EXAMPLES == 0 else attack
        changes = CHANGES[seed // len(INPUTS) % len(CHANGES)]
        result = attacked(terrain_input, count, seed, folder / "last", changes)
    except FindingError as finding:
        result = {"finding": traceback.format_exc()[-3000:], "name": finding.name, "bytes": finding.data.hex()}
    (folder / "result.json").write_text(json.dumps(result))


def shard(terrain_input: str, count: int, seed: int) -> dict[str, Any]:
    """`attack` in a process of its own; a finding or a crash is returned under ``finding``."""
    memory = Path("/dev/shm")  # each message is written down before it is given
    with tempfile.TemporaryDirectory(dir=memory if memory.is_dir() else None) as name:
        folder = Path(name)
        process = multiprocessing.get_context("spawn").Process(target=_work, args=(terrain_input, count, seed, folder))
        process.start()
        process.join()
        file = folder / "result.json"
        if file.exists():
            return dict(json.loads(file.read_text()))
        last = (folder / "last").read_bytes() if (folder / "last").exists() else b""
        input_name, _, data = last.partition(b"\n")
        return {"finding": f"the process ended with {process.exitcode}", "name": input_name.decode(errors="replace"),
                "bytes": data.hex()}  # fmt: skip


def over_the_wire(count: int, seed: int) -> dict[str, int]:
    """Sends ``count`` more to a node process over DDS; raises if it ends or its patches leave the map."""
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    probe = Probe()
    try:
        with probe.running(parameters={"terrain.motion": "hold"}) as process:
            refused = bombard(probe, process, count, np.random.default_rng(seed))
            return {"over DDS": count, "over DDS, refused": refused}
    finally:
        probe.close()


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
    start = monotonic()
    fates: Counter[str] = Counter()
    reasons: Counter[str] = Counter()
    totals: Counter[str] = Counter()
    findings = []
    shares = range(-(-options.messages // options.share))
    with ThreadPoolExecutor(options.jobs) as pool:
        jobs = {
            pool.submit(shard, INPUTS[index % len(INPUTS)], options.share, options.seed + index): index
            for index in shares
        }
        for job in as_completed(jobs):
            index, result = jobs[job], job.result()
            if "finding" in result:
                findings.append(result)
                print(f"{index}: FINDING {result['name']}: {result['finding']}", flush=True)
                (options.out / f"finding_{options.seed + index}.json").write_text(json.dumps(result))
                continue
            fates.update(result["counts"])
            reasons.update(result["reasons"])
            totals.update({name: result[name] for name in ("vertices", "unresolved", "unsettled")})
            print(f"{index}: {sum(result['counts'].values())} messages, {monotonic() - start:.0f} s", flush=True)
    wire = over_the_wire(options.wire, options.seed) if options.wire else {}
    summary = {"messages": fates.total(), "seconds": round(monotonic() - start), "findings": len(findings),
               **totals, **wire, "fates": dict(sorted(fates.items())),
               "refusals": dict(sorted(reasons.items()))}  # fmt: skip
    (options.out / "summary.json").write_text(json.dumps(summary, indent=1))
    print(json.dumps({key: value for key, value in summary.items() if key not in ("fates", "refusals")}))
    sys.exit(1 if findings else 0)


if __name__ == "__main__":
    main()
