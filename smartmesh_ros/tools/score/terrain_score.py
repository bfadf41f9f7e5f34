"""The node ``terrain_score``: scores the grid maps of a mapper on ``~/map`` against the true ground on ``~/truth``.

The truth is what a terrain_collider with ``ground_maps`` publishes. The scores are on ``/diagnostics``, once a second,
and in a CSV file with a line for each map.
"""

from __future__ import annotations

import csv
from collections import Counter
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from time import monotonic
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.clock import Clock, ClockType
from rclpy.qos import QoSProfile

from smartmesh_ros.errors import InputError
from smartmesh_ros.io.rasters import RasterConfig
from smartmesh_ros.node.inputs.adapters import grid_map_raster
from smartmesh_ros.node.inputs.checked_messages import message_from
from smartmesh_ros.node.inputs.optional_messages import class_of
from smartmesh_ros.node.outputs.diagnostics import task_status
from smartmesh_ros.node.parameters.declaring import ParameterNode, fixed
from smartmesh_ros.node.parameters.helping import answer
from smartmesh_ros.node.refusals import LOG_PERIOD
from smartmesh_ros.node.running import spin
from smartmesh_ros.node.timing.stamps import stamp_seconds
from smartmesh_ros.tools.score.scorer import Score, ScoreConfig, Scorer

NAME, TRUTH, MAP = "terrain_score", "~/truth", "~/map"
_CONFIG = ScoreConfig()
SPECS = (
    fixed("layer", RasterConfig().layer, "Layer of the mapper's maps with the heights."),
    fixed("csv", "", "File that gets a line for each map; empty = none."),
    fixed("window", _CONFIG.window, "Time over whose maps the lag is estimated [s].", 0.1, 1000.0),
    fixed("longest_lag", _CONFIG.longest_lag, "Longest lag that is tried [s]: above the true lag, and below the "
          "period of ground that oscillates.", 0.01, 60.0),
)  # fmt: skip
# Time after which a source of maps is silent [s], and period of the diagnostics [s].
SILENT, PERIOD = 3.0, 1.0


class TerrainScore(ParameterNode):
    """Scores maps as they come."""

    def __init__(self, **node_options: Any) -> None:
        super().__init__(NAME, SPECS, **node_options)
        values, kind = self.values, class_of("grid_map_msgs/msg/GridMap", NAME)
        self.scorer = Scorer(ScoreConfig(window=values["window"], longest_lag=values["longest_lag"]))
        self.score: Score | None = None
        self._refused, self._refusals, self._scored = "", Counter[str](), 0
        self._frame = ""  # of the truth
        self._came: dict[str, float] = {}  # when the last message came, by topic [s]
        if values["csv"]:
            try:
                self._write("w", Score._fields)
            except OSError as error:
                raise InputError("parameter", f"csv cannot be written: {error}") from None
        self._status = self.create_publisher(DiagnosticArray, "/diagnostics", QoSProfile(depth=10))
        self._rasters = {TRUTH: RasterConfig(), MAP: RasterConfig(layer=values["layer"])}
        for topic in self._rasters:
            on_message = partial(self._on_message, kind, topic)
            self.create_subscription(kind, topic, on_message, QoSProfile(depth=10), raw=True)
        self.create_timer(PERIOD, self._publish, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _on_message(self, kind: Any, topic: str, data: bytes) -> None:
        self._came[topic] = monotonic()
        try:
            message = message_from(data, kind)
            stamp = stamp_seconds(message.header.stamp)
            if stamp is None:
                raise InputError("stamp", "a map has no stamp, so the truth of its time is unknown; stamp the maps")
            frame, raster = message.header.frame_id.strip("/"), grid_map_raster(message, self._rasters[topic], group="")
            if topic == TRUTH:
                self._frame = frame
                self.scorer.add_truth(stamp, raster)
            else:
                self._require_frame(frame)
                self.scorer.add_map(stamp, raster)
                self._refused = ""
        except InputError as error:
            self._refuse(f"{self.resolve_topic_name(topic)}: {error}", f"{topic}: {error.reason}")
        for score in self.scorer.take():
            self._note(score)

    def _refuse(self, words: str, reason: str) -> None:
        self._refused = words
        self._refusals[reason] += 1
        self.get_logger().warning(words, throttle_duration_sec=LOG_PERIOD)

    def _require_frame(self, frame: str) -> None:
        if self._frame and frame != self._frame:
            raise InputError(
                "frame", f"maps are in frame {frame!r}, the truth in {self._frame!r}; no transform is applied, because "
                "its error would count as the map's: let the mapper work in the frame of the truth"
            )  # fmt: skip

    def _note(self, score: Score) -> None:
        self.score, self._scored = score, self._scored + 1
        if self.values["csv"]:
            stamp, *rest = score
            try:
                self._write("a", (f"{stamp:.9f}", *(f"{value:.6g}" for value in rest)))
            except OSError as error:
                self._refuse(f"csv cannot be written: {error}", "csv")

    def _write(self, mode: str, row: Sequence[str]) -> None:
        with Path(self.values["csv"]).open(mode, newline="") as file:
            csv.writer(file).writerow(row)

    def _publish(self) -> None:
        level, words = self._state()
        values: dict[str, Any] = {"maps": self._scored}
        if self.score is not None:
            values |= {name: f"{value:.6g}" for name, value in self.score._asdict().items() if name != "stamp"}
        values |= {f"refused, {reason}": count for reason, count in sorted(self._refusals.items())}
        status = task_status(self.get_fully_qualified_name(), "score", level, words, values)
        message = DiagnosticArray(status=[status])
        message.header.stamp = self.get_clock().now().to_msg()
        self._status.publish(message)

    def _state(self) -> tuple[bytes, str]:
        for topic, source in ((TRUTH, "no truth"), (MAP, "the mapper is silent: no map")):
            name, came = self.resolve_topic_name(topic), self._came.get(topic)
            if came is None:
                return DiagnosticStatus.WARN, f"{source} on {name} so far; publish it, or remap {topic}"
            if (age := monotonic() - came) > SILENT:
                return DiagnosticStatus.WARN, f"{source} on {name} for {age:.1f} s"
        if self._refused:
            return DiagnosticStatus.WARN, self._refused
        if self.score is None:
            return DiagnosticStatus.WARN, "the maps wait for the truth of their time"
        if not self.score.cells:
            return DiagnosticStatus.WARN, "map and truth have no ground in common; are both around the robot?"
        return DiagnosticStatus.OK, summary(self.score)


def summary(score: Score) -> str:
    """Return a score in words."""
    lag = "unknown" if score.lag != score.lag else f"{score.lag:.3f} s"
    rest = f"covers {score.covered:.0%}, lag {lag}, delay {score.delay:.3f} s"
    return f"rmse {score.rmse:.4f} m, bias {score.bias:+.4f} m, {rest}"


def main(args: Sequence[str] | None = None) -> None:
    """Run the node until SIGINT or SIGTERM."""
    answer(NAME, __doc__, SPECS, args)
    spin(TerrainScore, args)
