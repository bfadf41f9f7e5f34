"""The cases of the load study, and what runs them: sends terrain to a node in a process of its own, and observes its
outputs."""

import math
from collections import deque
from dataclasses import dataclass, replace
from time import monotonic
from typing import Any, Literal

import numpy as np
from builtin_interfaces.msg import Time
from numpy.typing import NDArray
from rclpy.qos import QoSProfile
from smartmesh_msgs.msg import Heightmap, HeightmapUpdate, TrackedBody, TrackedBodyArray
from std_msgs.msg import Header
from visualization_msgs.msg import MarkerArray

from smartmesh_ros.node.outputs.cdr import floats
from smartmesh_ros.tools.messages import heightmap_message, pose_message
from smartmesh_ros.tools.testing.process import Process
from studies.load.processes import COLLIDER, Usage, Watcher

Mode = Literal["full", "regions"]

RESOLUTION = 0.1
# Distance of the bodies, and their radius [m].
SPACING, RADIUS = 0.45, 0.15
# The wave under them: amplitude [m], wave number [rad/m] and angular frequency [rad/s].
WAVE = (0.05, 1.0, 4.0)
# Width [m] and slope of the rim around the moving part. Bodies up to 1.4 m/s cannot cross it.
RIM, RIM_SLOPE = 0.4, 0.5
# The probe is a tracked body over flat ground that jumps between CODES heights, so that the markers identify the map:
# radius, height of the probe's centre, rise from code to code [m].
PROBE_RADIUS, PROBE_HEIGHT, CODES, RISE = 0.5, 0.375, 4, 0.25
# Speed above which ground counts as having jumped: above the wave's speed, below that of the jumps [m/s].
MAX_VELOCITY = 1.0


@dataclass(frozen=True, kw_only=True)
class Case:
    """One run: a map of ``side`` x ``side`` samples, ``bodies`` spheres, whole maps or regions at ``map_rate`` [Hz],
    physics at ``physics_rate`` [Hz] for ``seconds`` [s]. ``resting``: number of the bodies that lie on ground at rest;
    the others are on the moving part. ``markers``: whether they are listened to.
    """

    side: int
    bodies: int
    mode: Mode
    map_rate: float
    physics_rate: float
    markers: bool = True
    seconds: float = 6.0
    resting: int = 0

    @property
    def row(self) -> int:
        """Bodies on one side of the square that those on the moving part are spawned in."""
        return math.ceil(math.sqrt(self.bodies - self.resting))

    @property
    def window(self) -> int:
        """Samples on one side of the part of the map that moves, whose first sample is (0, 0)."""
        return 64 if self.row <= 10 else 192

    @property
    def probe(self) -> tuple[float, float]:
        """Where the probe is [m]: beside the bodies, within the window."""
        edge = (self.window - 1) * RESOLUTION
        return edge - 0.75, 0.5 * edge

    def parameters(self) -> dict[str, object]:
        """Parameters of the node."""
        moving = self.bodies - self.resting
        places = [(0.4 + SPACING * (i % self.row), 0.4 + SPACING * (i // self.row)) for i in range(moving)]
        side, first = math.ceil(math.sqrt(self.resting)), self.window * RESOLUTION + 2.0
        places += [(first + SPACING * (i % side), first + SPACING * (i // side)) for i in range(self.resting)]
        spawn = [
            f"{{id: ball_{i}, shape: sphere, size: [{RADIUS}], mass: 1.0, "
            f"xy: [{x:.2f}, {y:.2f}], above: {RADIUS + 0.02}}}"
            for i, (x, y) in enumerate(places)
        ]
        return {
            "physics.rate": self.physics_rate,
            # Those of each step, where there are few enough to listen to.
            "publish.patches": self.physics_rate if self.bodies <= 100 else 60.0,
            "terrain.max_velocity": MAX_VELOCITY,
            "bodies.spawn": spawn,
        }


def groups() -> dict[str, list[Case]]:
    """Return all cases by the table that they are in: the grid bodies x maps x rates, in which each axis is varied with
    the others at their middle values, and the corners of the targets are added; how memory grows with the map; and nine
    of ten bodies at rest."""
    middle = Case(side=1024, bodies=100, mode="regions", map_rate=60.0, physics_rate=240.0)
    many = replace(middle, bodies=1000, physics_rate=60.0)
    rest = replace(middle, bodies=1000, resting=900, markers=False)
    grid = [
        replace(middle, bodies=bodies, physics_rate=rate) for rate in (240.0, 60.0) for bodies in (1, 10, 100, 1000)
    ]
    for side in (256, 1024, 4096):
        rates = (10.0, 30.0, 60.0) if side < 4096 else (5.0,)
        grid += [replace(middle, side=side, mode="full", map_rate=rate) for rate in rates]
        grid += [replace(middle, side=side, map_rate=rate) for rate in (10.0, 30.0, 60.0)]
    grid += [replace(many, side=side) for side in (256, 4096)]
    grid += [replace(many, mode="full", map_rate=rate) for rate in (10.0, 30.0)]
    few = replace(middle, bodies=10, physics_rate=60.0, markers=False)
    memory = [replace(few, side=side, mode="full", map_rate=1.0) for side in (256, 4096)]
    memory.append(replace(few, side=8192, mode="full", map_rate=0.3, seconds=10.0))
    memory += [replace(few, side=side, map_rate=30.0) for side in (256, 4096, 8192, 16384)]
    more = replace(rest, bodies=5000, resting=4500, physics_rate=60.0, seconds=10.0)
    return {"grid": list(dict.fromkeys(grid)), "memory": memory, "rest": [rest, more]}


class TerrainMessages:
    """Maps and regions of a case; the k-th has the probe's ground at code ``k % CODES``. Each is valid until the next,
    because copies of large maps would take the driver longer than sending them."""

    def __init__(self, case: Case) -> None:
        side, window = case.side, case.window
        self._map = heightmap_message(np.zeros((side, side), "f4"), resolution=RESOLUTION)
        self._region = HeightmapUpdate(width=window, height=window, heights=floats(np.zeros((window, window), "f4")))
        self._region.header = self._map.header
        self._x, y = np.meshgrid(*[np.arange(window) * RESOLUTION] * 2)
        # Still at the window's edge, so that nothing tears, and higher there, so that nobody rolls off.
        room = np.minimum.reduce([self._x, y, self._x[::-1, ::-1], y[::-1, ::-1]])
        self._swell = WAVE[0] * np.clip(room / RIM, 0.0, 1.0)
        self._rim = RIM_SLOPE * np.maximum(RIM - room, 0.0)
        x, probe_y = case.probe
        self._flat = (np.abs(self._x - x) <= 0.65) & (np.abs(y - probe_y) <= 0.65)

    def heights(self, k: int, time: float) -> NDArray[np.float32]:
        """The part that moves (window, window) [m]."""
        wave = self._swell * np.sin(WAVE[1] * self._x - WAVE[2] * time)
        wave += self._rim
        wave[self._flat] = RISE * (k % CODES)
        return np.asarray(wave, np.float32)

    def message(self, k: int, time: float, stamp: Time, *, whole: bool) -> Heightmap | HeightmapUpdate:
        """The whole map, or the part that moves."""
        message, window = self._map if whole else self._region, len(self._x)
        side = message.info.width if whole else window
        np.frombuffer(message.heights, "f4").reshape(side, side)[:window, :window] = self.heights(k, time)
        message.header.stamp = stamp
        return message


# Time for the node to settle [s].
SETTLE = 2.0
# Longest time that bodies have to fall asleep [s].
FALL_ASLEEP = 60.0
# What the first map may take to arrive before it is sent again, for each of its samples: 27 s for 16384 x 16384 [s].
SECONDS_PER_SAMPLE = 1e-7


class Driver(Watcher):
    """Publishes on time and keeps what arrives."""

    def __init__(self, case: Case) -> None:
        super().__init__()
        self._case = case
        self._messages = TerrainMessages(case)
        self._maps = self.create_publisher(Heightmap, f"{COLLIDER}/heightmap", QoSProfile(depth=2))
        self._regions = self.create_publisher(HeightmapUpdate, f"{COLLIDER}/heightmap_update", 100)
        self._bodies = self.create_publisher(TrackedBodyArray, f"{COLLIDER}/tracked_bodies", 10)
        if case.markers:
            self.create_subscription(MarkerArray, f"{COLLIDER}/patches", self._on_markers, 10, raw=True)
        self.latencies: list[float] = []
        self.sent = 0
        self._sent_at: deque[tuple[int, float]] = deque(maxlen=CODES - 1)
        self._code = -1
        self._start = monotonic()

    def start(self) -> None:
        """Sends the first map until it is taken and every body stands on it."""
        self.wait_for(lambda: self._maps.get_subscription_count() and self._bodies.get_subscription_count(), "node")
        due = 0.0

        def settled() -> bool:
            nonlocal due
            if monotonic() >= due:
                due = monotonic() + max(2.0, SECONDS_PER_SAMPLE * self._case.side**2)
                self.send(whole=True)
                self._track_probe()
            return self.health.get("simulated") == str(self._case.bodies)

        self.wait_for(settled, "bodies")

    def run(self, seconds: float) -> None:
        """Sends terrain at the case's rate for so long."""
        case = self._case
        next_map = monotonic()
        next_probe, end = next_map, next_map + seconds
        while (now := monotonic()) < end:
            if now >= next_map:
                next_map = max(next_map + 1.0 / case.map_rate, now)
                self.send(whole=case.mode == "full")
            if now >= next_probe:
                next_probe = now + 0.2
                self._track_probe()
            self._executor.spin_once(timeout_sec=max(min(next_map, next_probe, end) - monotonic(), 0.0))

    def measure(self) -> dict[str, Any]:
        """Runs the case; what was sent, taken, seen and timed meanwhile."""
        self.run(SETTLE)
        end = monotonic() + FALL_ASLEEP
        while int(self.health.get("asleep", 0)) < self._case.resting and monotonic() < end:
            self.run(1.0)
        self._quiet()
        before, sent = self.taken(), self.sent
        self.windows.clear()
        self.latencies.clear()
        self.run(self._case.seconds)
        found = {"windows": list(self.windows), "latencies": list(self.latencies)}
        self._quiet()
        return {**found, "sent": self.sent - sent, "taken": self.taken() - before}

    def taken(self) -> int:
        """Maps and regions that the node has taken."""
        return int(self.health.get("updates of ''", 0))

    def send(self, *, whole: bool) -> None:
        """Sends the terrain as it is now."""
        now = monotonic()
        self._sent_at.append((self.sent, now))
        stamp = self.get_clock().now().to_msg()
        message = self._messages.message(self.sent, now - self._start, stamp, whole=whole)
        (self._maps if whole else self._regions).publish(message)
        self.sent += 1

    def _quiet(self) -> None:
        """Sends nothing until the diagnostics have counted everything."""
        for _ in range(2):
            self.health.clear()
            self.wait_for(lambda: self.health, "diagnostics")

    def _track_probe(self) -> None:
        x, y = self._case.probe
        probe = TrackedBody(id="probe", pose=pose_message((x, y, PROBE_HEIGHT)), radius=PROBE_RADIUS)
        self._bodies.publish(TrackedBodyArray(header=Header(frame_id="map"), bodies=[probe]))

    def _on_markers(self, data: bytes) -> None:
        """Notes when a code is first seen in the height of the probe's patch."""
        now = monotonic()
        numbers = np.frombuffer(data, "<f8", (len(data) - 4) // 8, 4)
        x, y = self._case.probe
        near = np.flatnonzero(np.abs(numbers[:-2] - x) < PROBE_RADIUS)
        near = near[np.abs(numbers[near + 1] - y) < PROBE_RADIUS]
        heights = numbers[near + 2] / RISE
        codes = {round(h) for h in heights.tolist() if -0.5 < h < CODES and abs(h - round(h)) < 0.02}
        if len(codes) != 1 or (code := codes.pop()) == self._code:
            return
        self._code = code
        self.latencies += [now - sent for k, sent in self._sent_at if k % CODES == code]


def run_case(case: Case) -> dict[str, Any]:
    """Run a case; return what was seen, and what the node took meanwhile: CPUs used, and memory [MiB]. Raises
    `RuntimeError` with the node's output if it fails."""
    with Process("terrain_collider", case.parameters()) as node, Driver(case) as driver:
        try:
            driver.start()
            usage, start = Usage(node.process.pid), monotonic()
            used = usage.cpu()
            found = driver.measure()
            cpus = (usage.cpu() - used) / (monotonic() - start)
        except Exception as error:
            raise RuntimeError(f"{case} failed: {node.output[-2000:]}") from error
        return {"case": case, **found, "cpus": cpus, "memory": usage.memory()}
