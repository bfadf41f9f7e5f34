"""The services of simulation_interfaces for worlds: loading, unloading, and what there is."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

from smartmesh_ros.errors import InputError
from smartmesh_ros.node.parameters.settings import MOST_BODIES
from smartmesh_ros.node.services import world_files
from smartmesh_ros.node.services.body_entries import Entry
from smartmesh_ros.node.services.files import robot_of
from smartmesh_ros.node.services.standard import Standard
from smartmesh_ros.node.services.turns import next_turn
from smartmesh_ros.node.services.world_files import WorldFile
from smartmesh_ros.world.paths import expanded

Found = TypeVar("Found")
# Result code of LoadWorld by the reason of an `InputError`.
_LOADING = {
    "no_resource": "NO_RESOURCE",
    "world_format": "UNSUPPORTED_FORMAT",
    "missing": "UNSUPPORTED_FORMAT",  # a library
    "no_asset": "MISSING_ASSETS",
    "asset": "UNSUPPORTED_ASSETS",
    "elements": "UNSUPPORTED_ELEMENTS",
    **dict.fromkeys(
        ("world", "parameter", "file", "type", "length", "geometry", "bands", "unit", "urdf", "urdf_package"),
        "RESOURCE_PARSE_ERROR",
    ),
}
_NO_WORLD = {"no_world": "NO_WORLD_LOADED"}


class WorldServices:
    """Serves LoadWorld, UnloadWorld, GetCurrentWorld and GetAvailableWorlds. ``node``: the collider."""

    def __init__(self, standard: Standard, node: Any) -> None:
        self._standard, self._session, self._node = standard, standard.session, node
        if file := standard.session.settings.file:
            standard.world = world_files.world_of_file(expanded(file).resolve(), standard.session.settings)
        standard.serve("LoadWorld", self._load, _LOADING)
        standard.serve("UnloadWorld", self._unload, _NO_WORLD)
        standard.serve("GetCurrentWorld", self._get_current, _NO_WORLD)
        standard.serve("GetAvailableWorlds", self._get_available, {"sources": "DEFAULT_SOURCES_FAILED"})

    async def _load(self, request: Any, response: Any) -> None:
        """Read all of a world, and then put it in the place of the one that is there."""
        standard = self._standard
        self._require_not_loading()
        standard.loading = True
        try:
            world, notes = await self._loaded(request)
        finally:
            standard.loading = False
        self._describe(world, response.world)
        response.result.error_message = "; ".join(notes)

    async def _loaded(self, request: Any) -> tuple[WorldFile, list[str]]:
        """Load the world of a request; return it, and what is missing in it. Raises `InputError`."""
        session, settings, standard = self._session, self._session.settings, self._standard
        resource = getattr(request, "world_resource", request)
        world = await session.files.done(lambda: world_files.world_of(resource, settings))
        if world.ignored and request.fail_on_unsupported_element:
            raise InputError("elements", f"parameters are no part of a world: {', '.join(world.ignored)}")
        if len(world.bodies) > MOST_BODIES:
            raise InputError("size", f"{len(world.bodies)} bodies; at most {MOST_BODIES} are possible")
        notes: list[str] = []
        left = notes if request.ignore_missing_or_unsupported_assets else None

        raster = await self._asset(
            world, world.terrain, lambda path: world_files.load_raster(path, world.raster, settings), left
        )
        entries: dict[str, Entry] = {}
        for name, entry in world.bodies.items():
            prepared = await self._asset(world, entry.urdf, lambda path: robot_of(str(path), settings), left)
            if prepared is not None or not entry.urdf:
                entries[name] = replace(entry, robot=prepared)
        with session.lock:
            standard.leave_world()
            self._node.set_scene(raster, entries)
            standard.world, standard.unloaded = world, False
        while any(self._node.initial.waiting.values()):
            await next_turn(waits=True)
        why = self._node.initial.refused
        absent = (name for name in entries if name not in session.world.bodies)
        return world, [*notes, *(f"{name!r} is not there: {why.get(name, 'it waits for ground')}" for name in absent)]

    async def _asset(
        self, world: WorldFile, name: str, load: Callable[[Path], Found], left: list[str] | None
    ) -> Found | None:
        """Return a file of a world, None without a ``name``; or None, and add why to ``left``, if it cannot be had.
        Raises `InputError` then if ``left`` is None, or if the file is the whole world."""
        if not name:
            return None
        there = False
        try:
            path = world.folder / expanded(name)
            there = os.path.exists(path)  # noqa: PTH110  # False for what is no path
            return await self._session.files.done(lambda: load(path))
        except InputError as error:
            if world.plain:
                raise
            if left is None:
                found = there and error.reason not in ("no_asset", "urdf_package")
                raise InputError("asset" if found else "no_asset", f"{name[:200]}: {error}") from None
            left.append(f"{name[:200]} is left out: {error}")
            return None

    def _unload(self, _: Any, __: Any) -> None:
        standard = self._standard
        self._require_not_loading()
        if standard.world is None and self._session.world.terrain.empty:
            raise InputError("no_world", "no world is loaded")
        standard.leave_world()
        self._node.set_scene(None, {})

    def _get_current(self, _: Any, response: Any) -> None:
        if self._standard.world is not None:
            self._describe(self._standard.world, response.world)
        elif self._session.world.terrain.empty:
            raise InputError("no_world", "no world is loaded, and no map was published")
        else:
            response.world.name, response.world.description = "topics", "ground: maps of topics"

    async def _get_available(self, request: Any, response: Any) -> None:
        session, settings = self._session, self._session.settings
        if request.filter.tags:
            raise InputError("unsupported", "worlds have no tags here; leave the filter empty")
        sources = list(request.additional_sources)
        worlds, wrong = await session.files.done(lambda: world_files.worlds_in(sources, settings))
        gone = [
            f"there is no folder {folder}" for folder in world_files.folders_of_worlds(settings) if not folder.is_dir()
        ]
        words = "; ".join((*gone, *wrong))
        if words and not (request.continue_on_error and worlds):
            raise InputError("sources" if gone else "not_found", words)
        for world in worlds:
            response.worlds.append(self._standard.messages.WorldResource())
            self._describe(world, response.worlds[-1])
        response.result.error_message = words

    def _require_not_loading(self) -> None:
        if self._standard.loading:
            raise InputError("loading", "a world is loading; call again once it is there")

    def _describe(self, world: WorldFile, message: Any) -> None:
        message.name, message.description = world.name, world.description
        message.world_resource.uri, message.world_resource.resource_string = world.uri, world.text
