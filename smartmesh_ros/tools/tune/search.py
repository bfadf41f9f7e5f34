"""The search: an Optuna study, whose trials are measured in turns with the defaults. Processes share its storage."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import optuna
from optuna.storages import JournalStorage
from optuna.storages.journal import JournalFileBackend
from optuna.study import MaxTrialsCallback
from optuna.trial import FrozenTrial, TrialState

from smartmesh_ros.errors import InputError
from smartmesh_ros.ground.state import Vector
from smartmesh_ros.tools.tune import space
from smartmesh_ros.tools.tune.case import Case, reference
from smartmesh_ros.tools.tune.figures import FLOOR, Asked, Figures, Limits, Point
from smartmesh_ros.tools.tune.measuring import measure, run
from smartmesh_ros.tools.tune.start import PRESETS, preset_values, settings_of

# Changes that often help, tried first.
HELPFUL: Sequence[Mapping[str, Any]] = (
    {"physics.solver_residual": 1e-5},
    {"physics.rate": 120.0, "physics.solver_residual": 1e-5},
    {"physics.contact_erp": 0.6},
)
# Names of what is stored with the study and with a trial.
BASE, REFERENCE, VALUES, FIGURES = "defaults", "reference", "values", "figures"


@dataclass(frozen=True, kw_only=True)
class Sampling:
    """``random``: number of random trials before the sampler uses results. ``repeats``: of the first run of the
    defaults. ``unknown`` [m]: penetration that the sampler is told if it could not be measured."""

    random: int = 16
    repeats: int = 3
    unknown: float = 1.0


SAMPLING = Sampling()


def open_study(where: str, name: str, seed: int | None) -> optuna.Study:
    """Return the study of a name in a journal file or a database such as ``sqlite:///tune.db``, a new one if there is
    none; raise `InputError` if the storage does not open."""
    optuna.logging.set_verbosity(optuna.logging.CRITICAL)  # errors still raise
    warnings.filterwarnings("ignore", category=optuna.exceptions.ExperimentalWarning)
    sampler = optuna.samplers.TPESampler(n_startup_trials=SAMPLING.random, seed=seed)
    try:
        if "://" in where:
            storage = optuna.storages.get_storage(where)
        else:
            Path(where).parent.mkdir(parents=True, exist_ok=True)
            storage = JournalStorage(JournalFileBackend(where))
        return optuna.create_study(
            storage=storage, study_name=name, load_if_exists=True, sampler=sampler, directions=["minimize"] * 2
        )
    except Exception as error:  # noqa: BLE001  # those of SQLAlchemy and of its drivers have no common base
        why = getattr(error, "strerror", None) or "it is no journal of a search, or it is damaged"
    raise InputError("storage", f"--storage {where!r} does not open: {why}; name a journal file or sqlite:///FILE")


@dataclass(frozen=True)
class Search:
    """A case, the user's limits, and the study that holds the results of all processes."""

    case: Case
    asked: Asked
    study: optuna.Study

    @property
    def base(self) -> Figures:
        """The defaults' figures, once `prepare` has measured them."""
        return Figures(**self.study.user_attrs[BASE])

    @property
    def reference(self) -> dict[str, Vector] | None:
        """Positions of bodies in the reference run [m]; None = unknown."""
        found: dict[str, Vector] | None = self.study.user_attrs[REFERENCE]
        return found

    @property
    def limits(self) -> Limits:
        """Limits of the search."""
        return Limits.of(self.asked, self.base)

    def points(self) -> list[Point]:
        """Return all measured points."""
        return [_point(trial) for trial in self.study.get_trials(deepcopy=False, states=(TrialState.COMPLETE,))]

    def front(self) -> list[Point]:
        """Return the Pareto front of cost and penetration among points within the other limits, sorted by cost."""
        return sorted(map(_point, self.study.best_trials), key=lambda point: point.figures.cost)

    def prepare(self) -> None:
        """Measure the defaults and queue the first settings to try, unless that is stored already. Raise `InputError`
        if nothing can be measured."""
        if BASE in self.study.user_attrs:
            return
        positions = reference(self.case)
        runners = run(self.case, [self._settings({})], self.case.span.search, SAMPLING.repeats)
        [base] = measure(self.case, runners, positions)
        if math.isinf(base.error):
            raise InputError(
                "bodies", "nothing can be measured here: no body stayed over the ground; the parameter file's "
                "bodies.spawn or robot.description must put bodies over the maps"
            )  # fmt: skip
        for given in (self.case.start, {}, *map(preset_values, PRESETS), *HELPFUL):
            if (parameters := space.parameters_of({**space.defaults(), **given})) is not None:
                self.study.enqueue_trial(parameters, skip_if_exists=True)
        self.study.set_user_attr(REFERENCE, positions)
        self.study.set_user_attr(BASE, asdict(base))

    def run(self, trials: int, say: Callable[[], None] = lambda: None) -> None:
        """Measure trials until all processes together have ``trials`` of them, and ``say`` so after each. Trials from
        before count."""
        if len(self.points()) < trials:
            self.study.optimize(self._measure, callbacks=[MaxTrialsCallback(trials), lambda _, __: say()])

    def _measure(self, trial: optuna.Trial) -> tuple[float, float]:
        """Measure a trial in turns with the defaults. The sampler gets logarithms, so that equal factors count
        equally."""
        values, base = space.draw(trial), self.base
        beside, runner = run(self.case, [self._settings({}), self._settings(values)], self.case.span.search)
        [figures] = measure(self.case, [runner], self.reference)
        # The longest step is a single time and no sum over turns, so it is not scaled to the speed of the machine.
        figures = replace(figures, cost=figures.cost * base.cost / beside.cost)
        trial.set_user_attr(VALUES, values)
        trial.set_user_attr(FIGURES, asdict(figures))
        excess = self.limits.excess(figures)
        others = [value for name, value in excess.items() if name not in ("cost", "penetration")]
        trial.set_constraint("limits", max(others, default=0.0))
        return math.log10(figures.cost), math.log10(max(min(figures.error, SAMPLING.unknown), FLOOR))

    def _settings(self, values: Mapping[str, Any]) -> Any:
        return settings_of({**self.case.start, **space.defaults(), **values})


def _point(trial: FrozenTrial) -> Point:
    return Point(trial.user_attrs[VALUES], Figures(**trial.user_attrs[FIGURES]))
