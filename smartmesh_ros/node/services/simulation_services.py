"""The standard services of simulation_interfaces, if that package is installed.

Definitions 1.x (ROS 2 Jazzy) and 2.x are both accepted. Services that the installed definitions have are all answered:
served, or refused with the standard's code.
"""

from __future__ import annotations

import signal
from collections.abc import Awaitable
from functools import partial
from typing import Any

from rclpy.action import ActionServer, CancelResponse
from rclpy.node import Node

from smartmesh_ros.errors import InputError
from smartmesh_ros.node.inputs.optional_messages import find_interfaces
from smartmesh_ros.node.services.entity_services import EntityServices
from smartmesh_ros.node.services.standard import Standard
from smartmesh_ros.node.services.turns import Work, next_turn
from smartmesh_ros.node.services.world_services import WorldServices
from smartmesh_ros.node.session import REFUSED, Session

PACKAGE, STEPS = "simulation_interfaces", "simulate_steps"
# Features by the services, and the action, that have them.
FEATURES = {
    "SpawnEntity": ("SPAWNING", "SPAWNING_RESOURCE_STRING"),
    "SpawnEntities": ("SPAWNING_ENTITIES",),
    "DeleteEntity": ("DELETING",),
    "GetSpawnables": ("SPAWNABLES",),
    "GetNamedPoses": ("NAMED_POSES",),
    "GetEntities": ("ENTITY_BOUNDS_BOX", "ENTITY_TAGS", "ENTITY_CATEGORIES"),
    "GetEntityBounds": ("ENTITY_BOUNDS",),
    "GetEntityInfo": ("ENTITY_INFO_GETTING",),
    "SetEntityInfo": ("ENTITY_INFO_SETTING",),
    "GetEntityState": ("ENTITY_STATE_GETTING",),
    "SetEntityState": ("ENTITY_STATE_SETTING",),
    "ResetSimulation": (
        *("SIMULATION_RESET", "SIMULATION_RESET_TIME", "SIMULATION_RESET_STATE", "SIMULATION_RESET_SPAWNED"),
    ),
    "GetSimulationState": ("SIMULATION_STATE_GETTING",),
    "SetSimulationState": ("SIMULATION_STATE_SETTING", "SIMULATION_STATE_PAUSE"),
    "StepSimulation": ("STEP_SIMULATION_SINGLE", "STEP_SIMULATION_MULTIPLE"),
    "SimulateSteps": ("STEP_SIMULATION_ACTION",),
    "LoadWorld": ("WORLD_LOADING", "WORLD_RESOURCE_STRING"),
    "UnloadWorld": ("WORLD_UNLOADING",),
    "GetCurrentWorld": ("WORLD_INFO_GETTING",),
    "GetAvailableWorlds": ("AVAILABLE_WORLDS",),
}
_TRANSITION_REASONS = {
    "in_state": "ALREADY_IN_TARGET_STATE",
    "state": "STATE_TRANSITION_ERROR",
    "no_world": "INCORRECT_TRANSITION",
}


def serve_simulation_interfaces(session: Session, node: Any) -> None:
    """Create the services; log an error if the package is not installed. ``node``: the `TerrainCollider`, whose methods
    ``step``, ``reset`` and ``set_scene`` they call."""
    services = find_interfaces(PACKAGE, "srv")
    messages = find_interfaces(PACKAGE, "msg")
    if services is None or messages is None:
        session.node.get_logger().error(
            "simulation_interfaces: true has no effect: package simulation_interfaces is not installed; "
            "apt install ros-jazzy-simulation-interfaces"
        )
        return
    standard = Standard(session, services, messages)
    EntityServices(standard, node)
    WorldServices(standard, node)
    SimulationServices(standard, node)


class SimulationServices:
    """Serves the features and the states of the simulation, its steps, also by an action, and resets."""

    def __init__(self, standard: Standard, node: Any) -> None:
        self._standard, self._session, self._node = standard, standard.session, node
        self._states = standard.messages.SimulationState
        standard.serve("GetSimulatorFeatures", self._get_features)
        standard.serve("GetSimulationState", self._get_state)
        standard.serve("SetSimulationState", self._set_state, _TRANSITION_REASONS)
        standard.serve("StepSimulation", lambda request, _: self._step(request.steps))
        standard.serve("ResetSimulation", self._reset)
        action_node = standard.session.node
        self._actions: Any = find_interfaces(PACKAGE, "action") if isinstance(action_node, Node) else None
        if (kind := getattr(self._actions, "SimulateSteps", None)) is not None:
            ActionServer(
                action_node, kind, f"~/{STEPS}", lambda _: None, handle_accepted_callback=self._accept,
                cancel_callback=lambda _: CancelResponse.ACCEPT,
            )  # fmt: skip

    def _get_features(self, _: Any, response: Any) -> None:
        features = response.features
        kinds = self._standard.services, self._actions
        served = (names for service, names in FEATURES.items() if any(hasattr(kind, service) for kind in kinds))
        features.features = [getattr(features, name) for names in served for name in names]
        features.spawn_formats = ["urdf"]
        features.custom_info = (
            "smartmesh_ros terrain_collider. The state of tracked bodies cannot be set. Accelerations are not "
            "measured: they read zero, and are ignored when set. Worlds: .npy, .png, .tif, .asc, .yaml."
        )

    def _state(self) -> int:
        session, standard, states = self._session, self._standard, self._states
        if standard.loading:
            return int(states.STATE_LOADING_WORLD)
        if not session.paused:
            return int(states.STATE_PLAYING)
        if standard.unloaded and session.world.terrain.empty:
            return int(states.STATE_NO_WORLD)
        # Stepping or playing by another service since the stop has started the simulation again.
        stopped = standard.stopped and session.world.time == 0.0
        return int(states.STATE_STOPPED if stopped else states.STATE_PAUSED)

    def _get_state(self, _: Any, response: Any) -> None:
        response.state.state = self._state()

    def _set_state(self, request: Any, _: Any) -> None:
        states, wanted, now = self._states, request.state.state, self._state()
        if wanted == now:
            raise InputError("in_state", "the simulation is in this state already")
        if wanted == states.STATE_QUITTING:
            signal.raise_signal(signal.SIGINT)  # ends the node's loop once this call is answered
        elif wanted not in (states.STATE_PLAYING, states.STATE_PAUSED, states.STATE_STOPPED):
            raise InputError("state", f"state {wanted} cannot be set; use STOPPED, PLAYING, PAUSED or QUITTING")
        elif now not in (states.STATE_PLAYING, states.STATE_PAUSED, states.STATE_STOPPED):
            raise InputError("no_world", "there is no world now; load one, or publish a map")
        else:
            self._session.pacer.pause(wanted != states.STATE_PLAYING)
            self._standard.stopped = wanted == states.STATE_STOPPED
            if self._standard.stopped:
                self._start_over()

    def _step(self, count: int) -> Awaitable[None]:
        """Return the work of ``count`` steps in turns."""
        if self._state() != self._states.STATE_PAUSED:
            raise InputError("not_paused", "only a paused simulation can be stepped; set STATE_PAUSED first")
        work: Awaitable[None] = self._node.step(count)
        return work

    def _reset(self, request: Any, _: Any) -> None:
        scope = request.scope or request.SCOPE_ALL
        scopes = request.SCOPE_TIME, request.SCOPE_STATE, request.SCOPE_SPAWNED
        time, bodies, spawned = (bool(scope & one) for one in scopes)
        if not (time or bodies or spawned):
            raise InputError("unsupported", f"scope {scope} has none of the bits TIME, STATE and SPAWNED")
        if time and bodies and spawned:
            self._start_over()
        else:
            self._node.reset(time=time, bodies=bodies, spawned=spawned)

    def _start_over(self) -> None:
        self._node.reset(spawned=True)
        self._standard.infos.clear()

    def _accept(self, goal: Any) -> None:
        self._session.handled += 1
        self._session.turns.add(Work(self._run(goal)), lambda end: goal.execute(partial(self._conclude, *end)))

    async def _run(self, goal: Any) -> tuple[str, str]:
        """Do the steps of a goal of the action in turns, with feedback after each, until it is cancelled. Return how
        it ended, and why not well."""
        session, count, done = self._session, goal.request.steps, 0
        try:
            if not count:
                raise InputError("steps", "0 steps; ask for 1 or more")
            while done < count and not goal.is_cancel_requested:
                await self._step(1)
                done += 1
                counts = {"completed_steps": done, "remaining_steps": count - done}
                goal.publish_feedback(self._actions.SimulateSteps.Feedback(**counts))
                await next_turn()
            return ("succeed", "") if done == count else ("canceled", f"cancelled after {done} of {count} steps")
        except REFUSED as error:
            session.refusals.add(STEPS, error)
            return "abort", f"{error} ({done} of {count} steps are done)"

    def _conclude(self, end: str, words: str, goal: Any) -> Any:
        """Tell the client how its goal ended."""
        getattr(goal, end)()
        result, codes = self._actions.SimulateSteps.Result(), self._standard.messages.Result
        result.result.result = codes.RESULT_OPERATION_FAILED if words else codes.RESULT_OK
        result.result.error_message = words
        return result
