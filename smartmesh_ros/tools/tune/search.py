"""The search: the sampler draws settings, which are measured in turns with the defaults and stored."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

import optuna

from smartmesh_ros.errors import InputError
from smartmesh_ros.ground.state import Vector
from smartmesh_ros.tools.evaluation.presets import NAMES as PRESETS
from smartmesh_ros.tools.tune import space
from smartmesh_ros.tools.tune.case import Case
from smartmesh_ros.tools.tune.figures import Asked, Figures, Limits
from smartmesh_ros.tools.tune.measuring import require_measurable, run
from smartmesh_ros.tools.tune.start import preset_file, read_parameters, settings_of
from smartmesh_ros.tools.tune.store import Store

Say = Callable[[str], None]
# Trials and their values.
Drawn = list[tuple[optuna.Trial, dict[str, Any]]]


@dataclass(frozen=True, kw_only=True)
class Search:
    """``trials``: total number, over all processes. ``batch``: number of trials that run in turns with the defaults.
    ``repeats``: of the first run of the defaults."""

    trials: int = 96
    batch: int = 3
    repeats: int = 3


def prepare(store: Store, case: Case, asked: Asked, plan: Search, say: Say) -> Figures:
    """Return the defaults' figures. If the store lacks them, measure the defaults and the first settings to try.
    Raise `InputError` if nothing can be measured."""
    if store.base is not None:
        return store.base
    say("the reference, at an eighth of the step")
    reference = case.reference()
    say("the defaults")
    defaults = settings_of({**case.start, **space.defaults()})
    [base] = run(case, [defaults], case.span.search, reference, repeats=plan.repeats, say=say)
    require_measurable(base)
    _try(store, case, base, reference, asked, [store.ask_for(values) for values in _first(case.start)], say)
    store.begin(base, reference)
    return base


def work(store: Store, case: Case, asked: Asked, plan: Search, say: Say) -> None:
    """Measure trials until the store has enough. Trials from before an interruption count."""
    base = store.base
    if base is None:
        raise InputError("storage", "the storage has no defaults for this case; start the search anew")
    reference = store.reference
    while (left := plan.trials - len(store.finished())) > 0:
        _try(store, case, base, reference, asked, store.ask(min(plan.batch, left)), say)


def _try(
    store: Store,
    case: Case,
    base: Figures,
    reference: Mapping[str, Vector] | None,
    asked: Asked,
    drawn: Drawn,
    say: Say,
) -> None:
    """Measure drawn settings in turns with the defaults, and store their figures."""
    limits = Limits.of(asked, base)
    with _failed_unless_recorded(store, [trial for trial, _ in drawn]) as recorded:
        settings = [settings_of({**case.start, **values}) for values in [space.defaults(), *(new for _, new in drawn)]]
        beside, *found = run(case, settings, case.span.search, reference, say=say)
        for (trial, _), figures in zip(drawn, found, strict=True):
            store.tell(trial, normalised(base, beside, figures), limits)
            recorded.append(trial.number)


def normalised(base: Figures, beside: Figures, figures: Figures) -> Figures:
    """Return the figures with the cost scaled to the machine's speed at the time of ``base``.

    ``beside``: figures of the same setting as ``base``, measured in turns with ``figures``. The longest step is not
    scaled, because it is a single time and no sum over turns.
    """
    return replace(figures, cost=figures.cost * base.cost / beside.cost)


@contextmanager
def _failed_unless_recorded(store: Store, trials: list[optuna.Trial]) -> Iterator[list[int]]:
    """Mark trials as failed that an interruption leaves unmeasured. The block adds measured trials to the yielded
    list."""
    recorded: list[int] = []
    try:
        yield recorded
    finally:
        for trial in trials:
            if trial.number not in recorded:
                store.give_up(trial)


def _first(start: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return settings to try first: the user's, those of the presets, and changes of the defaults that often help."""
    presets = [read_parameters(preset_file(name)) for name in PRESETS]
    steps: list[Mapping[str, Any]] = [
        start,
        {},
        *presets,
        {"physics.solver_residual": 1e-5},
        {"physics.rate": 120.0, "physics.solver_residual": 1e-5},
        {"physics.contact_erp": 0.6},
    ]
    found: list[dict[str, Any]] = []
    for step in steps:
        values = {name: step.get(name, value) for name, value in space.defaults().items()}
        if values["patch.kind"] in space.SPACE.kind and values not in found:
            found.append(values)
    return found
