"""Replays within a test's process: without DDS, without waiting, and the same each time."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

from smartmesh_ros.tools.replay.bag import Bag
from smartmesh_ros.tools.replay.replay import Replay
from smartmesh_ros.tools.replay.transport import Names


def replayed(
    source: str | Path | Sequence[tuple[str, float, Any]],
    parameters: Mapping[str, Any] | None = None,
    *,
    keep: Collection[str] = (),
    remap: Mapping[str, str] | None = None,
) -> Replay:
    """Return a replay of a bag, or of a list of (topic, time [s], message) and (service, time [s], request), at its
    beginning.

    ``parameters``: of terrain_collider, by name. ``keep``: outputs whose messages `Replay.received` returns. ``remap``:
    new names of topics and services, as of ``--ros-args -r``.
    """
    recording = Bag(Path(source)) if isinstance(source, (str, Path)) else source
    return Replay(recording, parameters, names=Names(rules=list((remap or {}).items())), keep=keep)
