"""Targets of the package, and their comparison with a run of the bench."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from studies.bench import collecting, crowds, report, searching
from studies.bench.measure import Results


class Target(NamedTuple):
    """A figure to stay below (or to exceed, where ``at_least``); ``reported``: the report's, as it gives it."""

    text: str
    unit: str
    limit: float
    reported: str
    value: Callable[[Results], float]
    at_least: bool = False

    def reached(self, results: Results) -> bool:
        """Return True if the figure was measured and reached."""
        value = self.value(results)
        return value >= self.limit if self.at_least else value <= self.limit


def search_per_body(results: Results, side: int, count: int = crowds.BATCH) -> float:
    """Grid traversal in a batch, per body [us]."""
    return results.us("search_batch", "grid_traversal", side=side, bodies=count) / searching.REPEATS / count


def collect_per_body(results: Results, count: int = crowds.BATCH) -> float:
    """Collecting from the grid's template in a batch, per body [us]."""
    rings = collecting.RINGS_OF_BATCHES
    batch = results.us("collect_batch", "cached", side=collecting.SIDE, bodies=count, rings=rings)
    return batch / collecting.REPEATS / count


def update_per_body(results: Results, rings: int, count: int = crowds.BATCH) -> float:
    """Update of a heightfield patch in a batch, all in, per body [us]."""
    return results.us("update", "heightfield", side=crowds.SIDE, bodies=count, rings=rings) / count


def _search_of_all(results: Results) -> list[float]:
    return [search_per_body(results, side) for side in searching.EQUAL_SIDES]


def _update(rings: int) -> Callable[[Results], float]:
    return lambda results: update_per_body(results, rings)


def _step(count: int, rate: int) -> Callable[[Results], float]:
    return lambda results: results.ms("step", f"{rate} Hz", side=crowds.SIDE, bodies=count)


def _general(method: str) -> Callable[[Results], float]:
    return lambda results: results.us("search", method, side=200)


def _gain(results: Results) -> float:
    """How many times faster the patch of one body in a batch is than a trimesh of 200 x 200 vertices."""
    return results.us("simple", "bullet_trimesh", side=200) / update_per_body(results, 1)


def _ingest(method: str) -> Callable[[Results], float]:
    return lambda results: results.ms("ingest", method, side=crowds.SIDE)


def _size(rings: int) -> str:
    return f"{2 * rings + 1}x{2 * rings + 1}"


_LIMITS = (10.0, 13.0, 17.0, 22.0)

TARGETS = (
    Target(
        "search, per body of 100, slowest of 50^2 to 4096^2 samples", "us", 0.2, "10-15",
        lambda results: max(_search_of_all(results)),
    ),
    Target(
        "the same, slowest size over fastest", "x", 1.2, "",
        lambda results: max(_search_of_all(results)) / min(_search_of_all(results)),
    ),
    Target("collect, per body of 100", "us", 0.2, "2", collect_per_body),
    *(
        Target(
            f"collider update {_size(rings)}, per body of 100", "us", limit,
            f"{report.LOCAL_CONSTANT[rings] * 1e3:.0f}", _update(rings),
        )
        for rings, limit in zip(report.RINGS, _LIMITS, strict=True)
    ),
    Target(
        "Simple-Mesh 200x200 (trimesh built anew) over the patch of one body of 100", "x", 10_000.0,
        "2863 (PhysX), 582 (Bullet)", _gain, at_least=True,
    ),
    Target("100 bodies on moving 1024^2 terrain, update + step at 240 Hz", "ms", 2.0, "", _step(100, 240)),
    Target("1000 bodies, the same at 60 Hz", "ms", 14.0, "", _step(1000, 60)),
    Target("taking in a map of 1024^2", "ms", 2.0, "", _ingest("map")),
    Target("taking in a region of 64^2", "ms", 0.2, "", _ingest("region")),
    Target("general mesh of 40,000 vertices, one body: brute force", "us", 60.0, "6673", _general("brute_force")),
    Target("the same, best-first from the vertex before", "us", 5.0, "12", _general("best_first")),
)  # fmt: skip
