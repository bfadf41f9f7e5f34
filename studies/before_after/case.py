"""The cases of the comparison, each a row of the table."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Literal

from smartmesh_ros.physics.shapes import Box, Shape, Sphere

PHYSICS_RATE = 240.0  # [Hz]
SHAPES: dict[str, type[Shape]] = {"sphere": Sphere, "box": Box}


@dataclass(frozen=True, kw_only=True)
class Case:
    """Bodies on a map, run again and again from the same start.

    ``ground``: argument of `make_ground`. ``samples`` on a side and ``resolution`` [m] of the map, around the origin.
    ``map_rate`` [Hz]: 0 = one map only; ground at rest repeats the same map. ``early`` [s]: arrival of maps before
    their stamps, as at a node that runs behind its source. ``kind``: of patches, which are refreshed at 60 Hz.
    ``driver``: *ground* = `Ground` in a plain PyBullet world, *world* = `World`. ``settle`` [s]: beginning of
    ``seconds`` [s] that is neither timed nor measured. ``to_reach``: target of the update's speed-up, None = none.
    ``deepest`` [m]: target of the penetration, 99 %. ``calls``: True = PyBullet's own calls are timed too. ``quick``:
    part of the quick run.
    """

    name: str
    title: str
    ground: dict[str, Any]
    count: int
    samples: int = 81
    resolution: float = 0.25
    shape: str = "sphere"
    size: tuple[float, ...] = (0.2,)
    map_rate: float = 60.0
    early: float = 0.0
    kind: str = "auto"
    driver: Literal["ground", "world"] = "ground"
    seconds: float = 2.0
    settle: float = 0.5
    seed: int = 1
    to_reach: float | None = None
    deepest: float | None = None
    calls: bool = False
    quick: bool = False

    def make_shape(self) -> Shape:
        """The shape of each body."""
        return SHAPES[self.shape](*self.size)


def _waves(amplitude: float = 0.25, number: float = 1.5, frequency: float = 4.0) -> dict[str, Any]:
    return {"kind": "waves", "amplitude": amplitude, "number": number, "frequency": frequency}


# Samples of the model 0.25 m apart: 1 : 40 of the scene `elevation_10m`.
_MODEL = {"kind": "elevation", "spacing": 0.25, "relief": 7.5}
_NOISE = {"kind": "noise", "deviation": 0.02, "seed": 3}


def _both_kinds(case: Case) -> list[Case]:
    """Return the case with *auto*, and with heightfields for comparison, without targets."""
    plain = replace(
        case, name=f"{case.name}_heightfield", title=f"{case.title}, heightfield", kind="heightfield",
        to_reach=None, calls=False,
    )  # fmt: skip
    return [case, plain]


def _moving() -> list[Case]:
    found = []
    # One body costs little: longer pieces, so that they are not too short to time.
    for count, speed_up, seconds in ((1, 10.0, 4.5), (10, 4.0, 3.0), (48, 2.2, 2.0), (100, 1.5, 2.0)):
        found += _both_kinds(
            Case(
                name=f"waves_{count}", title=f"waves w = 4, {count} ball{'s' if count > 1 else ''}", ground=_waves(),
                count=count, seconds=seconds, to_reach=speed_up, calls=count == 100, quick=count in (1, 100),
            )
        )  # fmt: skip
    return found


def _at_rest() -> list[Case]:
    found = []
    for name, title, ground, samples, resolution in (
        ("model", "elevation model", _MODEL, 81, 0.25),
        ("noise", "noise of 2 cm at 0.1 m", _NOISE, 121, 0.1),
    ):
        for rate, words, speed_up in ((0.0, "no maps coming", 3.0), (60.0, "the same map at 60 Hz", 4.0)):
            found += _both_kinds(
                Case(
                    name=f"{name}_{rate:.0f}", title=f"{title} at rest, 48 balls, {words}", ground=ground, count=48,
                    samples=samples, resolution=resolution, map_rate=rate, to_reach=speed_up,
                    quick=name == "model" and rate > 0.0,
                )
            )  # fmt: skip
    return found


BOXES = Case(
    name="boxes", title="waves w = 4 at 0.1 m, 16 boxes", ground=_waves(), count=16, samples=121, resolution=0.1,
    shape="box", size=(0.5, 0.4, 0.3), to_reach=2.0, quick=True,
)  # fmt: skip
SLOW_MAPS = Case(
    name="maps_20", title="waves w = 4, 48 balls, maps at 20 Hz", ground=_waves(), count=48, map_rate=20.0,
    deepest=0.002, seconds=3.0,
)  # fmt: skip
STEEP = Case(
    name="steep_45", title="waves A 0.4 k 2 w 6, 48 balls, maps at 45 Hz (World)", ground=_waves(0.4, 2.0, 6.0),
    count=48, map_rate=45.0, driver="world", deepest=0.003, seconds=3.0,
)  # fmt: skip
ASLEEP = Case(
    name="rest_100", title="elevation model at rest, 100 boxes for some seconds (World)", ground=_MODEL, count=100,
    shape="box", size=(0.3, 0.25, 0.2), map_rate=0.0, driver="world", seconds=4.0, settle=3.0, to_reach=30.0,
    quick=True,
)  # fmt: skip
CASES = (
    *_moving(),
    *_at_rest(),
    *_both_kinds(BOXES),
    SLOW_MAPS,
    replace(SLOW_MAPS, name="maps_20_world", title=f"{SLOW_MAPS.title} (World)", driver="world"),
    ASLEEP,
    replace(ASLEEP, name="rest_100_maps", title="the same, the same map at 60 Hz", map_rate=60.0, quick=False),
    replace(ASLEEP, name="rest_1000", title="the same, 1000 boxes, no maps", count=1000, samples=201, quick=False),
    STEEP,
    replace(
        STEEP,
        name="steep_45_early",
        title="waves A 0.4 k 2 w 6, 48 balls, maps at 45 Hz, 2 ms early (World)",
        early=0.002,
    ),
)


def cases(*, quick: bool) -> list[Case]:
    """All cases, or those of the quick run."""
    return [case for case in CASES if (case.quick and case.kind == "auto") or not quick]
