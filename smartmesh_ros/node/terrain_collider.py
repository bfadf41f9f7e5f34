"""The node ``terrain_collider``: terrain and bodies in, collider patches out.

It takes a terrain as it deforms (heightmaps, grid maps, images, occupancy grids, point clouds, meshes, files) and the
poses of bodies (arrays, poses, odometry, TF frames), keeps a small collider patch under each body, steps the physics of
simulated bodies on those patches, and publishes patches, contacts, body states and timing. Topics and services are
private (~/heightmap, ~/patches, ...) and listed in the README; `ros2 node info /terrain_collider` shows them.
"""

from __future__ import annotations

from typing import Any

from rclpy.node import Node
from rclpy.parameter import Parameter
from smartmesh_msgs.srv import RemoveBody, SpawnBody, StepPhysics
from std_srvs.srv import SetBool, Trigger

from smartmesh_ros.errors import InputError
from smartmesh_ros.node import bounds, conversions, parameters
from smartmesh_ros.node.body_inputs import BodyInputs
from smartmesh_ros.node.helping import answer
from smartmesh_ros.node.publishing import Publishing
from smartmesh_ros.node.running import run
from smartmesh_ros.node.session import Session
from smartmesh_ros.node.spawning import spawn_from_text
from smartmesh_ros.node.terrain_inputs import TerrainInputs
from smartmesh_ros.physics.ground import require_usable
from smartmesh_ros.physics.urdf import checked_urdf

NAME = "terrain_collider"
MOST_STEPS = 100_000


class TerrainCollider(Node):
    """Converts messages, makes one call of the core, and publishes what the core made."""

    def __init__(self, **node_options: Any) -> None:
        super().__init__(NAME, **node_options)
        self.settings = parameters.declare(self)
        self.session = session = Session(self, self.settings)
        self.pacer, self.refusals = session.pacer, session.refusals
        self._waiting_spawns = list(self.settings.spawn)
        self._spawn_waiting()
        self._outputs = Publishing(session)
        self._terrain = TerrainInputs(session, self._on_terrain)
        self._bodies = BodyInputs(session)
        session.answer(SpawnBody, "spawn_body", self._on_spawn)
        session.answer(RemoveBody, "remove_body", self._on_remove)
        session.answer(StepPhysics, "step", self._on_step)
        session.answer(Trigger, "reset", self._on_reset)
        session.answer(SetBool, "pause", self._on_pause)
        self.add_on_set_parameters_callback(
            lambda changes: parameters.check_change(self, changes, self._check_settings)
        )
        self.add_post_set_parameters_callback(self._on_parameters_set)
        session.clock.on_set_back(self._forget_stamps)

    @property
    def handled(self) -> int:
        """Messages and calls handled so far."""
        return self.session.handled

    def tick(self, skipped: int = 0) -> None:
        """One physics step (none while paused), and whatever is due to be published.

        Simulated time goes on by the ``skipped`` steps before it; the bodies do not.
        """
        session = self.session
        with session.lock:
            self._bodies.refresh()
            session.tracking.expire(session.clock.pace())
            if session.paused:
                session.world.refresh()
            else:
                session.world.time += skipped * session.world.config.physics.dt
                session.world.step()
            session.note_lost()
            self._outputs.publish()

    def idle(self) -> None:
        """Publishes what is due, and no step, while ``/clock`` stands still."""
        with self.session.lock:
            self.session.world.refresh()
            self._outputs.publish()

    def destroy_node(self) -> None:
        """Ends the world with the node."""
        self.session.world.close()
        super().destroy_node()

    def _on_terrain(self) -> None:
        """Spawns what waited for ground."""
        if self._waiting_spawns:
            try:
                self._spawn_waiting()
            except InputError as error:
                self.session.refusals.add("bodies.spawn", error)

    def _spawn_waiting(self) -> None:
        """Spawns the bodies named by parameter, those that stand on the ground as soon as there is ground."""
        waiting, self._waiting_spawns = self._waiting_spawns, []
        for index, text in enumerate(waiting):
            try:
                if not spawn_from_text(self.session.world, text):
                    self._waiting_spawns.append(text)
            except InputError:
                self._waiting_spawns += waiting[index + 1 :]
                raise

    def _on_spawn(self, request: SpawnBody.Request) -> str:
        state = conversions.state_from(request.pose, request.twist)
        world = self.session.world
        bounds.require_name(request.id, self.settings)
        bounds.require_room([request.id], world.bodies, self.settings)
        if request.urdf:
            urdf = checked_urdf(request.urdf, bounds.urdf_rules(self.settings))
            world.spawn_robot(request.id, urdf, state)
        else:
            world.spawn(request.id, conversions.shape_from(request.shape), request.mass, state)
        return ""

    def _on_remove(self, request: RemoveBody.Request) -> str:
        session = self.session
        if request.id in session.tracking.names:
            session.tracking.forget(request.id)
        else:
            session.world.remove(request.id)
        return ""

    def _on_step(self, request: StepPhysics.Request) -> str:
        if not self.session.paused:
            raise InputError("not_paused", "the physics is running; call ~/pause with data: true first")
        if not 1 <= request.steps <= MOST_STEPS:
            raise InputError("steps", f"{request.steps} steps; ask for 1 to {MOST_STEPS} at a time")
        self.session.world.step(request.steps)
        self._outputs.publish(now=True)
        return ""

    def _on_reset(self, _: Trigger.Request) -> str:
        self.session.world.reset()
        self._forget_stamps()
        return "bodies are back where they were spawned"

    def _on_pause(self, request: SetBool.Request) -> str:
        self.session.paused = request.data
        self.pacer.restart()
        return "paused" if request.data else "running"

    def _forget_stamps(self) -> None:
        """Accepts whatever stamps come next, and starts the loop's beat anew."""
        self._terrain.forget_stamps()
        self._bodies.forget_stamps()
        self.pacer.restart()

    def _check_settings(self, settings: parameters.Settings) -> None:
        """Objects to settings that the terrain there is does not allow."""
        for mesh in self.session.world.terrain.tiles.values():
            require_usable(settings.world.patch, mesh)

    def _on_parameters_set(self, changes: list[Parameter]) -> None:
        names = {change.name for change in changes}
        if not names & {*parameters.NAMES, "use_sim_time"}:
            return
        session = self.session
        with session.lock:
            self.settings = session.settings = parameters.current_settings(self)
            session.world.configure(self.settings.world)
            for mesh in session.world.terrain.tiles.values():
                mesh.motion = self.settings.motion
            session.tracking.timeout = self.settings.body_timeout
            if names & {"physics.rate", "physics.deadline", "use_sim_time"}:
                session.take_pace()


def main(args: list[str] | None = None) -> None:
    """Runs the node until SIGINT or SIGTERM."""
    answer(NAME, __doc__, parameters.SPECS, args)
    run(TerrainCollider, args)
