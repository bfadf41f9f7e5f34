"""Worlds of simulation_interfaces: terrain files, and parameter files of the node with the ground and the bodies of a
scene.

Of a parameter file, ``terrain.file``, ``raster.*`` and ``bodies.spawn`` make the world, as they do at the start of the
node; relative paths begin at the file. Other parameters are no part of a world.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from smartmesh_ros.errors import InputError
from smartmesh_ros.io import files
from smartmesh_ros.io.rasters import Raster, RasterConfig
from smartmesh_ros.io.urdf import require_inside
from smartmesh_ros.node.inputs.cdr_reader import MOST_SAMPLES
from smartmesh_ros.node.parameters.helping import PARAMETERS, parameters_by_node
from smartmesh_ros.node.parameters.settings import Settings
from smartmesh_ros.node.parameters.specifications import NAMES, with_values
from smartmesh_ros.node.services.body_entries import Entry, entries_from
from smartmesh_ros.node.services.files import allowed_folders, files_in
from smartmesh_ros.world.paths import expanded
from smartmesh_ros.yaml_text import parsed_yaml

WORLDS = (*files.KINDS, ".yaml", ".yml")
# The parameters that make a world.
ELEMENTS = {name for name in NAMES if name in ("terrain.file", "bodies.spawn") or name.startswith("raster.")}


@dataclass(frozen=True, kw_only=True)
class WorldFile:
    """A world that can be loaded: its ``uri`` or else its ``text``. ``terrain``: file of the ground, "" = no ground;
    ``raster``: how that file is read; relative paths begin in ``folder``. ``ignored``: parameters that are no part of
    a world."""

    name: str
    uri: str = ""
    text: str = ""
    folder: Path = Path()
    terrain: str = ""
    raster: RasterConfig
    bodies: Mapping[str, Entry] = field(default_factory=dict)
    ignored: tuple[str, ...] = ()

    @property
    def plain(self) -> bool:
        """True if the world is a terrain file alone."""
        return self.uri.lower().endswith(files.KINDS)

    @property
    def description(self) -> str:
        """What the world is made of."""
        return f"ground: {Path(self.terrain).name or 'none'}; bodies: {', '.join(self.bodies) or 'none'}"


def folders_of_worlds(settings: Settings) -> tuple[Path, ...]:
    """Return the folders that the parameters name: those of ``bodies.urdf_folders``, and that of ``terrain.file``."""
    named = map(expanded, settings.urdf_folders)
    return *named, *([expanded(settings.file).resolve().parent] if settings.file else [])


def world_of(resource: Any, settings: Settings) -> WorldFile:
    """Return the world of a resource, by its ``uri`` or else its ``resource_string``. Raises `InputError`."""
    if resource.uri:
        path = expanded(resource.uri)
        if path.suffix.lower() not in WORLDS:
            raise InputError("world_format", f"{path} is no world; the files of worlds end in {', '.join(WORLDS)}")
        return world_of_file(_allowed(path, settings), settings)
    if not resource.resource_string:
        raise InputError("no_resource", "both uri and resource_string are empty; give a file, or a text of parameters")
    return _world_of_text(resource.resource_string, settings, name="world")


def world_of_file(path: Path, settings: Settings) -> WorldFile:
    """Return the world of a terrain file or a parameter file. Raises `InputError`."""
    if path.suffix.lower() in files.KINDS:
        return WorldFile(name=path.stem, uri=path.as_uri(), terrain=str(path), raster=settings.raster)
    try:
        text = path.read_text(encoding="utf-8")
    except ValueError as error:
        raise InputError("world", f"{path} cannot be read: {error}") from None
    found = _world_of_text(text, settings, name=path.stem, folder=path.parent)
    return replace(found, uri=path.as_uri(), text="")


def worlds_in(sources: list[str], settings: Settings) -> tuple[list[WorldFile], list[str]]:
    """Return the worlds in the folders of the parameters and of ``sources``, and what is wrong with ``sources``."""
    found, wrong = files_in(folders_of_worlds(settings), sources, WORLDS, settings)
    worlds = []
    for path in found:
        with suppress(InputError):  # other YAML
            worlds.append(world_of_file(path, settings))
    return worlds, wrong


def _world_of_text(text: str, settings: Settings, *, name: str, folder: Path = Path()) -> WorldFile:
    """Return the world of a parameter file in a ``folder``. Raises `InputError`."""
    try:
        found = [values for _, values in parameters_by_node(parsed_yaml(text, aliases=False))]
        given = {name: value for values in found for name, value in values.items()}
    except (ValueError, TypeError, RecursionError) as error:
        raise InputError("world", f"world {name!r} cannot be read: {error}") from None
    known = {key: given[key] for key in ELEMENTS & given.keys()}
    made = with_values(replace(settings, file="", spawn=()), known)
    if not made.file and not made.spawn:
        words = f"it must be a parameter file (/**: {PARAMETERS}: ...) with terrain.file or bodies.spawn"
        raise InputError("world", f"world {name!r} has neither ground nor bodies; {words}")
    return WorldFile(
        name=name, text=text, folder=folder, terrain=made.file, raster=made.raster,
        bodies=entries_from(made.spawn), ignored=tuple(sorted(given.keys() - ELEMENTS)),
    )  # fmt: skip


def load_raster(path: Path, config: RasterConfig, settings: Settings) -> Raster:
    """Return the ground of a world in a file. Raises `InputError`."""
    return files.load(_allowed(path, settings), config, MOST_SAMPLES)


def _allowed(path: Path, settings: Settings) -> Path:
    folders = dict.fromkeys((*allowed_folders(settings), *folders_of_worlds(settings)))
    return require_inside(path, [*folders], f"{str(path)[:200]!r}")
