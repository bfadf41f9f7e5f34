"""The services that save and restore the whole simulation, and begin episodes."""

from __future__ import annotations

import os
from array import array
from dataclasses import asdict, astuple
from pathlib import Path
from typing import Any

from smartmesh_msgs.srv import RestoreState, SaveState, StartEpisode

from smartmesh_ros.errors import InputError, listed
from smartmesh_ros.node.parameters.helping import flat
from smartmesh_ros.node.parameters.settings import Settings
from smartmesh_ros.node.session import Session
from smartmesh_ros.soil.config import SoilType, soils_from
from smartmesh_ros.terrain import state_file
from smartmesh_ros.world.base import BaseMemory
from smartmesh_ros.world.snapshot import WorldState

# What the name of a file ends with, so that a call cannot overwrite others.
SUFFIX = ".npz"


class StateServices:
    """Serves ``~/save_state``, ``~/restore_state`` and ``~/start_episode``. ``node``: the collider, whose methods
    ``start_episode`` and ``take_restored`` they call, and whose ``initial`` bodies and ``robot`` go on with a state."""

    def __init__(self, session: Session, node: Any) -> None:
        self._session, self._node = session, node
        session.serve(SaveState, "save_state", self._on_save)
        session.serve(RestoreState, "restore_state", self._on_restore)
        session.serve(StartEpisode, "start_episode", lambda request, _: node.start_episode(request.seed))

    def _on_save(self, request: Any, response: Any) -> None:
        file = _file_of(request.file) if request.file else None
        exists = os.path.exists  # unlike that of a `Path`, False for what is no path
        if file is not None and exists(file) and not state_file.is_state(state_file.read(file)):
            raise InputError("state", f"{file} is there, and is no saved state; choose another name")
        initial, robot = self._node.initial, self._node.robot
        bases = {name: [*astuple(base.memory)] for name, base in self._session.bases.items()}
        extra: dict[str, Any] = {
            "frame_id": self._session.frame_id, "waiting": [*initial.waiting], "described": bool(robot.urdf),
            "names": sorted(initial.names), "bases": bases,
        }  # fmt: skip
        data = self._session.world.save(file, extra=extra)
        self._take(**_checked(**extra))
        if file is None:
            response.state = array("B", data)

    def _on_restore(self, request: Any, _: Any) -> None:
        session = self._session
        if bool(request.file) == bool(request.state):
            raise InputError("state", "give the path of a file, or the bytes of a state")
        data = state_file.read(_file_of(request.file)) if request.file else request.state.tobytes()
        state = WorldState.from_bytes(data)
        _require_same_settings(state, session.settings)
        session.require_room([body.name for body in state.snapshot.bodies])
        with state_file.foreign_refused():
            extra = _checked(**state.extra)
        session.world.restore(state)
        self._take(**extra)

    def _take(self, frame_id: str, described: bool, bases: dict[str, BaseMemory], **initial: Any) -> None:
        """Go on from a restored world, and from what was saved with it."""
        self._session.frame_id = frame_id
        for name, base in self._session.bases.items():
            if name in bases:
                base.recall(bases[name])
            else:
                base.start_over()
        self._node.take_restored()
        self._node.initial.take_restored(**initial)
        self._node.robot.take_restored(described=described)


def _checked(
    frame_id: str = "", waiting: Any = (), described: Any = False, bases: Any = (), names: Any = None, **_: Any
) -> dict[str, Any]:
    """Return what was saved with a state, of the types that it must have. Raises errors of Python."""
    memories = {str(name): BaseMemory(*map(float, memory)) for name, memory in dict(bases).items()}
    return {
        "frame_id": str(frame_id), "waiting": [*map(str, waiting)], "described": bool(described), "bases": memories,
        "names": None if names is None else [*map(str, names)],
    }  # fmt: skip


def _file_of(name: str) -> Path:
    if not name.endswith(SUFFIX):
        raise InputError("state", f"{name!r} does not end in {SUFFIX}, as the file of a state must")
    return Path(name)


def _require_same_settings(state: WorldState, settings: Settings) -> None:
    """Raise `InputError` if a state was saved with other parameters, because the run would evolve differently."""
    found = _differences("", state.config, settings.world)
    for mesh in state.terrain.meshes:
        found += _differences("terrain.", mesh.motion, settings.motion)
    soils = [] if state.soil is None else [SoilType(**soil) for soil in state.soil["soils"]]
    if soils and soils != (soils_from(settings.soil) if settings.soil else []):
        found.append("soil.type")
    frame = state.extra.get("frame_id", "")
    if settings.frame_id and frame and settings.frame_id != frame:
        found.append(f"frame_id ({frame!r} there, {settings.frame_id!r} here)")
    if found:
        named = listed([*dict.fromkeys(found)])
        raise InputError("parameter", f"the state was saved with other parameters: {named}; set them as there before")


def _differences(group: str, there: Any, here: Any) -> list[str]:
    ours = dict(flat(asdict(here), group))
    values = ((name, value, ours.get(name)) for name, value in flat(asdict(there), group))
    return [f"{name} ({value!r} there, {own!r} here)" for name, value, own in values if value != own]
