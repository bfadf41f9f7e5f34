"""The node ``terrain_collider``: terrain and bodies in, collider patches out."""

from __future__ import annotations

from collections.abc import Callable
from time import monotonic
from typing import Any

from geometry_msgs.msg import PoseArray
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from smartmesh_msgs.msg import Heightmap, HeightmapUpdate, TrackedBodyArray
from smartmesh_msgs.srv import RemoveBody, SpawnBody, StepPhysics
from std_msgs.msg import Header
from std_srvs.srv import SetBool, Trigger

from smartmesh_ros.errors import InputError
from smartmesh_ros.node import conversions, parameters
from smartmesh_ros.node.pacing import Pacer, StampClock
from smartmesh_ros.node.publishing import Publishing
from smartmesh_ros.node.refusals import Refusals
from smartmesh_ros.node.running import run
from smartmesh_ros.node.spawning import spawn_from_text
from smartmesh_ros.physics.tracking import Tracking
from smartmesh_ros.physics.world import World
from smartmesh_ros.terrain.heightmap import HeightMap

NAME = "terrain_collider"
# Frame of a terrain whose first map names none.
DEFAULT_FRAME = "map"
MOST_STEPS = 100_000
BEST_EFFORT = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)


class TerrainCollider(Node):
    """Converts messages, makes one call of the core, and publishes what the core made."""

    def __init__(self, **node_options: Any) -> None:
        super().__init__(NAME, **node_options)
        self.settings = parameters.declare(self)
        self.world = World(config=self.settings.world)
        self.paused = False
        self.refusals = Refusals(self.get_logger())
        self.pacer = Pacer(self.settings.world.physics.dt)
        self._outputs = Publishing(self, self.world, self.pacer, self.refusals, self.settings.publish)
        self._outputs.frame_id = self.settings.frame_id
        self._tracking = Tracking(self.world, self.settings.body_timeout)
        self._map_clocks: dict[str, StampClock] = {}
        self._body_clocks = {"tracked_bodies": StampClock(), "body_poses": StampClock()}
        self._waiting_spawns = list(self.settings.spawn)
        self._poses_tracked: set[str] = set()
        self.add_on_set_parameters_callback(lambda changes: parameters.check_change(self, changes))
        self.add_post_set_parameters_callback(self._on_parameters_set)
        self._subscribe()
        self._serve()
        self._spawn_waiting()

    # ---- wiring ----

    def _subscribe(self) -> None:
        durability = DurabilityPolicy[self.settings.durability.upper()]
        maps = QoSProfile(depth=2, history=HistoryPolicy.KEEP_LAST, durability=durability)
        regions = QoSProfile(depth=100, durability=durability)
        self._input(Heightmap, "heightmap", self._on_map, maps)
        self._input(HeightmapUpdate, "heightmap_update", self._on_region, regions)
        self._input(TrackedBodyArray, "tracked_bodies", self._on_bodies, BEST_EFFORT)
        self._input(PoseArray, "body_poses", self._on_poses, BEST_EFFORT)
        self._input(JointState, "joint_commands", self._on_joint_commands, BEST_EFFORT)

    def _input(self, kind: Any, topic: str, take: Callable[[Any], None], qos: QoSProfile) -> None:
        def callback(message: Any) -> None:
            try:
                take(message)
            except InputError as error:
                self.refusals.add(topic, error)

        self.create_subscription(kind, f"~/{topic}", callback, qos)

    def _serve(self) -> None:
        self.create_service(SpawnBody, "~/spawn_body", self._answering("spawn_body", self._on_spawn))
        self.create_service(RemoveBody, "~/remove_body", self._answering("remove_body", self._on_remove))
        self.create_service(StepPhysics, "~/step", self._answering("step", self._on_step))
        self.create_service(Trigger, "~/reset", self._answering("reset", self._on_reset))
        self.create_service(SetBool, "~/pause", self._answering("pause", self._on_pause))

    def _answering(self, name: str, act: Callable[[Any], str]) -> Callable[[Any, Any], Any]:
        def callback(request: Any, response: Any) -> Any:
            try:
                response.message = act(request)
                response.success = True
            except InputError as error:
                self.refusals.add(name, error)
                response.message = str(error)
                response.success = False
            return response

        return callback

    # ---- inputs ----

    def _on_map(self, message: Heightmap) -> None:
        with self.world.stopwatch.stage("ingest"):
            stamp = conversions.stamp_seconds(message.header.stamp)
            frame = self._terrain_frame(message.header.frame_id)
            new = conversions.map_from(message, self.settings.max_samples)
            clock = self._map_clocks.get(message.tile) or StampClock()
            time = clock.place(stamp, self._clock_now(), self._time_now())
            known = self.world.terrain.tiles.get(message.tile)
            if known is not None and known.geometry == new.geometry:
                known.replace(new.heights, time=time, velocities=new.velocities)
            else:
                tile = HeightMap(
                    new.heights,
                    geometry=new.geometry,
                    time=time,
                    velocities=new.velocities,
                    motion=self.settings.motion,
                )
                self.world.terrain.put(message.tile, tile)
            self._took_map(message.tile, clock, stamp, time, frame)

    def _on_region(self, message: HeightmapUpdate) -> None:
        with self.world.stopwatch.stage("ingest"):
            stamp = conversions.stamp_seconds(message.header.stamp)
            if not self.world.terrain.tiles:
                raise InputError("no_map", "an update came before any map; publish the whole map on ~/heightmap first")
            tile = self.world.terrain.tile(message.tile)
            frame = self._terrain_frame(message.header.frame_id)
            new = conversions.region_from(message, self.settings.max_samples)
            clock = self._map_clocks[message.tile]
            time = clock.place(stamp, self._clock_now(), self._time_now())
            tile.update_region(new.row, new.column, new.heights, time=time, velocities=new.velocities)
            self._took_map(message.tile, clock, stamp, time, frame)

    def _took_map(self, tile: str, clock: StampClock, stamp: float | None, time: float, frame: str) -> None:
        clock.accept(stamp, time)
        self._map_clocks[tile] = clock
        self._outputs.frame_id = frame
        self._outputs.map_taken = monotonic()
        if self._waiting_spawns:
            self._spawn_waiting()

    def _on_bodies(self, message: TrackedBodyArray) -> None:
        self._track("tracked_bodies", message.header, conversions.bodies_from(message))

    def _on_poses(self, message: PoseArray) -> None:
        bodies = conversions.poses_from(message)
        self._track("body_poses", message.header, bodies)
        names = {body.name for body in bodies}
        for name in self._poses_tracked - names:
            self._tracking.forget(name)
        self._poses_tracked = names

    def _track(self, topic: str, header: Header, bodies: list[conversions.BodyInput]) -> None:
        stamp = conversions.stamp_seconds(header.stamp)
        self._require_frame(header.frame_id)
        clock = self._body_clocks[topic]
        time = clock.place(stamp, self._clock_now(), monotonic())
        simulated = {name for name, body in self.world.bodies.items() if not body.tracked}
        for body in bodies:
            if body.name in simulated:
                raise InputError("duplicate_id", f"{body.name!r} is simulated; a tracked body needs another name")
        for body in bodies:
            self._tracking.update(body.name, body.radius or self.settings.default_radius, body.state, time)
        clock.accept(stamp, time)

    def _on_joint_commands(self, message: JointState) -> None:
        """Velocity commands: names are ``<robot>/<joint>``; efforts, where given, bound the force."""
        if len(message.velocity) != len(message.name) or len(message.effort) not in (0, len(message.name)):
            raise InputError("length", "joint commands need one velocity for each name, and as many efforts or none")
        for index, name in enumerate(message.name):
            robot, _, joint = name.partition("/")
            if message.effort:
                self.world.drive(robot, joint, message.velocity[index], message.effort[index])
            else:
                self.world.drive(robot, joint, message.velocity[index])

    # ---- services ----

    def _on_spawn(self, request: SpawnBody.Request) -> str:
        state = conversions.state_from(request.pose, request.twist)
        if request.urdf:
            self.world.spawn_robot(request.id, request.urdf, state)
        else:
            self.world.spawn(request.id, conversions.shape_from(request.shape), request.mass, state)
        return ""

    def _on_remove(self, request: RemoveBody.Request) -> str:
        if request.id in self._tracking.names:
            self._tracking.forget(request.id)
        else:
            self.world.remove(request.id)
        return ""

    def _on_step(self, request: StepPhysics.Request) -> str:
        if not self.paused:
            raise InputError("not_paused", "the physics is running; call ~/pause with data: true first")
        if not 1 <= request.steps <= MOST_STEPS:
            raise InputError("steps", f"{request.steps} steps; ask for 1 to {MOST_STEPS} at a time")
        self.world.step(request.steps)
        self._outputs.publish(now=True)
        return ""

    def _on_reset(self, _: Trigger.Request) -> str:
        self.world.reset()
        self._map_clocks = {tile: StampClock() for tile in self.world.terrain.tiles}
        self._body_clocks = {topic: StampClock() for topic in self._body_clocks}
        self.pacer.restart()
        return "bodies are back where they were spawned"

    def _on_pause(self, request: SetBool.Request) -> str:
        self.paused = self._outputs.paused = request.data
        self.pacer.restart()
        return "paused" if self.paused else "running"

    def _on_parameters_set(self, changes: list[Parameter]) -> None:
        if not any(parameter.name in {spec.name for spec in parameters.SPECS} for parameter in changes):
            return
        self.settings = parameters.current_settings(self)
        self.world.configure(self.settings.world)
        for tile in self.world.terrain.tiles.values():
            tile.motion = self.settings.motion
        self._tracking.timeout = self.settings.body_timeout
        self._outputs.rates = self.settings.publish
        self.pacer.period = self.settings.world.physics.dt

    # ---- the loop ----

    def tick(self) -> None:
        """One physics step (none while paused), and whatever is due to be published."""
        self._tracking.expire(monotonic())
        if self.paused:
            self.world.refresh()
        else:
            self.world.step()
        self._outputs.publish()

    def destroy_node(self) -> None:
        """Ends the world with the node."""
        self.world.close()
        super().destroy_node()

    # ---- helpers ----

    def _spawn_waiting(self) -> None:
        """Spawns the bodies named by parameter, those that stand on the ground as soon as there is ground."""
        self._waiting_spawns = [text for text in self._waiting_spawns if not spawn_from_text(self.world, text)]

    def _clock_now(self) -> float:
        return float(self.get_clock().now().nanoseconds) * 1e-9

    def _time_now(self) -> float:
        """Simulated time at this instant: that of the next step, less what is left until it is due."""
        return self.world.time if self.paused else self.world.time - min(self.pacer.remaining(), self.pacer.period)

    def _terrain_frame(self, frame_id: str) -> str:
        """The terrain's frame once a map in ``frame_id`` is taken."""
        self._require_frame(frame_id)
        return self._outputs.frame_id or frame_id or DEFAULT_FRAME

    def _require_frame(self, frame_id: str) -> None:
        known = self._outputs.frame_id
        if known and frame_id and frame_id != known:
            raise InputError("frame", f"frame {frame_id!r} is not the terrain's frame {known!r}")


def main(args: list[str] | None = None) -> None:
    """Runs the node until SIGINT or SIGTERM."""
    run(TerrainCollider, args)
