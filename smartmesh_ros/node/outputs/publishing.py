"""Publishing of the outputs, at their rates and while they have subscribers."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np
from nav_msgs.msg import Odometry
from rclpy.duration import Duration
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

from smartmesh_ros.node.fleet.peers import PeerBodies
from smartmesh_ros.node.inputs.optional_messages import find_class
from smartmesh_ros.node.inputs.transform_input import TransformInput
from smartmesh_ros.node.outputs import body_outputs, patch_outputs
from smartmesh_ros.node.outputs.cdr import ArrayMessage, floats
from smartmesh_ros.node.outputs.clock_publishing import ClockPublishing
from smartmesh_ros.node.outputs.diagnostics import Diagnostics, PaceWindow
from smartmesh_ros.node.outputs.motion_outputs import ImuOutput, OdometryOutput, deck_state, frame_of
from smartmesh_ros.node.outputs.rates import LatchedOutput, Output, RateTime, Rhythm
from smartmesh_ros.node.outputs.scan_outputs import GroundMapOutput, ScanOutput, grid_map_message
from smartmesh_ros.node.outputs.scene_outputs import SceneMarkers, robot_model, shown_robot
from smartmesh_ros.node.outputs.transform_outputs import TransformOutputs
from smartmesh_ros.node.session import Session
from smartmesh_ros.soil.soil import Soil
from smartmesh_ros.world.states import SimulatedStates

# Outputs that show patches.
PATCH_OUTPUTS = ("patches", "collider_patches")
# Longest wait at the end until subscribers that are held up have the last messages; ``ros2 launch`` kills a node after
# 5 s [s].
LAST_WORDS = 3.0


class Publishing:
    """All outputs. ``waiting``: returns the bodies that wait for ground, by name."""

    def __init__(
        self, session: Session, peers: PeerBodies, transforms: TransformInput, waiting: Callable[[], Mapping[str, bool]]
    ) -> None:
        self._session = session
        self._world, self._now = session.world, session.clock.steady
        self._markers = patch_outputs.PatchMarkers(session.marker_namespace)
        self._collider_patches = patch_outputs.ColliderPatches()
        self._scene = SceneMarkers(session)
        self._states = SimulatedStates(session.world)
        self._body_states = ArrayMessage()
        self._clock = ClockPublishing(session)
        self._transforms = TransformOutputs(session, transforms)
        self._descriptions = LatchedOutput(
            session, BodyDescriptionArray, "~/body_descriptions",
            lambda: [body for body in session.world.bodies.values() if not body.owner],
            lambda bodies: BodyDescriptionArray(header=self._header(), bodies=[*map(body_outputs.description, bodies)]),
        )  # fmt: skip
        self._robot_model = LatchedOutput(
            session, String, "~/robot_model", partial(shown_robot, session.world, session.robot_names), robot_model
        )
        self._outputs = self._new_outputs()
        self._sunk = -1  # revision of the map in the last message on ~/sinkage
        settings = session.settings
        self._of_entries: dict[str, list[Any]] = {
            "height_scan": [ScanOutput(session, entry) for entry in settings.height_scans],
            "ground_map": [GroundMapOutput(session, entry) for entry in settings.ground_maps],
            "imu": [ImuOutput(session, entry) for entry in settings.imus],
            "odom": [OdometryOutput(session, entry, transforms) for entry in settings.bases],
        }
        self._diagnostics = Diagnostics(session, peers, self._clock, waiting)
        self._time = RateTime(session)
        for place, (name, output) in enumerate(self._outputs.items()):  # staggered, so that no step publishes all
            output.rhythm = Rhythm(place / (len(self._outputs) * max(settings.publish.of(name), 1.0)))
        self._handled = 0  # messages and calls at the last time
        self._timing_window = PaceWindow(session)

    def _new_outputs(self) -> dict[str, Output]:
        """Return the outputs that have a rate of their own, by the names of their topics and of their rates."""
        world, header, message = self._world, self._header, ArrayMessage()
        made: dict[str, tuple[Any, Callable[[], Any]]] = {
            "patches": (MarkerArray, self._make_patches),
            "collider_patches": (ColliderPatchArray, self._make_collider_patches),
            "body_states": (TrackedBodyArray, self._make_body_states),
            "contacts": (ContactArray, lambda: body_outputs.contact_array(message, header(), world.contacts())),
            "timing": (Timing, self._make_timing),
            "joint_states": (JointState, self._make_joint_states),
            "odometry": (Odometry, self._make_odometry),
            "contact_wrenches": (ContactWrenchArray, lambda: body_outputs.contact_wrenches(header(), world)),
            "pressed_ground": (HeightmapUpdate, self._make_pressed_ground),
            "scene": (MarkerArray, lambda: self._scene.write(header(), clear=self._outputs["scene"].needs_all())),
        }
        if (grid_map := find_class("grid_map_msgs/msg/GridMap")) is not None:
            made["sinkage"] = grid_map, partial(self._make_sinkage, grid_map)
        return {name: Output(self._session, kind, name, make) for name, (kind, make) in made.items()}

    def publish(self, *, now: bool = False, idle: bool = False) -> None:
        """Publishes every output that has subscribers and is due. ``now``: due or not. ``idle``: without a step, also
        if there was a message or call since the last time, and what has subscribers that it had not before."""
        session = self._session
        steady, time, enduring = self._now(), self._time.read(), session.enduring
        now, self._handled = now or (idle and session.handled != self._handled), session.handled
        for output in self._outputs.values():
            output.publish(time, now=now, idle=idle)
        for name, of_entries in self._of_entries.items():
            for one in of_entries:
                with enduring(name):
                    one.publish(now=now)
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
        spaces = {"patches": [self._session.marker_namespace], "scene": self._scene.namespaces}
        watched = [name for name in spaces if self._outputs[name].publisher.get_subscription_count()]
        for name in watched:
            with self._session.enduring(name):
                markers = [patch_outputs.deletion(self._header(), space) for space in spaces[name]]
                self._outputs[name].publisher.publish(MarkerArray(markers=markers))
        for name in watched:
            with self._session.enduring(name):
                left = Duration(seconds=max(end - self._now(), 0.0))
                self._outputs[name].publisher.wait_for_all_acked(left)

    def publish_patches(self) -> None:
        """Publishes the patch outputs that are due; called before a step, so that they do not wait for the physics."""
        time = self._time.read()
        for name in PATCH_OUTPUTS:
            self._outputs[name].publish(time)

    def _header(self) -> Header:
        return Header(stamp=self._session.stamp_now(), frame_id=self._session.frame_id)

    def _only_changed(self, name: str) -> bool:
        return not self._outputs[name].needs_all() and self._session.settings.incremental

    def _make_patches(self) -> bytes:
        world, only_changed = self._world, self._only_changed("patches")
        return self._markers.write(
            self._header(), world.patches(), world.followers.names, world.followers.epoch,
            only_changed=only_changed, clear=self._outputs["patches"].new and not only_changed,
        )  # fmt: skip

    def _make_collider_patches(self) -> bytes:
        world, only_changed = self._world, self._only_changed("collider_patches")
        return self._collider_patches.write(
            self._header(), world.patches().table(), world.followers.names, world.followers.epoch,
            only_changed=only_changed,
        )  # fmt: skip

    def _make_body_states(self) -> bytes:
        physics = self._world.config.physics
        session, states = self._session, self._states.read()
        # The lead of simulated time, at which the bodies are, over the stamp.
        ahead = 0.0 if session.simulates_stamps else self._world.time - session.time_at(0.0)
        return body_outputs.body_states(self._body_states, self._header(), states, physics, ahead)

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

    def _make_pressed_ground(self) -> list[HeightmapUpdate]:
        """Return the message of what changed in the soil, if any did."""
        world, everything = self._world, self._outputs["pressed_ground"].needs_all()
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
        soil, output = self._world.ground.soil, self._outputs["sinkage"]
        everything = output.needs_all() and output.new
        if not isinstance(soil, Soil):
            return []
        shown, self._sunk = self._sunk, soil.map.revision
        if shown == soil.map.revision and not everything:
            return []
        grid = soil.map.geometry
        layers = {"elevation": soil.map.heights + np.float32(grid.origin[2]), "sinkage": soil.sinkage()}
        return [grid_map_message(kind, self._header(), grid, layers)]

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
