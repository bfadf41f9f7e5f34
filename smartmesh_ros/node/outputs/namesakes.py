"""Detection of nodes with the same full name, which receive the same topics and answer each other's calls."""

from __future__ import annotations

from time import monotonic

from rclpy.node import Node

# Period of the check [s].
PERIOD = 1.0


class Namesakes:
    """Logs a warning whenever another node with the same full name appears."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._due = 0.0
        self._known = 0

    def check(self) -> None:
        """Checks for such nodes, if a check is due."""
        if (now := monotonic()) < self._due:
            return
        self._due = now + PERIOD
        node = self._node
        count = node.get_node_names_and_namespaces().count((node.get_name(), node.get_namespace())) - 1
        if count > self._known:
            node.get_logger().warning(
                f"another node is called {node.get_fully_qualified_name()}, or was until seconds ago: both hear the "
                "same topics, and either answers calls meant for the other; give one a namespace (-r __ns:=/name) or "
                "another ROS_DOMAIN_ID"
            )
        self._known = count
