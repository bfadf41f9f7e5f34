"""Markers as RViz keeps them."""

from visualization_msgs.msg import Marker, MarkerArray

from smartmesh_ros.tools.testing import Probe


class Display:
    """Markers of a topic by namespace and id, until another marker deletes them. ``by_namespace``: a DELETEALL with a
    namespace deletes that namespace, as in new versions of RViz; in old ones all. ``without_ground``: newest messages
    without any."""

    def __init__(self, probe: Probe, topic: str, *, by_namespace: bool = False) -> None:
        self.shown: dict[tuple[str, int], Marker] = {}
        self.without_ground = 0
        self._by_namespace = by_namespace
        probe.node.create_subscription(MarkerArray, topic, self._take, 100)

    def _take(self, message: MarkerArray) -> None:
        keys = [(marker.ns, marker.id) for marker in message.markers]
        assert len(set(keys)) == len(keys), "RViz reports an id that comes twice in one array"
        self.without_ground = 0 if any(ns.rpartition("/")[2] == "ground" for ns, _ in keys) else self.without_ground + 1
        for key, marker in zip(keys, message.markers, strict=True):
            if marker.action == Marker.DELETEALL:
                kept = {ns for ns, _ in self.shown} - {marker.ns} if self._by_namespace and marker.ns else set()
                self.shown = {key: marker for key, marker in self.shown.items() if key[0] in kept}
            elif marker.action == Marker.DELETE:
                self.shown.pop(key, None)
            else:
                self.shown[key] = marker

    def of(self, what: str) -> list[Marker]:
        """Return the markers of the ground, or of the bodies, in the namespace of the node."""
        return [marker for (own, _), marker in self.shown.items() if own.rpartition("/")[2] == what]
