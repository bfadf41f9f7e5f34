"""Report for a test whose wait timed out."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from rclpy.node import Node

from smartmesh_ros.tools.testing.process import Process

# Number of lines of a node's log in the report.
LOG_LINES = 15


def explain_timeout(
    timeout: float, node: Node, received: Mapping[str, list[Any]], inputs: Mapping[str, str],
    processes: Iterable[Process],
) -> str:  # fmt: skip
    """Return hints to why a condition did not hold: messages received and refused (``inputs``: of the diagnostics),
    connections, and the nodes' logs."""
    counts = {topic: len(messages) for topic, messages in received.items()}
    refused = [f"{key.removeprefix('refused, ')} {value}" for key, value in inputs.items() if key != "message"]
    lines = [f"waited {timeout:.0f} s in vain; received {counts}", f"refused: {', '.join(refused) or 'nothing'}"]
    lines.append("connected, as publishers -> subscriptions:")
    # A topic of the test without other endpoints is the likely cause.
    topics = {publisher.topic_name for publisher in node.publishers}.union(received)
    for topic in sorted(topics - {"/rosout", "/parameter_events"}):
        ends = node.get_publishers_info_by_topic(topic), node.get_subscriptions_info_by_topic(topic)
        names = (", ".join(sorted({info.node_name for info in infos})) or "nobody" for infos in ends)
        lines.append(f"  {topic}: {' -> '.join(names)}")
    for process in processes:
        state = "runs" if process.process.poll() is None else f"ended with {process.process.returncode}"
        lines.append(f"{process.name} {state}; its last lines:")
        lines += [f"  {line}" for line in process.output.splitlines()[-LOG_LINES:]]
    return "\n".join(lines)
