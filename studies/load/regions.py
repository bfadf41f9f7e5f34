"""Cost of a region on maps of different size, within one process, with the maps in turns."""

from __future__ import annotations

from collections.abc import Sequence
from time import perf_counter
from typing import Any

import numpy as np

from smartmesh_ros.terrain.heightmap import HeightMap
from studies import markdown

SIDES = (256, 1024, 4096, 8192, 16384)
# Samples on one side of a region, and how many are taken.
REGION, COUNT, WARM_UP = 64, 1000, 20


def measure(*, quick: bool) -> list[dict[str, Any]]:
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
            low, median, high, highest = np.percentile(times[side], [10, 50, 90, 99])
            found.append({"side": side, "way": way, "count": count, "p10_us": low, "p50_us": median, "p90_us": high,
                          "p99_us": highest})  # fmt: skip
            print(f"regions {way} on {side}^2: {median:.1f} us ({low:.1f} to {high:.1f})", flush=True)
    return found


def table(found: Sequence[dict[str, Any]]) -> str:
    """The same as a Markdown table."""
    head = ["map", "regions", "place", "median [us]", "10 to 90 % [us]", "99 % [us]"]
    rows = []
    for r in found:
        low, median, high, highest = (f"{r[f'p{share}_us']:.1f}" for share in (10, 50, 90, 99))
        rows.append([f"{r['side']}^2", str(r["count"]), r["way"], median, f"{low} to {high}", highest])
    return markdown.table(head, rows)
