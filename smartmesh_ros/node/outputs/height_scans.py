"""``~/height_scan/<body>``: heights of the ground around bodies, for policies of legged robots."""

from __future__ import annotations

import math
from typing import Any

from std_msgs.msg import Float32MultiArray, MultiArrayDimension, MultiArrayLayout

from smartmesh_ros.node.outputs.cdr import floats
from smartmesh_ros.node.parameters.settings import ScanEntry
from smartmesh_ros.node.session import Session
from smartmesh_ros.terrain.height_scan import HeightScan
from smartmesh_ros.world.height_scanner import HeightScanner

# Share of a step by which a scan may be early, because simulated times are sums of rounded steps.
ROUNDING = 1e-3


class ScanOutput:
    """Publishes the scan of an entry of ``height_scans`` at its rate in simulated time, while it has subscribers and
    its body is there. ``publisher``: of the scan."""

    def __init__(self, session: Session, entry: ScanEntry, qos: Any) -> None:
        session.topics.publish(entry.topic)
        self._world, self._entry = session.world, entry
        self.publisher = session.node.create_publisher(Float32MultiArray, entry.topic, qos)
        self._layout = layout_message(entry.scan)
        self._scanner = HeightScanner(session.world, entry.body, entry.scan)
        self._turn = -1

    def publish(self, *, now: bool) -> None:
        """Scan if that is due, or ``now``, and publish the values that are known by now."""
        world, entry = self._world, self._entry
        if not self.publisher.get_subscription_count() or entry.body not in world.bodies:
            self._scanner.forget()
            return
        turn = math.floor((world.time + ROUNDING * world.dt) * entry.rate)
        if now or turn != self._turn:
            self._turn = turn
            self._scanner.measure()
        if (values := self._scanner.take()) is not None:
            self.publisher.publish(Float32MultiArray(layout=self._layout, data=floats(values[0])))


def layout_message(scan: HeightScan) -> MultiArrayLayout:
    """Return the layout of a scan's values: axes "x" and "y" of the body's yaw frame, the slower one first."""
    (slow, rows), (fast, columns) = scan.layout
    dimensions = [
        MultiArrayDimension(label=slow, size=rows, stride=rows * columns),
        MultiArrayDimension(label=fast, size=columns, stride=columns),
    ]
    return MultiArrayLayout(dim=dimensions)
