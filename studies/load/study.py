"""``make load``: the node under load, as real processes over DDS."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from smartmesh_ros.startup.dds import isolated_unless_chosen, use_large_message_profile
from smartmesh_ros.terrain.heightmap import HeightMap
from studies.load import tables
from studies.load.cases import Case, groups
from studies.load.driver import run_case
from studies.load.tables import PAGE, PICTURES, summary_of
from studies.pages import digest_of, fill, table
from studies.running import read_results, save_results, short

SIDES = (256, 1024, 4096, 8192, 16384)
# Samples on one side of a region, and how many are taken.
REGION, COUNT, WARM_UP = 64, 1000, 20
SHARES = (10, 50, 90, 99)  # percentiles of the times


def measure_regions(*, quick: bool) -> list[dict[str, Any]]:
    """Times [us] of regions on each map, ``still``: under a body that stays, ``anywhere``: at places all over the map,
    most of them for the first time."""
    sides, count = (SIDES[:2], 200) if quick else (SIDES, COUNT)
    maps = {side: HeightMap(np.zeros((side, side), np.float32), resolution=0.1) for side in sides}
    rng = np.random.default_rng(0)
    found: list[dict[str, Any]] = []
    for way in ("still", "anywhere"):
        times: dict[int, list[float]] = {side: [] for side in sides}
        for turn in range(WARM_UP + count):
            heights = rng.normal(size=(REGION, REGION)).astype(np.float32)
            for side, heightmap in maps.items():
                row, column = (side // 3, side // 3) if way == "still" else rng.integers(0, side - REGION, 2).tolist()
                time = heightmap.time + 0.02
                start = perf_counter()
                heightmap.update_region(row, column, heights, time=time)
                if turn >= WARM_UP:
                    times[side].append(1e6 * (perf_counter() - start))
        for side in sides:
            found.append({"side": side, "way": way, "count": count})
            for share in SHARES:
                found[-1][f"p{share}_us"] = np.percentile(times[side], share)
            print(f"regions {way} on {side}^2: {found[-1]['p50_us']:.1f} us", flush=True)
    return found


def regions_table(found: Sequence[dict[str, Any]]) -> str:
    """The same as a Markdown table."""
    head = ["map", "regions", "place", "median [us]", "10 to 90 % [us]", "99 % [us]"]
    rows = []
    for r in found:
        low, median, high, highest = (f"{r[f'p{share}_us']:.1f}" for share in SHARES)
        rows.append([f"{r['side']}^2", str(r["count"]), r["way"], median, f"{low} to {high}", highest])
    return table(head, rows)


def run(case: Case) -> dict[str, Any]:
    """Runs a case, and prints a line about it."""
    result = run_case(case)
    s = summary_of(result)
    words = f"{100 * s.missed:.2f} % missed, real time {s.real_time_factor:.2f}, lost {s.lost}"
    print(f"{case.name}: {words}", flush=True)
    return result


def report(data: dict[str, Any], out: Path, page: Path | None) -> None:
    """Pictures, and the tables of the page."""
    found = data["groups"]
    summaries = {name: [summary_of(result) for result in found.get(name, [])] for name in groups(quick=True)}
    if summaries["grid"]:
        tables.draw(summaries["grid"], data["machine"], out)
    blocks = {
        "grid": tables.runs(summaries["grid"]),
        "memory": tables.memory(summaries["memory"]),
        "rest": tables.runs(summaries["rest"]),
        "machine": f"Machine: {data['machine']}.",
        "regions": regions_table(data.get("regions", [])),
    }
    if page is not None:
        code = data["code"]
        fill(page, blocks, {name: code.get(name, code.get("grid", "unknown")) for name in blocks})
        print(f"wrote {page}")


def main(args: list[str] | None = None) -> None:
    """Runs the study, and keeps what there is after each case, with the digest of the code of each group."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="a few cases in less than two minutes; writes no page")
    parser.add_argument("--only", choices=[*groups(quick=True), "regions"], help="run one group again, keep the others")
    options = parser.parse_args(args)
    out = Path("out/load") if options.quick else PICTURES
    out.mkdir(parents=True, exist_ok=True)
    file = out / "load.json"
    kept = read_results(file) if options.only else {}
    data: dict[str, Any] = {"groups": {}, "code": {}, **kept, "machine": short()}
    use_large_message_profile()
    with isolated_unless_chosen():
        for group, members in groups(quick=options.quick).items():
            if options.only not in (None, group):
                continue
            data["code"][group], data["groups"][group] = digest_of("node"), []
            for case in members:
                data["groups"][group].append(run(case))
                save_results(file, data)
        if options.only in (None, "regions"):
            data["code"]["regions"], data["regions"] = digest_of("node"), measure_regions(quick=options.quick)
    save_results(file, data)
    report(data, out, None if options.quick else PAGE)
