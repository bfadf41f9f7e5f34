"""The search that a command line asks for."""

from __future__ import annotations

from argparse import Namespace
from dataclasses import fields
from pathlib import Path

from smartmesh_ros.errors import InputError
from smartmesh_ros.tools.evaluation.scene import FOLDER, read_scene
from smartmesh_ros.tools.tune.bag import Bag
from smartmesh_ros.tools.tune.bag_case import BagCase
from smartmesh_ros.tools.tune.case import Case, SceneCase
from smartmesh_ros.tools.tune.figures import Asked, require_positive
from smartmesh_ros.tools.tune.search import Search, open_study
from smartmesh_ros.tools.tune.start import read_start


def open_search(options: Namespace, index: int = 0) -> Search:
    """Return the search of a command line, as process number ``index``; raise `InputError` for invalid options."""
    for name in ("trials", "jobs", "seconds"):
        require_positive(name, getattr(options, name))
    asked = Asked(**{field.name: getattr(options, field.name) for field in fields(Asked)})
    case = open_case(options)
    seed = None if options.seed is None else options.seed + index
    storage = options.storage or str(options.out / "tune.journal")
    return Search(case, asked, open_study(storage, f"{case.name} {case.identity}", seed))


def open_case(options: Namespace) -> Case:
    """Return the scene or bag; raise `InputError` if neither can be opened."""
    start = read_start(options.params_file, options.preset, options.single)
    path = Path(options.source)
    if not path.exists():
        path = FOLDER / f"{options.source}.yaml"
    if path.suffix == ".yaml" and path.is_file() and path.name != "metadata.yaml":
        return SceneCase(read_scene(path), start)
    if path.exists():
        return BagCase(Bag(path), start, options.terrain, options.seconds)
    scenes = ", ".join(sorted(file.stem for file in FOLDER.glob("*.yaml")))
    raise InputError("source", f"there is no bag and no scene {options.source!r}; the scenes are {scenes}")
