"""The node ``terrain_collider``: terrain and bodies in, contacts, body states and patches of the ground out.

It receives a deforming terrain (heightmaps, grid maps, images, occupancy grids, point clouds, meshes, files) and the
poses of bodies (arrays, poses, odometry, TF frames), steps the physics of simulated bodies, whose contacts come from
the map itself, and publishes contacts, body states, timing, and the patch of ground under each body. Topics and
services are private (~/heightmap, ~/patches, ...) and listed in docs/interface.md; `ros2 node info /terrain_collider`
shows them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from rclpy.parameter import Parameter
from rclpy.service_introspection import ServiceIntrospectionState
from smartmesh_msgs.srv import StepPhysics
from std_srvs.srv import SetBool, Trigger

from smartmesh_ros.errors import InputError, listed
from smartmesh_ros.io.rasters import Raster
from smartmesh_ros.node.fleet.peers import PeerBodies
from smartmesh_ros.node.inputs.body_inputs import BodyInputs
from smartmesh_ros.node.inputs.deck_inputs import DeckInputs
from smartmesh_ros.node.inputs.terrain_inputs import TerrainInputs
from smartmesh_ros.node.inputs.transform_input import TransformInput
from smartmesh_ros.node.outputs.publishing import Publishing
from smartmesh_ros.node.parameters import specifications as parameters
from smartmesh_ros.node.parameters.declaring import ParameterNode
from smartmesh_ros.node.parameters.helping import answer
from smartmesh_ros.node.parameters.settings import Settings
from smartmesh_ros.node.running import run
from smartmesh_ros.node.services.body_entries import Entry
from smartmesh_ros.node.services.body_services import BodyServices
from smartmesh_ros.node.services.ground_services import GroundServices
from smartmesh_ros.node.services.initial_bodies import InitialBodies, RobotDescription
from smartmesh_ros.node.services.simulation_services import serve_simulation_interfaces
from smartmesh_ros.node.services.state_services import StateServices
from smartmesh_ros.node.services.turns import next_turn, parts_of
from smartmesh_ros.node.session import SERVICES, Session
from smartmesh_ros.node.timing.pacing import NodeClock
from smartmesh_ros.node.transport import Clock, Transport
from smartmesh_ros.soil.config import soils_from
from smartmesh_ros.soil.soil import Soil
from smartmesh_ros.startup.dds import send_without_waiting
from smartmesh_ros.terrain.heightmap import HeightMap

NAME = "terrain_collider"
MOST_STEPS = 100_000
# Steps that a call does before the node takes messages, calls and signals again.
STEPS_A_TURN = 100
# What to do about bodies that start below the ground after a reset.
EPISODE = "~/start_episode also puts the ground back as it was at the start"


class Collider:
    """Converts messages to calls of the core, steps the physics and publishes the results, over any transport."""

    def __init__(self, node: Transport, settings: Settings, clock: Clock) -> None:
        self.settings = settings
        self.session = session = Session(node, settings, clock)
        self.pacer, self.refusals = session.pacer, session.refusals
        self.initial = InitialBodies(session)
        self.robot = RobotDescription(session, self.initial)
        self._peers = PeerBodies(session)
        self._transforms = transforms = TransformInput(session)
        self._outputs = Publishing(session, self._peers, transforms, lambda: self.initial.waiting)
        self._decks = DeckInputs(session, transforms)
        self._terrain = TerrainInputs(session, self._decks, self._on_terrain)
        self._bodies = BodyInputs(session, transforms)
        BodyServices(session)
        GroundServices(session, transforms)
        StateServices(session, self)
        session.serve(StepPhysics, "step", lambda request, _: self.step(request.steps))
        session.serve(Trigger, "reset", self._on_reset)
        session.serve(Trigger, "reset_terrain_clock", self._on_reset_terrain_clock)
        session.serve(SetBool, "pause", self._on_pause)
        if self.settings.simulation_interfaces:
            serve_simulation_interfaces(session, self)
        session.clock.on_set_back(self._forget_stamps)

    def tick(self, advance: Callable[[], int] = int) -> None:
        """Runs one physics step (none while paused), and publishes the outputs that are due. ``advance`` sets the next
        deadline, and returns for how many steps simulated time alone advances before this one."""
        session = self.session
        with session.lock:
            with session.enduring("inputs"):
                self._transforms.refresh()
                self._decks.refresh()
                self._peers.refresh()
                self._bodies.expire()
            if not session.paused:
                self._outputs.publish_patches()
            skipped = advance()  # until the step is done, the deadline is one step ahead of simulated time
            with session.enduring("physics"):
                if session.paused:
                    session.world.update()
                else:
                    session.world.skip(skipped)
                    session.world.step()
            session.note_lost(self.initial.names)
            self._outputs.publish()

    def turn(self) -> bool:
        """Does one turn of a long answer; returns False if there is none under way."""
        with self.session.enduring("services"):
            if not self.session.turns.advance():
                return False
        return True

    def idle(self) -> None:
        """Publishes the outputs that are due, without a step, while ``/clock`` stands still."""
        with self.session.lock:
            with self.session.enduring("physics"):
                self.session.world.update()
            self._outputs.publish(idle=True)

    def close(self) -> None:
        if session := getattr(self, "session", None):  # ROS 2 Kilted destroys nodes that could not start, too
            with session.enduring("services"):
                session.turns.close()
            session.files.close()
            session.world.close()

    async def step(self, count: int) -> None:
        """Runs ``count`` steps of the paused physics in turns, and publishes the last state; raises `InputError` if the
        physics is running, or another call ends the pause."""
        session = self.session
        for part in parts_of(count, STEPS_A_TURN):
            if part.start:
                await next_turn()
            with session.lock:
                if not session.paused:
                    done = f"; {part.start} of {count} steps are done" if part.start else ""
                    words = "the physics is running; pause it first"
                    raise InputError("not_paused", f"{words}{done}")
                if not 1 <= count <= MOST_STEPS:
                    raise InputError("steps", f"{count} steps; ask for 1 to {MOST_STEPS} at a time")
                session.world.step(part.stop - part.start)
        with session.lock:
            self._outputs.publish(now=True)

    def reset(self, *, time: bool = True, bodies: bool = True, spawned: bool = False) -> list[str]:
        """Resets the simulation: simulated ``time`` to zero, ``bodies`` to their initial states. Returns which of them
        start below the ground, because it has risen since they were spawned.

        ``spawned``: also removes simulated bodies that are no initial ones and, in a full reset, restores those.
        """
        session, world, below = self.session, self.session.world, list[str]()
        if spawned:
            for body in list(world.bodies.values()):
                if body.simulated and body.name not in self.initial.names:
                    world.remove(body.name)
        if time:
            world.reset_time()
            self._forget_stamps()
        if bodies:
            world.reset_bodies()
            there = [] if world.terrain.empty else [body for body in world.bodies.values() if body.simulated]
            below = [words for body in there if (words := session.start_of(body.name, body.initial, cure=EPISODE))]
            self.initial.restore(session.lost)
            session.lost.clear()
        if time and bodies and spawned:
            self.initial.restore()
        return below

    def start_episode(self, seed: int) -> None:
        """Begins an episode: everything is as at the start, and whatever is random by the ``seed``."""
        self.session.world.reset(seed)
        self.take_restored()
        self.initial.restore()

    def set_scene(self, raster: Raster | None, entries: Mapping[str, Entry]) -> None:
        """Replaces all ground (None = by nothing) and bodies, at time zero and paused. Topics go on from there."""
        self.pacer.pause(True)
        self.session.world.clear()
        self._terrain.clear()
        self.take_restored()
        self.initial.start_over(entries)
        if raster is not None:
            self._terrain.load(raster)
        self.initial.on_terrain()

    def take_restored(self) -> None:
        """Goes on after the world was replaced by another one."""
        session = self.session
        session.tracking.take(session.awake())
        session.lost.clear()
        self._decks.take_restored()
        self._stand_on_soil()
        self._forget_stamps()

    def _on_reset(self, _: Trigger.Request, response: Trigger.Response) -> None:
        response.message = listed(["bodies are back where they were spawned", *self.reset()], between="; ")

    def _on_reset_terrain_clock(self, _: Trigger.Request, response: Trigger.Response) -> None:
        self._terrain.forget_stamps()
        response.message = "the next map may have any stamp, as the first one; bodies stay where they are"

    def _on_pause(self, request: SetBool.Request, response: SetBool.Response) -> None:
        self.pacer.pause(request.data)
        response.message = "paused" if request.data else "running"

    def _forget_stamps(self) -> None:
        """Accepts any stamps from now on, and restarts the loop's deadlines."""
        session = self.session
        with session.lock:
            self._terrain.forget_stamps()
            self._transforms.forget_stamps()
            for clocks in session.source_clocks:
                clocks.clear()
            for followed in (session.tracking, self._peers):
                followed.restart(session.awake())
            self.pacer.restart()

    def _on_terrain(self) -> None:
        self._stand_on_soil()
        self.initial.on_terrain()

    def _stand_on_soil(self) -> None:
        """Lets bodies stand on the soil of the settings if the first tile is a height map that can be soil, else on the
        map itself. The soil of a tile keeps its prints."""
        world, settings = self.session.world, self.settings
        tile, known = world.terrain.tiles.get(""), world.ground.soil
        if not settings.soil or not isinstance(tile, HeightMap):
            if known is not None:
                world.ground.set_soil(None)
        elif isinstance(known, Soil) and known.map is tile and known.soils == soils_from(settings.soil):
            known.slip_sinkage = settings.slip_sinkage
        else:
            try:
                world.ground.set_soil(Soil(world.terrain, settings.soil, slip_sinkage=settings.slip_sinkage))
            except InputError as error:
                self.refusals.add("soil.type", error)

    def configure(self, settings: Settings, names: set[str]) -> None:
        """Replaces the settings, in which the parameters ``names`` have changed."""
        session = self.session
        with session.lock:
            self.settings = session.settings = settings
            session.world.configure(self.settings.world)
            for mesh in session.world.terrain.meshes:
                mesh.motion = self.settings.motion
            self._stand_on_soil()
            session.tracking.timeout, session.tracking.max_velocity = settings.body_timeout, settings.max_velocity
            if names & {"physics.rate", "physics.deadline", "use_sim_time"}:
                session.configure_pacer()
            if "publish.clock" in names:  # stamps are simulated times from now on, or no longer
                self._forget_stamps()


class TerrainCollider(ParameterNode, Collider):
    """The collider as a node of rclpy, with parameters, which is its own transport."""

    def __init__(self, **node_options: Any) -> None:
        super().__init__(NAME, parameters.SPECS, **node_options)
        Collider.__init__(self, self, parameters.current_settings(self), NodeClock(self))
        self.add_post_set_parameters_callback(self._on_parameters_set)
        parameters.announce(self, self.settings)

    def require_together(self, new: Mapping[str, Any]) -> None:
        """Raise `InputError` if the settings with these ``new`` values of parameters are impossible."""
        parameters.current_settings(self, new)

    def create_service(self, *arguments: Any, **options: Any) -> Any:
        """Create a service like rclpy, with the introspection that the parameter gives it."""
        service = super().create_service(*arguments, **options)
        kind = self.settings.service_introspection if hasattr(self, "settings") else "disabled"
        if kind != "disabled":
            service.configure_introspection(
                self.get_clock(), SERVICES, getattr(ServiceIntrospectionState, kind.upper())
            )
        return service

    def destroy_node(self) -> None:
        """Clears the patches that viewers show, closes the world, and destroys the node."""
        if outputs := getattr(self, "_outputs", None):
            outputs.close()
        self.close()
        super().destroy_node()

    def _on_parameters_set(self, changes: list[Parameter]) -> None:
        names = {change.name for change in changes}
        if not names & {*parameters.NAMES, "use_sim_time"}:
            return
        before, new = self.values, {change.name: change.value for change in changes if change.name in parameters.NAMES}
        self.values = before | new
        self.configure(parameters.current_settings(self), names)
        parameters.announce_changes(self, before, self.values)


def main(args: list[str] | None = None) -> None:
    answer(NAME, __doc__, parameters.SPECS, args)
    send_without_waiting()
    run(TerrainCollider, args)
