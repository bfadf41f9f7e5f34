"""The standard services of simulation_interfaces, if that package is installed.

Definitions 1.x (ROS 2 Jazzy) and 2.x are both accepted. Entities are the bodies of the world, including tracked bodies.
Only URDF robots can be spawned.
"""

from __future__ import annotations

import signal
from collections.abc import Callable, Mapping
from itertools import chain, count
from types import MappingProxyType
from typing import Any

from geometry_msgs.msg import Vector3
from rclpy.node import Node

from smartmesh_ros.errors import InputError
from smartmesh_ros.node.inputs import conversions
from smartmesh_ros.node.inputs.optional_messages import find_interfaces
from smartmesh_ros.node.outputs.body_outputs import pose_message, twist_message
from smartmesh_ros.node.refusals import reason_of
from smartmesh_ros.node.services.entities import own_bounds, select
from smartmesh_ros.node.services.robot_files import robot_name, urdf_text, with_package_paths
from smartmesh_ros.node.services.step_action import StepAction
from smartmesh_ros.node.session import REFUSED, Session, require_name
from smartmesh_ros.world.bodies import Body
from smartmesh_ros.world.link_frames import centre_state

PACKAGE = "simulation_interfaces"
FEATURES = (
    "SPAWNING", "SPAWNING_RESOURCE_STRING", "DELETING", "ENTITY_BOUNDS_BOX", "ENTITY_STATE_GETTING",
    "ENTITY_STATE_SETTING", "SIMULATION_RESET", "SIMULATION_RESET_TIME", "SIMULATION_RESET_STATE",
    "SIMULATION_RESET_SPAWNED", "SIMULATION_STATE_GETTING", "SIMULATION_STATE_SETTING", "SIMULATION_STATE_PAUSE",
    "STEP_SIMULATION_SINGLE", "STEP_SIMULATION_MULTIPLE",
)  # fmt: skip
# Features of services that came with later definitions, by the service; reported if the installed package has it.
LATER_FEATURES = {
    "SpawnEntities": "SPAWNING_ENTITIES",
    "GetEntityBounds": "ENTITY_BOUNDS",
    "GetEntityInfo": "ENTITY_INFO_GETTING",
}
# Result code by the reason of an InputError. The codes of SpawnEntity and of entity states take precedence.
_REASONS = {"unknown_body": "RESULT_NOT_FOUND", "unsupported": "RESULT_FEATURE_UNSUPPORTED"}
_SPAWN_REASONS = {
    "duplicate_id": "NAME_NOT_UNIQUE",
    "empty_id": "NAME_INVALID",
    "urdf_format": "UNSUPPORTED_FORMAT",
    "no_resource": "NO_RESOURCE",
    "urdf": "RESOURCE_PARSE_ERROR",
    "urdf_package": "MISSING_ASSETS",
    "frame": "INVALID_POSE",
    "non_finite": "INVALID_POSE",
    "quaternion": "INVALID_POSE",
}
_TRANSITION_REASONS = {"in_state": "ALREADY_IN_TARGET_STATE", "state": "STATE_TRANSITION_ERROR"}
_STATE_REASONS = dict.fromkeys(("frame", "non_finite", "quaternion"), "INVALID_POSE")


def serve_simulation_interfaces(session: Session, node: Any) -> None:
    """Create the services; log an error if the package is not installed. ``node``: the `TerrainCollider`, whose methods
    ``pause``, ``step`` and ``reset`` they call."""
    services = find_interfaces(PACKAGE, "srv")
    messages = find_interfaces(PACKAGE, "msg")
    if services is None or messages is None:
        session.node.get_logger().error(
            "simulation_interfaces: true has no effect: package simulation_interfaces is not installed; "
            "apt install ros-jazzy-simulation-interfaces"
        )
        return
    SimulationServices(session, node, services, messages)


class SimulationServices:
    """Answers each service from the world. ``services``, ``messages``: the modules of simulation_interfaces."""

    def __init__(self, session: Session, node: Any, services: Any, messages: Any) -> None:
        self._session, self._node = session, node
        self._results, self._states = messages.Result, messages.SimulationState
        self._features, self._bounds = messages.SimulatorFeatures, messages.Bounds
        self._messages, self._services = messages, services
        self._stopped = False
        serve = self._serve
        serve("GetSimulatorFeatures", "get_simulator_features", self._get_features)
        serve("GetSimulationState", "get_simulation_state", self._get_state)
        serve("SetSimulationState", "set_simulation_state", self._set_state, _TRANSITION_REASONS)
        serve("StepSimulation", "step_simulation", self._step)
        serve("ResetSimulation", "reset_simulation", self._reset)
        serve("SpawnEntity", "spawn_entity", self._spawn, _SPAWN_REASONS)
        serve("SpawnEntities", "spawn_entities", self._spawn_all, {"entities": "ENTITIES_SPAWN_FAILED"})
        serve("DeleteEntity", "delete_entity", lambda request, _: session.remove(request.entity))
        serve("GetEntities", "get_entities", self._get_entities)
        serve("GetEntitiesStates", "get_entities_states", self._get_entities_states)
        serve("GetEntityBounds", "get_entity_bounds", self._get_bounds)
        serve("GetEntityInfo", "get_entity_info", self._get_info)
        self._action = None
        if (
            isinstance(session.node, Node)
            and (kind := getattr(find_interfaces(PACKAGE, "action"), "SimulateSteps", None)) is not None
        ):
            self._action = StepAction(session, node.step, kind, self._results)
        serve("GetEntityState", "get_entity_state", lambda asked, found: self._write_state(asked.entity, found.state))
        serve("SetEntityState", "set_entity_state", self._set_entity_state, _STATE_REASONS)

    def _serve(
        self, name: str, service: str, act: Callable[[Any, Any], Any], reasons: Mapping[str, str] = MappingProxyType({})
    ) -> None:
        """Serve ``~/service`` by ``act``, which may return an awaitable, if the installed package has a service of this
        ``name``. ``reasons``: result code by reason of an `InputError` of ``act``."""
        if (kind := getattr(self._services, name, None)) is None:
            return

        def conclude(response: Any, error: Exception | None) -> None:
            if hasattr(response, "result"):
                code = self._results.RESULT_OK if error is None else self._code(error, reasons, kind.Response)
                response.result.result, response.result.error_message = code, str(error or "")

        self._session.serve(kind, service, act, conclude)

    def _code(self, error: Exception, reasons: Mapping[str, str], codes: Any) -> int:
        """Return the result code of an error: one of ``codes`` by its reason, or else a general one."""
        reason = reason_of(error)
        if (own := reasons.get(reason)) is not None:
            return int(getattr(codes, own))
        return int(getattr(self._results, _REASONS.get(reason, "RESULT_OPERATION_FAILED")))

    def _get_features(self, _: Any, response: Any) -> None:
        later = [name for service, name in LATER_FEATURES.items() if hasattr(self._services, service)]
        if self._action is not None:
            later.append("STEP_SIMULATION_ACTION")
        response.features.features = [getattr(self._features, name) for name in (*FEATURES, *later)]
        response.features.spawn_formats = ["urdf"]
        response.features.custom_info = (
            "smartmesh_ros terrain_collider. The state of tracked bodies cannot be set. Accelerations are not "
            "measured: they read zero, and are ignored when set."
        )

    def _state(self) -> int:
        if not self._session.paused:
            return int(self._states.STATE_PLAYING)
        # Stepping or playing by another service since the stop has started the simulation again.
        stopped = self._stopped and self._session.world.time == 0.0
        return int(self._states.STATE_STOPPED if stopped else self._states.STATE_PAUSED)

    def _get_state(self, _: Any, response: Any) -> None:
        response.state.state = self._state()

    def _set_state(self, request: Any, _: Any) -> None:
        states, wanted = self._states, request.state.state
        if wanted == self._state():
            raise InputError("in_state", "the simulation is in this state already")
        if wanted == states.STATE_QUITTING:
            signal.raise_signal(signal.SIGINT)  # ends the node's loop once this call is answered
        elif wanted == states.STATE_PLAYING:
            self._node.pause(False)
        elif wanted == states.STATE_PAUSED:
            self._node.pause(True)
            self._stopped = False
        elif wanted == states.STATE_STOPPED:
            self._node.pause(True)
            self._node.reset(spawned=True)
            self._stopped = True
        else:
            raise InputError("state", f"state {wanted} cannot be set; use STOPPED, PLAYING, PAUSED or QUITTING")

    def _step(self, request: Any, _: Any) -> None:
        if self._state() != self._states.STATE_PAUSED:
            raise InputError("not_paused", "only a paused simulation can be stepped; set STATE_PAUSED first")
        self._node.step(request.steps)

    def _reset(self, request: Any, _: Any) -> None:
        scope = request.scope or request.SCOPE_ALL
        self._node.reset(
            time=bool(scope & request.SCOPE_TIME),
            bodies=bool(scope & request.SCOPE_STATE),
            spawned=bool(scope & request.SCOPE_SPAWNED),
        )

    async def _spawn(self, request: Any, response: Any) -> None:
        response.entity_name = await self._spawn_entity(request)

    async def _spawn_all(self, request: Any, response: Any) -> None:
        failed = 0
        for wanted in request.spawn_requests:
            result = self._messages.SpawnResult()
            try:
                result.entity_name = await self._spawn_entity(wanted)
                result.result.result = self._results.RESULT_OK
            except REFUSED as error:
                failed += 1
                result.result.result = self._code(error, _SPAWN_REASONS, result)
                result.result.error_message = str(error)
            response.results.append(result)
        if failed:
            raise InputError("entities", f"{failed} of {len(response.results)} entities are not spawned; see results")

    async def _spawn_entity(self, request: Any) -> str:
        """Spawn the entity of a request, and return its name. Raises `InputError`."""
        session = self._session
        given = _urdf_of(getattr(request, "entity_resource", request))
        if request.entity_namespace:
            raise InputError("unsupported", "entity_namespace is not supported; leave it empty")
        session.require_frame(request.initial_pose.header.frame_id)
        state = conversions.state_from(request.initial_pose.pose)
        robot = await session.robots.prepared(given, session.settings)
        name = request.name or robot_name(urdf_text(robot.given))
        with session.lock:
            if request.allow_renaming:
                name = self._free_name(name)
            require_name(name)
            session.require_room([name])
            session.world.spawn_robot(name, robot, state)
            body = session.world.bodies[name]
            body.initial = centre_state(state, body.inertial)  # the pose is that of the base link
            session.world.move(name, body.initial)
            session.start_of(name, body.initial)
        return name

    def _free_name(self, wanted: str) -> str:
        wanted = wanted.replace("/", "_") or "entity"
        names = chain([wanted], (f"{wanted}_{number}" for number in count(1)))
        return next(name for name in names if name not in self._session.world.bodies)

    def _get_entities(self, request: Any, response: Any) -> None:
        response.entities = select(self._session.world, request.filters, self._bounds)

    def _get_entities_states(self, request: Any, response: Any) -> None:
        self._get_entities(request, response)
        for name in response.entities:
            response.states.append(self._messages.EntityState())
            self._write_state(name, response.states[-1])

    def _body(self, name: str) -> Body:
        if (body := self._session.world.bodies.get(name)) is None:
            raise InputError("unknown_body", f"there is no body {name!r}")
        return body

    def _get_bounds(self, request: Any, response: Any) -> None:
        body = self._body(request.entity)
        low, high = (Vector3(x=x, y=y, z=z) for x, y, z in (corner.tolist() for corner in own_bounds(body)))
        response.bounds.type, response.bounds.points = self._bounds.TYPE_BOX, [high, low]

    def _get_info(self, request: Any, response: Any) -> None:
        body, category = self._body(request.entity), response.info.category
        category.category = category.CATEGORY_ROBOT if body.is_robot else category.CATEGORY_OBJECT
        response.info.description = "its pose is dictated by a topic" if body.tracked else "simulated"

    def _write_state(self, name: str, message: Any) -> None:
        session = self._session
        state = session.world.base_state(name)
        message.header.stamp, message.header.frame_id = session.stamp_now(), session.frame_id
        message.pose, message.twist = pose_message(state), twist_message(state)

    def _set_entity_state(self, request: Any, _: Any) -> None:
        world, name = self._session.world, request.entity
        now = world.base_state(name)
        self._session.require_frame(request.state.header.frame_id)
        pose = request.state.pose if getattr(request, "set_pose", True) else pose_message(now)
        twist = request.state.twist if getattr(request, "set_twist", True) else twist_message(now)
        world.move(name, centre_state(conversions.state_from(pose, twist), world.bodies[name].inertial))


def _urdf_of(resource: Any) -> str:
    """Return the path of a resource's URI, or else its URDF text. Raises `InputError` if neither is URDF."""
    if not resource.uri:
        if not resource.resource_string:
            raise InputError("no_resource", "both uri and resource_string are empty; give a URDF file or its text")
        robot_name(resource.resource_string)  # must be URDF
        return with_package_paths(resource.resource_string)
    path = with_package_paths(resource.uri)
    if not path.endswith(".urdf"):
        raise InputError("urdf_format", f"{resource.uri!r} does not end in .urdf, the only supported format")
    return path
