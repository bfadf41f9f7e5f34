"""What a search says of itself: a line while it runs, and five at its end."""

from __future__ import annotations

from collections.abc import Sequence

from smartmesh_ros.tune.case import Case
from smartmesh_ros.tune.confirm import Verdict
from smartmesh_ros.tune.figures import Asked, Figures, Limits
from smartmesh_ros.tune.front import Point, ranked

# How the limits are called.
NAMES = {
    "cost": "cost", "penetration": "penetration", "longest": "the longest step", "hover": "hover",
    "deviation": "deviation", "failed": "bodies lost or rescued",
}  # fmt: skip


def progress(done: int, trials: int, left: float, points: Sequence[Point], asked: Asked, base: Figures) -> str:
    """How far a search is; ``left`` [s]."""
    best = ranked(points, asked, Limits.of(asked, base))
    found = f"best so far {costs(best[0].figures)}" if best else "nothing yet keeps what is asked"
    minutes, seconds = divmod(round(left), 60)
    return f"{done}/{trials} tried, {minutes}:{seconds:02d} left; {found}; defaults {costs(base)}"


def costs(figures: Figures) -> str:
    """Cost and penetration in words."""
    return f"{figures.cost:.3f} of a core, {1e3 * figures.penetration:.3g} mm"


def five_lines(case: Case, asked: Asked, verdict: Verdict, tried: int, file: str) -> list[str]:
    """What was found."""
    chosen, defaults = verdict.chosen.figures, verdict.defaults
    changed = [f"{name} {value}" for name, value in _changes(verdict).items()]
    first = f"{case.title}: {tried} settings tried, the best confirmed over {chosen.ran:g} s of simulated time."
    if not verdict.keeps:
        passed = ", ".join(
            f"{NAMES[name]} {1.0 + by:.2g} times what is allowed" for name, by in verdict.limits.excess(chosen).items()
        )
        able = [name for name, figures in verdict.others.items() if not verdict.limits.excess(figures)]
        instead = f" It is kept by {' and '.join(able)}, which change more than is searched." if able else ""
        second = f"Not possible here: {asked.words}. The nearest that was found has {passed}.{instead}"
    elif verdict.on_front:
        second = f"Asked: {asked.words}. The defaults are on the front: nothing that was found beats them."
    else:
        second = f"Asked: {asked.words}. Kept."
    return [
        first,
        second,
        f"Chosen: {costs(chosen)} of penetration, longest step {1e3 * chosen.longest:.3g} ms, hover "
        f"{1e3 * chosen.hover:.3g} mm, {chosen.lost} of {chosen.bodies} bodies lost.",
        f"Defaults: {costs(defaults)} of penetration; so it costs {chosen.cost / defaults.cost:.2f} times as much, at "
        f"{chosen.error / defaults.error:.2f} times the penetration.",
        f"Changed: {', '.join(changed) or 'nothing'}. Written to {file}.",
    ]


def _changes(verdict: Verdict) -> dict[str, object]:
    from smartmesh_ros.tune.space import defaults

    known = defaults()
    return {name: value for name, value in verdict.chosen.values.items() if known[name] != value}
