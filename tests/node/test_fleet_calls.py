"""Every call to a node of a fleet ends, with a reason for each body that was not spawned or removed."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest
from rclpy.task import Future
from smartmesh_msgs.msg import BodyFailure, BodySpecification
from smartmesh_msgs.srv import RemoveBodies, SpawnBodies

from smartmesh_ros.node.fleet.calls import Calls


def front_of(*, ready: bool = True) -> Any:
    """A node whose clients answer what the test says."""
    future = Future()
    client = SimpleNamespace(service_is_ready=lambda: ready, call_async=lambda _: future)
    return SimpleNamespace(future=future, create_client=lambda *_, **__: client)


def result_of(coroutine: Any) -> dict[str, str]:
    with pytest.raises(StopIteration) as end:
        coroutine.send(None)
    found: dict[str, str] = end.value.value
    return found


def test_a_node_that_dies_has_refused_all_bodies_of_the_call() -> None:
    front = front_of()
    calls = Calls(front, ["/a"], None)
    call = calls.remove("/a", ["one", "two"])
    call.send(None)
    calls.give_up("/b")
    assert not front.future.done()
    calls.give_up("/a")
    assert result_of(call) == dict.fromkeys(("one", "two"), "/a died before it answered")


@pytest.mark.parametrize(
    ("response", "refused"),
    [
        (SpawnBodies.Response(success=True), {}),
        (SpawnBodies.Response(message="busy"), {"one": "busy", "two": "busy"}),
        (SpawnBodies.Response(failures=[BodyFailure(id="two", reason="no room")]), {"two": "no room"}),
        (RemoveBodies.Response(success=True), {}),
    ],
)
def test_refusals_are_told_by_body(response: Any, refused: dict[str, str]) -> None:
    front = front_of()
    front.future.set_result(response)
    bodies = [BodySpecification(id=name) for name in ("one", "two")]
    assert result_of(Calls(front, ["/a"], None).spawn("/a", bodies)) == refused


def test_a_node_without_services_refuses_at_once() -> None:
    calls = Calls(front_of(ready=False), ["/a"], None)
    assert result_of(calls.remove("/a", ["one"])) == {"one": "/a serves no calls yet"}
