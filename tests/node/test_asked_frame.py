"""What is said of a frame that nobody knows, without a node."""

from types import SimpleNamespace
from typing import Any

import pytest
from std_msgs.msg import Header

from smartmesh_ros import BodyState, HeightMap, InputError, Sphere, World
from smartmesh_ros.node.inputs import optional_messages
from smartmesh_ros.node.inputs.transform_input import TransformInput
from smartmesh_ros.node.parameters.settings import Settings
from smartmesh_ros.node.services.ground_services import asked_frame


def said(frame: str, bodies: tuple[str, ...]) -> str:
    """The refusal of a question in a frame, beside bodies."""
    with World(HeightMap([[0.0] * 5] * 5)) as world:
        for name in bodies:
            world.spawn(name, Sphere(0.1), 1.0, BodyState())
        session: Any = SimpleNamespace(
            paused=False, world=world, frame_id="map", settings=Settings(), listen=lambda *_, **__: None,
            clock=SimpleNamespace(stamp_now=lambda: 1.0), ahead_of_stamps=lambda: 0.0,
        )  # fmt: skip
        with pytest.raises(InputError) as caught:
            asked_frame(session, TransformInput(session), Header(frame_id=frame))
        assert caught.value.reason == "frame"
        return str(caught.value)


def test_a_body_that_is_not_there_is_named_first(monkeypatch: pytest.MonkeyPatch) -> None:
    """A user who gave the name of a body needs no tf2_msgs."""
    assert said("rover", ("ball", "box")).startswith("no body is called 'rover' (the bodies are ball, box), and as a")
    assert "known frames: none yet; the node has just subscribed to /tf, so ask again" in said("rover", ())
    monkeypatch.setattr(optional_messages, "find_interfaces", lambda *_: None)
    without = said("rover", ())
    assert without.startswith("no body is called 'rover' (there are no bodies), and as a frame: ")
    assert "apt install ros-jazzy-tf2-msgs" in without
