"""Results of a search, in a storage that processes and machines can share."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import optuna
from optuna.samplers import TPESampler
from optuna.storages import BaseStorage, JournalStorage
from optuna.storages.journal import JournalFileBackend
from optuna.trial import FrozenTrial, TrialState

from smartmesh_ros.errors import InputError
from smartmesh_ros.ground.state import Vector
from smartmesh_ros.tools.tune import space
from smartmesh_ros.tools.tune.figures import FLOOR, Figures, Limits
from smartmesh_ros.tools.tune.front import Point

FIGURES, BASE, REFERENCE = "figures", "defaults", "reference"
# Penetration that is passed to the sampler if it could not be measured [m].
UNKNOWN_ERROR = 1.0
# Maximum relative excess over a limit that is passed to the sampler.
MAX_EXCESS = 100.0
# Number of random trials before the sampler uses results.
RANDOM_TRIALS = 16


class Storage(NamedTuple):
    """An open storage and its address or path."""

    where: str
    storage: BaseStorage


def open_storage(where: str) -> Storage:
    """Open a database's address such as ``sqlite:///tune.db``, or a journal file; raise `InputError` if that fails."""
    try:
        if "://" in where:
            return Storage(where, optuna.storages.get_storage(where))
        Path(where).parent.mkdir(parents=True, exist_ok=True)
        return Storage(where, JournalStorage(JournalFileBackend(where)))
    except Exception as error:  # noqa: BLE001  # those of SQLAlchemy and of its drivers have no common base
        raise _refusal(where, error) from None


def _refusal(where: str, error: Exception) -> InputError:
    """Return an error with the reason why a storage does not open, in this package's words."""
    if isinstance(error, OSError):
        why = error.strerror or "the file cannot be read"
    elif isinstance(error, ImportError):
        why = "the Python package for such databases is not installed"
    elif "://" in where:
        why = "the database does not exist, or its kind is unknown"
    else:
        why = "it is no journal of a search, or it is damaged"
    return InputError("storage", f"--storage {where!r} does not open: {why}; name a journal file or sqlite:///FILE")


class Store:
    """An Optuna study: the results of one case from all processes."""

    def __init__(self, storage: Storage, name: str, seed: int | None = None) -> None:
        try:
            self.study = optuna.create_study(
                storage=storage.storage,
                study_name=name,
                load_if_exists=True,
                sampler=TPESampler(n_startup_trials=RANDOM_TRIALS, seed=seed),
                directions=["minimize", "minimize"],
            )
        except Exception as error:  # noqa: BLE001  # as above: a file is read only here
            raise _refusal(storage.where, error) from None

    @property
    def base(self) -> Figures | None:
        """The defaults' figures; None before they are measured."""
        found = self.study.user_attrs.get(BASE)
        return None if found is None else Figures.from_json(found)

    @property
    def reference(self) -> dict[str, Vector] | None:
        """Positions of bodies in the reference run [m]; None = unknown."""
        found: Mapping[str, Sequence[float]] = self.study.user_attrs.get(REFERENCE) or {}
        return {name: (x, y, z) for name, (x, y, z) in found.items()} or None

    def begin(self, base: Figures, reference: Mapping[str, Vector] | None) -> None:
        """Store the defaults' figures and the reference."""
        self.study.set_user_attr(REFERENCE, {name: list(place) for name, place in (reference or {}).items()})
        self.study.set_user_attr(BASE, base.as_json())

    def points(self) -> list[Point]:
        """Return all measured points."""
        return [
            Point(space.values_of(trial.params), Figures.from_json(trial.user_attrs[FIGURES]))
            for trial in self.finished()
        ]

    def finished(self) -> list[FrozenTrial]:
        """Return the measured trials."""
        return self.study.get_trials(deepcopy=False, states=(TrialState.COMPLETE,))

    def ask_for(self, values: Mapping[str, Any]) -> tuple[optuna.Trial, dict[str, Any]]:
        """Return a trial with given settings. Not for concurrent processes, because one could get another's
        settings."""
        self.study.enqueue_trial(space.parameters_of(values))
        return self.ask(1)[0]

    def ask(self, count: int) -> list[tuple[optuna.Trial, dict[str, Any]]]:
        """Return trials with settings from the sampler."""
        trials = [self.study.ask() for _ in range(count)]
        return [(trial, space.ask(trial)) for trial in trials]

    def tell(self, trial: optuna.Trial, figures: Figures, limits: Limits) -> None:
        """Store a trial's figures. The sampler gets logarithms, so that equal factors count equally."""
        trial.set_user_attr(FIGURES, figures.as_json())
        beside = {name: value for name, value in limits.excess(figures).items() if name not in ("cost", "penetration")}
        trial.set_constraint("limits", min(max(beside.values(), default=0.0), MAX_EXCESS))
        error = min(figures.error, UNKNOWN_ERROR)
        self.study.tell(trial, [math.log10(figures.cost), math.log10(max(error, FLOOR))])

    def give_up(self, trial: optuna.Trial) -> None:
        """Mark a trial as failed."""
        self.study.tell(trial, state=TrialState.FAIL)
