"""The timing of all nodes as one message."""

from __future__ import annotations

from collections.abc import Mapping

from smartmesh_msgs.msg import StageTiming, Timing


def merge(timings: Mapping[str, Timing]) -> Timing:
    """Return one message for timings by node name: the lowest real-time factor, the sum of the deadline misses, and
    every stage as ``node/stage``."""
    message = Timing()
    for name, timing in timings.items():
        message.window_s = max(message.window_s, timing.window_s)
        message.deadline_misses += timing.deadline_misses
        for stage in timing.stages:
            message.stages.append(
                StageTiming(
                    stage=f"{name}/{stage.stage}", count=stage.count, p50_us=stage.p50_us, p99_us=stage.p99_us,
                    max_us=stage.max_us,
                )
            )  # fmt: skip
    message.real_time_factor = min((timing.real_time_factor for timing in timings.values()), default=0.0)
    return message
