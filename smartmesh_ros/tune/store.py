"""What was found so far, in a storage that processes and machines share."""

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
from smartmesh_ros.physics.state import Vector
from smartmesh_ros.tune import space
from smartmesh_ros.tune.figures import FLOOR, Figures, Limits
from smartmesh_ros.tune.front import Point

FIGURES, BASE, REFERENCE = "figures", "defaults", "reference"
# What the sampler is told of a setting whose penetration could not be measured [m].
UNKNOWN_ERROR = 1.0
# By how many times a limit may be passed as far as the sampler knows.
MAX_EXCESS = 100.0
# Trials that are drawn at random before the sampler draws conclusions.
RANDOM_TRIALS = 16


class Storage(NamedTuple):
    """An open storage, and where it is."""

    where: str
    storage: BaseStorage


def open_storage(where: str) -> Storage:
    """A database's address such as ``sqlite:///tune.db``, or the path of a journal file; raises `InputError`."""
    try:
        if "://" in where:
            return Storage(where, optuna.storages.get_storage(where))
        Path(where).parent.mkdir(parents=True, exist_ok=True)
        return Storage(where, JournalStorage(JournalFileBackend(where)))
    except Exception as error:  # noqa: BLE001  # those of SQLAlchemy and of its drivers have no common base
        raise _refusal(where, error) from None


def _refusal(where: str, error: Exception) -> InputError:
    """An error that says why a storage does not open, without the libraries' own words."""
    if isinstance(error, OSError):
        why = error.strerror or "the file cannot be read"
    elif isinstance(error, ImportError):
        why = "the Python package for such databases is not installed"
    elif "://" in where:
        why = "there is no such database, or it is of no kind that is known"
    else:
        why = "it is no journal of a search, or it is damaged"
    return InputError("storage", f"--storage {where!r} does not open: {why}; name a journal file or sqlite:///FILE")


class Store:
    """One study: what was found of one case, whoever found it."""

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
        """The defaults' figures, once they are known."""
        found = self.study.user_attrs.get(BASE)
        return None if found is None else Figures.from_json(found)

    @property
    def reference(self) -> dict[str, Vector] | None:
        """Where bodies go in the reference run [m], if it is known."""
        found: Mapping[str, Sequence[float]] = self.study.user_attrs.get(REFERENCE) or {}
        return {name: (x, y, z) for name, (x, y, z) in found.items()} or None

    def begin(self, base: Figures, reference: Mapping[str, Vector] | None) -> None:
        """Notes what everything is compared with."""
        self.study.set_user_attr(REFERENCE, {name: list(place) for name, place in (reference or {}).items()})
        self.study.set_user_attr(BASE, base.as_json())

    def points(self) -> list[Point]:
        """Everything that was found."""
        return [
            Point(space.values_of(trial.params), Figures.from_json(trial.user_attrs[FIGURES]))
            for trial in self.finished()
        ]

    def finished(self) -> list[FrozenTrial]:
        """The trials that were measured."""
        return self.study.get_trials(deepcopy=False, states=(TrialState.COMPLETE,))

    def ask_for(self, values: Mapping[str, Any]) -> tuple[optuna.Trial, dict[str, Any]]:
        """Certain settings to try. Not for processes that search at the same time: one could get those of another."""
        self.study.enqueue_trial(space.parameters_of(values))
        return self.ask(1)[0]

    def ask(self, count: int) -> list[tuple[optuna.Trial, dict[str, Any]]]:
        """Settings to try."""
        trials = [self.study.ask() for _ in range(count)]
        return [(trial, space.ask(trial)) for trial in trials]

    def tell(self, trial: optuna.Trial, figures: Figures, limits: Limits) -> None:
        """Notes what was measured of a trial. Both axes are logarithmic: a factor counts the same everywhere."""
        trial.set_user_attr(FIGURES, figures.as_json())
        beside = {name: value for name, value in limits.excess(figures).items() if name not in ("cost", "penetration")}
        trial.set_constraint("limits", min(max(beside.values(), default=0.0), MAX_EXCESS))
        error = min(figures.error, UNKNOWN_ERROR)
        self.study.tell(trial, [math.log10(figures.cost), math.log10(max(error, FLOOR))])

    def give_up(self, trial: optuna.Trial) -> None:
        """Notes that a trial was not measured."""
        self.study.tell(trial, state=TrialState.FAIL)
