"""What is known when a test has waited in vain."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from rclpy.node import Node

from smartmesh_ros.testing.process import Process

# Lines of a node's log that are shown.
LINES = 15


def of_wait(timeout: float, node: Node, received: Mapping[str, list[Any]], processes: Iterable[Process]) -> str:
    """Why a condition may not have come true: what was received and refused, who is connected, and what the nodes
    logged."""
    counts = {topic: len(messages) for topic, messages in received.items()}
    lines = [f"waited {timeout:.0f} s in vain; received {counts}", f"refused: {_refusals(received) or 'nothing'}"]
    lines.append("connected, as publishers -> subscriptions:")
    lines += [f"  {topic}: {_names(node, topic)}" for topic in sorted(_topics(node, received))]
    for process in processes:
        state = "runs" if process.process.poll() is None else f"ended with {process.process.returncode}"
        lines.append(f"{process.name} {state}; its last lines:")
        lines += [f"  {line}" for line in process.output.splitlines()[-LINES:]]
    return "\n".join(lines)


def _refusals(received: Mapping[str, list[Any]]) -> str:
    """What the newest diagnostics count as refused."""
    for message in reversed(received.get("/diagnostics", [])):
        for status in message.status:
            if status.name.endswith(": inputs"):
                return ", ".join(f"{pair.key.removeprefix('refused, ')} {pair.value}" for pair in status.values)
    return ""


def _topics(node: Node, received: Mapping[str, list[Any]]) -> set[str]:
    """Topics that the test listens to or publishes, of which those without anybody else are the telling ones."""
    own = {publisher.topic_name for publisher in node.publishers}
    return own.union(received) - {"/rosout", "/parameter_events"}


def _names(node: Node, topic: str) -> str:
    publishers = {info.node_name for info in node.get_publishers_info_by_topic(topic)}
    subscriptions = {info.node_name for info in node.get_subscriptions_info_by_topic(topic)}
    return f"{', '.join(sorted(publishers)) or 'nobody'} -> {', '.join(sorted(subscriptions)) or 'nobody'}"
