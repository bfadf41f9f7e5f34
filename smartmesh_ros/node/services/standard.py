"""How a service of simulation_interfaces is served by the installed definitions, 1.x (ROS 2 Jazzy) or 2.x."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from functools import partial
from types import MappingProxyType
from typing import Any

from smartmesh_ros.node.refusals import reason_of, shortened
from smartmesh_ros.node.services.world_files import WorldFile
from smartmesh_ros.node.session import Session

# Result code by the reason of an `InputError`. Codes of a service's own take precedence.
_REASONS = {
    "unknown_body": "RESULT_NOT_FOUND",
    "not_found": "RESULT_NOT_FOUND",
    "unsupported": "RESULT_FEATURE_UNSUPPORTED",
    "loading": "RESULT_INCORRECT_STATE",
}


class Standard:
    """Serves services by their names in the standard, and keeps what the standard knows of worlds.

    ``services``, ``messages``: the modules of simulation_interfaces. ``world``: the one that was loaded last;
    ``unloaded``: True if it was unloaded since; ``loading``: True while one is loaded; ``stopped``: True if the
    simulation was stopped, and not paused since. ``infos``: EntityInfo messages that clients set, by the names of
    entities, until the simulation begins again.
    """

    def __init__(self, session: Session, services: Any, messages: Any) -> None:
        self.session, self.services, self.messages = session, services, messages
        self.world: WorldFile | None = None
        self.unloaded = self.loading = self.stopped = False
        self.infos: dict[str, Any] = {}

    def leave_world(self) -> None:
        """Forget the world, before it is replaced or unloaded; the simulation stops."""
        self.world, self.unloaded, self.stopped = None, True, True
        self.infos.clear()

    def serve(
        self, name: str, act: Callable[[Any, Any], Any], reasons: Mapping[str, str] = MappingProxyType({})
    ) -> None:
        """Serve the service of this ``name``, below the node's as ``spawn_entity`` for SpawnEntity, by ``act``, which
        may return an awaitable, if the installed package has it. ``reasons``: result code by reason of an `InputError`
        of ``act``."""
        if (kind := getattr(self.services, name, None)) is None:
            return
        service = re.sub(r"(?<!^)(?=[A-Z])", "_", name).lower()
        self.session.serve(kind, service, act, partial(self.conclude, reasons))

    def conclude(self, reasons: Mapping[str, str], response: Any, error: Exception | None) -> None:
        """Write the outcome into a response: the code of the error's reason among its own, or else a general one."""
        if error is not None:
            code, general = reasons.get(reason_of(error)), _REASONS.get(reason_of(error), "RESULT_OPERATION_FAILED")
            response.result.result = getattr(response, code) if code else getattr(self.messages.Result, general)
            response.result.error_message = shortened(str(error))
        elif hasattr(response, "result"):
            response.result.result = self.messages.Result.RESULT_OK


def tagged(tags: list[str], wanted: Any) -> bool:
    """Return True if there are no tags in a TagsFilter message, or if ``tags`` have any or all of them, as it says."""
    hits = [tag in tags for tag in wanted.tags]
    return not hits or (all(hits) if wanted.filter_mode == wanted.FILTER_MODE_ALL else any(hits))
