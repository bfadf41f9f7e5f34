"""The services of simulation_interfaces for entities, which are the bodies of the world, including tracked bodies.

Only URDF robots can be spawned.
"""

from __future__ import annotations

from itertools import chain, count
from typing import Any

from geometry_msgs.msg import Vector3

from smartmesh_ros.errors import InputError
from smartmesh_ros.ground.state import BodyState
from smartmesh_ros.ground.transform import Transform, fixed_to
from smartmesh_ros.node.inputs import conversions
from smartmesh_ros.node.outputs.body_outputs import pose_message, twist_message
from smartmesh_ros.node.outputs.cdr import xyz
from smartmesh_ros.node.parameters.settings import LONGEST_NAME
from smartmesh_ros.node.services.entities import own_bounds, select
from smartmesh_ros.node.services.files import allowed_folders, files_in, robot_name
from smartmesh_ros.node.services.standard import Standard, tagged
from smartmesh_ros.node.session import REFUSED, require_name
from smartmesh_ros.world.bodies import Body
from smartmesh_ros.world.link_frames import frame_state
from smartmesh_ros.world.paths import expanded
from smartmesh_ros.world.robots.description import urdf_text

_POSE_REASONS = dict.fromkeys(("frame", "non_finite", "quaternion", "position"), "INVALID_POSE")
_SPAWN_REASONS = {
    "duplicate_id": "NAME_NOT_UNIQUE",
    "empty_id": "NAME_INVALID",
    "name": "NAME_INVALID",
    "urdf_format": "UNSUPPORTED_FORMAT",
    "no_resource": "NO_RESOURCE",
    "urdf": "RESOURCE_PARSE_ERROR",
    "urdf_package": "MISSING_ASSETS",
    "no_asset": "MISSING_ASSETS",
    "asset": "UNSUPPORTED_ASSETS",
    **_POSE_REASONS,
}
# Tag of the places where bodies of parameters and worlds start.
START_TAG = "start"
# The standard's name of a simulator's own frame: here that of the terrain, whatever its name.
GLOBAL = "world"


class EntityServices:
    """Answers each service from the world. ``node``: the collider, whose ``initial`` bodies give the named poses."""

    def __init__(self, standard: Standard, node: Any) -> None:
        self._standard, self._session, self._node = standard, standard.session, node
        self._messages = standard.messages
        serve = standard.serve
        serve("SpawnEntity", self._spawn, _SPAWN_REASONS)
        serve("SpawnEntities", self._spawn_all, {"entities": "ENTITIES_SPAWN_FAILED"})
        serve("DeleteEntity", self._delete)
        serve("GetSpawnables", self._get_spawnables)
        serve("GetNamedPoses", self._get_poses)
        serve("GetNamedPoseBounds", self._get_pose_bounds)
        serve("GetEntities", self._get_entities)
        serve("GetEntitiesStates", self._get_entities_states)
        serve("GetEntityBounds", self._get_bounds)
        serve("GetEntityInfo", self._get_info)
        serve("SetEntityInfo", self._set_info)
        serve("GetEntityState", lambda asked, found: self._write_state(asked.entity, found.state))
        serve("SetEntityState", self._set_state, _POSE_REASONS)

    async def _spawn(self, request: Any, response: Any) -> None:
        session = self._session
        given = _urdf_of(getattr(request, "entity_resource", request))
        if request.entity_namespace:
            raise InputError("unsupported", "entity_namespace is not supported; leave it empty")
        state = self._placed(request.initial_pose.header, conversions.state_from(request.initial_pose.pose))
        robot = await session.files.prepared(given, session.settings)
        name = request.name or robot_name(urdf_text(robot.given))
        with session.lock:
            if request.allow_renaming:
                name = self._free_name(name)
            require_name(name)
            session.require_room([name])
            session.world.spawn_robot(name, robot, state)
            body = session.world.bodies[name]
            body.initial = fixed_to(state, body.inertial)  # the pose is that of the base link
            session.world.move(name, fixed_to(state, body.centre))
            session.start_of(name, body.initial)
        response.entity_name = name

    async def _spawn_all(self, request: Any, response: Any) -> None:
        failed = 0
        for wanted in request.spawn_requests:
            result, outcome = self._messages.SpawnResult(), None
            try:
                await self._spawn(wanted, result)
            except REFUSED as error:
                failed, outcome = failed + 1, error
            self._standard.conclude(_SPAWN_REASONS, result, outcome)
            response.results.append(result)
        if failed:
            raise InputError("entities", f"{failed} of {len(response.results)} entities are not spawned; see results")

    def _free_name(self, wanted: str) -> str:
        """Return a name that no body has: the one that is ``wanted``, or else its beginning with a number."""
        wanted = wanted.replace("/", "_") or "entity"
        ends = (f"_{number}" for number in count(1))
        names = chain([wanted], (wanted[: LONGEST_NAME - len(end)] + end for end in ends))
        return next(name for name in names if name not in self._session.world.bodies)

    def _delete(self, request: Any, _: Any) -> None:
        self._session.remove(request.entity)
        self._standard.infos.pop(request.entity, None)

    async def _get_spawnables(self, request: Any, response: Any) -> None:
        sources, settings = list(request.sources), self._session.settings
        found, wrong = await self._session.files.done(
            lambda: files_in(allowed_folders(settings), sources, (".urdf",), settings)
        )
        for path in found:
            response.spawnables.append(self._messages.Spawnable(description=path.stem))
            item = response.spawnables[-1]
            getattr(item, "entity_resource", item).uri = path.as_uri()
        response.result.error_message = "; ".join(wrong)

    def _get_poses(self, request: Any, response: Any) -> None:
        scene = self._node.initial.names if tagged([START_TAG], request.tags) else ()
        for name, body in self._session.world.bodies.items():
            if name in scene:
                found = self._messages.NamedPose(name=name, description=f"where {name} starts", tags=[START_TAG])
                found.pose = pose_message(frame_state(body.initial, body.inertial))
                response.poses.append(found)

    def _get_pose_bounds(self, _: Any, __: Any) -> None:
        raise InputError("unsupported", "named poses have no bounds here")

    def _get_entities(self, request: Any, response: Any) -> None:
        response.entities = select(self._session.world, request.filters, self._info_of)

    def _get_entities_states(self, request: Any, response: Any) -> None:
        self._get_entities(request, response)
        for name in response.entities:
            response.states.append(self._messages.EntityState())
            self._write_state(name, response.states[-1])

    def _get_bounds(self, request: Any, response: Any) -> None:
        body = self._session.world.body(request.entity)
        low, high = (xyz(Vector3, corner) for corner in own_bounds(body))
        response.bounds.type, response.bounds.points = response.bounds.TYPE_BOX, [high, low]

    def _get_info(self, request: Any, response: Any) -> None:
        response.info = self._info_of(self._session.world.body(request.entity))

    def _set_info(self, request: Any, _: Any) -> None:
        name = self._session.world.body(request.entity).name
        category = request.info.category
        known = [value for key, value in vars(type(category)).items() if key.startswith("CATEGORY_")]
        if category.category not in known:
            raise InputError("category", f"there is no category {category.category}")
        self._standard.infos[name] = request.info

    def _info_of(self, body: Body) -> Any:
        """Return what was set of a body, or else what the node knows of it."""
        if body.name in self._standard.infos:
            return self._standard.infos[body.name]
        info = self._messages.EntityInfo()
        category = info.category
        category.category = category.CATEGORY_ROBOT if body.is_robot else category.CATEGORY_OBJECT
        info.description = "its pose is dictated by a topic" if body.tracked else "simulated"
        return info

    def _write_state(self, name: str, message: Any) -> None:
        session = self._session
        state = session.world.base_state(name)
        message.header.stamp, message.header.frame_id = session.stamp_now(), session.frame_id
        message.pose, message.twist = pose_message(state), twist_message(state)

    def _set_state(self, request: Any, _: Any) -> None:
        world, name = self._session.world, request.entity
        now, wanted = world.base_state(name), request.state
        given = self._placed(wanted.header, conversions.state_from(wanted.pose, wanted.twist))
        if not getattr(request, "set_pose", True):
            given = BodyState(now.position, now.orientation, given.linear, given.angular)
        if not getattr(request, "set_twist", True):
            given = BodyState(given.position, given.orientation, now.linear, now.angular)
        if world.bodies[name].fixed and any((*given.linear, *given.angular)):
            raise InputError("fixed", f"the base of {name!r} is fixed and takes no velocity; leave the twist at zero")
        world.move(name, fixed_to(given, world.bodies[name].centre))

    def _placed(self, header: Any, state: BodyState) -> BodyState:
        """Return a state that is given in the frame of a header, of the terrain or of a body, in the terrain's frame.
        Raises `InputError`."""
        session, frame = self._session, header.frame_id
        if frame == session.frame_id or frame not in session.world.bodies:
            if frame != GLOBAL:
                session.require_frame(frame)
            return state
        return Transform.of(session.world.base_state(frame)).apply(state)


def _urdf_of(resource: Any) -> str:
    """Return a resource's URI, or else its URDF text. Raises `InputError` if neither is URDF."""
    urdf = str(resource.uri or resource.resource_string)
    if not urdf:
        raise InputError("no_resource", "both uri and resource_string are empty; give a URDF file or its text")
    if not resource.uri:
        robot_name(urdf)  # must be URDF
    elif not str(expanded(urdf)).endswith(".urdf"):
        raise InputError("urdf_format", f"{urdf!r} does not end in .urdf, the only supported format")
    return urdf
