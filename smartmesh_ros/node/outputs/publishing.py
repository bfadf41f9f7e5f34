"""Publishing of the outputs, at their rates and while they have subscribers."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import partial
from itertools import chain
from typing import Any

import numpy as np
from nav_msgs.msg import Odometry
from rclpy.duration import Duration
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState
from smartmesh_msgs.msg import (
    BodyDescriptionArray,
    ColliderPatchArray,
    ContactArray,
    ContactWrenchArray,
    HeightmapUpdate,
    StageTiming,
    Timing,
    TrackedBodyArray,
)
from std_msgs.msg import Header, String
from visualization_msgs.msg import MarkerArray

from smartmesh_ros.ground.bullet import undone
from smartmesh_ros.node.fleet.peers import PeerBodies
from smartmesh_ros.node.inputs.optional_messages import find_message
from smartmesh_ros.node.inputs.transform_input import TransformInput
from smartmesh_ros.node.outputs import body_outputs, patch_outputs
from smartmesh_ros.node.outputs.audience import Audience
from smartmesh_ros.node.outputs.cdr import ArrayMessage, floats
from smartmesh_ros.node.outputs.clock_publishing import ClockPublishing
from smartmesh_ros.node.outputs.diagnostics import Diagnostics, PaceWindow
from smartmesh_ros.node.outputs.grid_maps import grid_map_message
from smartmesh_ros.node.outputs.latched import LatchedOutput
from smartmesh_ros.node.outputs.motion_outputs import ImuOutput, OdometryOutput, deck_state, frame_of
from smartmesh_ros.node.outputs.rhythm import Rhythm
from smartmesh_ros.node.outputs.scan_outputs import GroundMapOutput, ScanOutput
from smartmesh_ros.node.outputs.scene_outputs import SceneMarkers, robot_model, shown_robot
from smartmesh_ros.node.outputs.transform_outputs import TransformOutputs
from smartmesh_ros.node.session import Session
from smartmesh_ros.soil.soil import Soil
from smartmesh_ros.world.states import SimulatedStates
from smartmesh_ros.world.world import ROUNDING

# Outputs that show patches.
PATCH_OUTPUTS = ("patches", "collider_patches")
# Longest wait at the end until subscribers that are held up have the last messages; ``ros2 launch`` kills a node after
# 5 s [s].
LAST_WORDS = 3.0


class RateTime:
    """Time by which the rates of outputs count [s]: simulated time where stamps are simulated, or else steady time. A
    pause of a node that publishes ``/clock`` takes steady time, too. Starts at zero and never goes back."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self._time, self._before = 0.0, (False, 0.0)

    def read(self) -> float:
        """Return the time."""
        session = self._session
        simulated = session.simulates_stamps and not (session.paused and session.settings.publish.clock)
        now = session.state_time() if simulated else session.clock.steady()
        if self._before[0] == simulated:
            self._time += max(now - self._before[1], 0.0)
        self._before = simulated, now
        return self._time + ROUNDING * session.world.dt


@dataclass
class _Output:
    publisher: Any
    make: Callable[[], Any]  # the message, or a list of messages
    audience: Audience
    rhythm: Rhythm = field(default_factory=Rhythm)
    served: int = 0  # number of subscribers of the last message


class Publishing:
    """The node's outputs."""

    def __init__(self, session: Session, peers: PeerBodies, transforms: TransformInput) -> None:
        self._session = session
        self._node, self._world, self._now = session.node, session.world, session.clock.steady
        self._markers = patch_outputs.PatchMarkers(session.marker_namespace)
        self._collider_patches = patch_outputs.ColliderPatches()
        self._scene = SceneMarkers(session)
        self._states = SimulatedStates(session.world)
        self._body_states, self._contacts = ArrayMessage(), ArrayMessage()
        self._clock = ClockPublishing(session)
        self._transforms = TransformOutputs(session, transforms)
        self._descriptions = LatchedOutput(
            session, BodyDescriptionArray, "~/body_descriptions",
            lambda: [body for body in session.world.bodies.values() if not body.owner],
            lambda bodies: body_outputs.descriptions(self._header(), bodies),
        )  # fmt: skip
        self._robot_model = LatchedOutput(
            session, String, "~/robot_model", partial(shown_robot, session.world, session.robot_names), robot_model
        )
        self._qos = QoSProfile(depth=10)
        self._outputs = self._new_outputs()
        self._sunk = -1  # revision of the map in the last message on ~/sinkage
        settings, qos = session.settings, self._qos
        self._of_entries: dict[str, list[Any]] = {
            "height_scan": [ScanOutput(session, entry, qos) for entry in settings.height_scans],
            "ground_map": [GroundMapOutput(session, entry, qos) for entry in settings.ground_maps],
            "imu": [ImuOutput(session, entry, qos) for entry in settings.imus],
            "odom": [
                OdometryOutput(session, entry, session.bases[entry.body], transforms, qos) for entry in settings.bases
            ],
        }
        of_entries = chain.from_iterable(self._of_entries.values())
        ends: list[Any] = [self._descriptions, self._robot_model, *of_entries, *self._outputs.values()]
        self._diagnostics = Diagnostics(session, peers, self._clock, [end.publisher for end in ends])
        self._time = RateTime(session)
        for place, (name, output) in enumerate(self._outputs.items()):  # staggered, so that no step publishes all
            output.rhythm = Rhythm(place / (len(self._outputs) * max(settings.publish.of(name), 1.0)))
        self._handled = 0  # messages and calls at the last time
        self._timing_window = PaceWindow(session)

    def _new_outputs(self) -> dict[str, _Output]:
        """Return the outputs that have a rate of their own, by the names of their topics and of their rates."""
        made: dict[str, tuple[Any, Callable[[], Any]]] = {
            "patches": (MarkerArray, self._make_patches),
            "collider_patches": (ColliderPatchArray, self._make_collider_patches),
            "body_states": (TrackedBodyArray, self._make_body_states),
            "contacts": (ContactArray, self._make_contacts),
            "timing": (Timing, self._make_timing),
            "joint_states": (JointState, self._make_joint_states),
            "odometry": (Odometry, self._make_odometry),
            "contact_wrenches": (ContactWrenchArray, self._make_contact_wrenches),
            "pressed_ground": (HeightmapUpdate, self._make_pressed_ground),
            "scene": (MarkerArray, self._make_scene),
        }
        if (grid_map := find_message("grid_map_msgs", "GridMap")) is not None:
            made["sinkage"] = grid_map, partial(self._make_sinkage, grid_map)
        return {
            name: _Output(self._session.publisher(kind, f"~/{name}", self._qos), make, Audience(self._now))
            for name, (kind, make) in made.items()
        }

    def publish(self, *, now: bool = False, idle: bool = False) -> None:
        """Publishes every output that has subscribers and is due. ``now``: due or not. ``idle``: without a step, also
        if there was a message or call since the last time, and what has subscribers that it had not before."""
        session = self._session
        steady, time, enduring = self._now(), self._time.read(), session.enduring
        now, self._handled = now or (idle and session.handled != self._handled), session.handled
        self._publish(self._outputs, time, now=now, idle=idle)
        for name, outputs in self._of_entries.items():
            with enduring(name):
                for output in outputs:
                    output.publish(now=now)
        with enduring("clock"):
            self._clock.publish(steady)
        with enduring("tf"):
            self._transforms.publish(steady, time, at_once=now)
        with enduring("body_descriptions"):
            self._descriptions.publish()
        with enduring("robot_model"):
            self._robot_model.publish()
        with enduring("diagnostics"):
            self._diagnostics.publish(steady)

    def close(self) -> None:
        """Deletes patches and scene from the displays of subscribers, which keep them else."""
        end = self._now() + LAST_WORDS
        of_displays = {"patches": [self._session.marker_namespace], "scene": self._scene.namespaces}
        publishers = {name: self._outputs[name].publisher for name in of_displays}
        watched = {name: publisher for name, publisher in publishers.items() if publisher.get_subscription_count()}
        for name, publisher in watched.items():
            with self._session.enduring(name):
                markers = [patch_outputs.deletion(self._header(), space) for space in of_displays[name]]
                publisher.publish(MarkerArray(markers=markers))
        for name, publisher in watched.items():
            with self._session.enduring(name):
                publisher.wait_for_all_acked(Duration(seconds=max(end - self._now(), 0.0)))

    def publish_patches(self) -> None:
        """Publishes the patch outputs that are due; called before a step, so that they do not wait for the physics."""
        self._publish(PATCH_OUTPUTS, self._time.read())

    def _publish(self, names: Iterable[str], time: float, *, now: bool = False, idle: bool = False) -> None:
        for name in names:
            output, rate = self._outputs[name], self._session.settings.publish.of(name)
            at_once = now or (idle and _has_joined(output))
            if rate > 0.0 and output.rhythm.is_due(time, rate, now=at_once):
                with self._session.enduring(name):
                    self._send(output)

    def _send(self, output: _Output) -> None:
        output.served = output.publisher.get_subscription_count()
        if not output.served:
            return
        with self._world.stopwatch.stage("publish"), undone(output.audience.missed):
            made = output.make()
            for message in made if isinstance(made, list) else [made]:
                output.publisher.publish(message)

    def _header(self) -> Header:
        return Header(stamp=self._session.stamp_now(), frame_id=self._session.frame_id)

    def _needs_all(self, name: str) -> bool:
        output = self._outputs[name]
        output.audience.count(output.served, self._node.count_publishers(output.publisher.topic_name))
        return output.audience.needs_all()

    def _only_changed(self, name: str) -> bool:
        return not self._needs_all(name) and self._session.settings.incremental

    def _make_patches(self) -> bytes:
        world, only_changed = self._world, self._only_changed("patches")
        return self._markers.write(
            self._header(), world.patches(), world.followers.names, world.followers.epoch,
            only_changed=only_changed, clear=self._outputs["patches"].audience.new and not only_changed,
        )  # fmt: skip

    def _make_collider_patches(self) -> bytes:
        world, only_changed = self._world, self._only_changed("collider_patches")
        return self._collider_patches.write(
            self._header(), world.patches().table(), world.followers.names, world.followers.epoch,
            only_changed=only_changed,
        )  # fmt: skip

    def _make_body_states(self) -> bytes:
        physics = self._world.config.physics
        states, ahead = self._states.read(), self._session.ahead_of_stamps()
        return body_outputs.body_states(self._body_states, self._header(), states, physics, ahead)

    def _make_contacts(self) -> bytes:
        return body_outputs.contact_array(self._contacts, self._header(), self._world.contacts())

    def _make_joint_states(self) -> list[JointState]:
        """Return one message, or none if the world has no robot."""
        prefixes = self._session.robot_names.prefixes()
        return [body_outputs.joint_states(self._header(), self._world, prefixes)] if prefixes else []

    def _make_odometry(self) -> list[Odometry]:
        """Return the true odometry of each robot, of its root link, and of each deck."""
        session, world = self._session, self._world
        robots = [(frame_of(session, name), world.base_state(name)) for name in session.robot_names.prefixes()]
        decks = [(name, deck_state(deck.frame(world.time))) for name, deck in world.terrain.decks.items()]
        return [body_outputs.odometry(self._header(), child, state) for child, state in (*robots, *decks)]

    def _make_contact_wrenches(self) -> ContactWrenchArray:
        return body_outputs.contact_wrenches(self._header(), self._world)

    def _make_pressed_ground(self) -> list[HeightmapUpdate]:
        """Return the message of what changed in the soil, if any did."""
        world, everything = self._world, self._needs_all("pressed_ground")
        soil = world.ground.soil
        region = soil.changes(world.time, everything=everything) if isinstance(soil, Soil) else None
        if region is None:
            return []
        height, width = region.heights.shape
        heights, velocities = floats(region.heights), floats(np.zeros_like(region.heights))
        return [
            HeightmapUpdate(
                header=self._header(), x=region.column, y=region.row, width=width, height=height, heights=heights,
                velocities=velocities,
            )
        ]  # fmt: skip

    def _make_sinkage(self, kind: Any) -> list[Any]:
        """Return the grid map of the soil, if it changed or somebody is new."""
        soil, everything = self._world.ground.soil, self._needs_all("sinkage")
        if not isinstance(soil, Soil):
            return []
        shown, self._sunk = self._sunk, soil.map.revision
        if shown == soil.map.revision and not (everything and self._outputs["sinkage"].audience.new):
            return []
        grid = soil.map.geometry
        layers = {"elevation": soil.map.heights + np.float32(grid.origin[2]), "sinkage": soil.sinkage()}
        return [grid_map_message(kind, self._header(), grid, layers)]

    def _make_scene(self) -> bytes:
        return self._scene.write(self._header(), clear=self._needs_all("scene"))

    def _make_timing(self) -> Timing:
        length, factor, misses = self._timing_window.read()
        stages = [
            StageTiming(
                stage=times.stage, count=times.runs, p50_us=times.p50_us, p99_us=times.p99_us, max_us=times.max_us
            )
            for times in (*self._world.stopwatch.read(), *self._session.pacer.lateness.read())
        ]
        message = Timing(window_s=length, real_time_factor=factor, deadline_misses=misses, stages=stages)
        message.header.stamp = self._session.stamp_now()
        return message


def _has_joined(output: _Output) -> bool:
    """Return True if an output has more subscribers than at its last message, or at the last call."""
    before, output.served = output.served, output.publisher.get_subscription_count()
    return output.served > before
