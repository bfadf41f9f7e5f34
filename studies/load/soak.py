"""``make soak``: runs the node for minutes or hours under constant changes, and looks for drifts of its figures.

Maps are resized, bodies spawned and removed, settings changed, sources killed and started again, and bad messages
mixed in. Sampled once a second: memory, file descriptors, real-time factor, and the latency of a service call.
"""

import subprocess
from collections import Counter, defaultdict
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from time import monotonic
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters
from rclpy.qos import QoSProfile
from smartmesh_msgs.msg import Heightmap, HeightmapUpdate, TrackedBodyArray
from smartmesh_msgs.srv import RemoveBody, SpawnBody
from visualization_msgs.msg import MarkerArray

from smartmesh_ros.startup.arguments import Parser, number
from smartmesh_ros.startup.dds import isolated_unless_chosen, use_large_message_profile
from smartmesh_ros.tools.demo.demo import SHAPES
from smartmesh_ros.tools.testing.process import Process
from studies.load.processes import COLLIDER, Usage, Watcher
from studies.load.study import PAGE, PICTURES
from studies.pages import fill, say, table

# How often things happen [s].
SOURCE_EVERY, SPAWN_EVERY, SETTING_EVERY, BAD_EVERY, SAMPLE_EVERY = 20.0, 2.0, 15.0, 0.5, 1.0
MOST_BODIES = 40
SIZES = (101, 201, 401, 1001)
FRICTIONS = (0.4, 0.6)


class Soak(Watcher):
    """Does things to the node and keeps its answers. ``samples``: a list for each figure. ``done``: what was done how
    often. ``missing``: number of bodies that the node did not have when it was to remove them."""

    def __init__(self, rng: np.random.Generator) -> None:
        super().__init__()
        self._rng = rng
        self.samples: defaultdict[str, list[float]] = defaultdict(list)
        self.done: Counter[str] = Counter()
        self.missing = 0
        self._spawner = self.create_client(SpawnBody, f"{COLLIDER}/spawn_body")
        self._remover = self.create_client(RemoveBody, f"{COLLIDER}/remove_body")
        self._setter = self.create_client(SetParameters, f"{COLLIDER}/set_parameters")
        self._maps = self.create_publisher(Heightmap, f"{COLLIDER}/heightmap", QoSProfile(depth=10))
        self._updates = self.create_publisher(HeightmapUpdate, f"{COLLIDER}/heightmap_update", 10)
        self.create_subscription(MarkerArray, f"{COLLIDER}/patches", lambda _: None, 10, raw=True)
        self.create_subscription(TrackedBodyArray, f"{COLLIDER}/body_states", self._on_states, 10)
        self.alive: list[str] = []
        self.seen: set[str] = set()
        self._count = 0

    def ready(self) -> bool:
        """Whether the node has a map, and hears what is sent: else the first bad messages and calls would go
        nowhere."""
        clients = (self._spawner, self._remover, self._setter)
        heard = self._maps.get_subscription_count() and self._updates.get_subscription_count()
        mapped = int(self.health.get("samples", 0)) > 0
        return bool(heard) and mapped and all(client.service_is_ready() for client in clients)

    def spawn(self) -> None:
        """Spawns a body, and removes the oldest where there are many."""
        self._count += 1
        name = f"body_{self._count}"
        request = SpawnBody.Request(id=name, mass=1.0, shape=SHAPES[self._count % len(SHAPES)])
        position = request.pose.position
        # Within the smallest map.
        position.x, position.y = self._rng.uniform(-3.0, 3.0, 2).tolist()
        position.z = 1.5
        if self.call(self._spawner, request).success:
            self.alive.append(name)
            self.done["spawned"] += 1
        if len(self.alive) > MOST_BODIES:
            removed = self.call(self._remover, RemoveBody.Request(id=self.alive.pop(0))).success
            self.done["removed"] += removed
            self.missing += not removed

    def change_setting(self) -> None:
        """Changes the friction of later bodies, as which the node takes all its settings anew."""
        value = ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=float(self._rng.choice(FRICTIONS)))
        request = SetParameters.Request(parameters=[Parameter(name="physics.friction", value=value)])
        if self.call(self._setter, request).results[0].successful:
            self.done["settings changed"] += 1

    def ping(self) -> float:
        """How long a refused call takes to come back [ms]."""
        start = monotonic()
        self.call(self._remover, RemoveBody.Request(id="nobody"))
        self.done["bad calls"] += 1
        return 1e3 * (monotonic() - start)

    def send_bad(self) -> None:
        """A message that must be refused."""
        if self._rng.random() < 0.5:
            message = Heightmap()
            message.info.width = message.info.height = 7
            self._maps.publish(message)
        else:
            self._updates.publish(HeightmapUpdate(x=2**31, width=1, height=1, heights=[0.0]))
        self.done["bad messages"] += 1

    def refused(self) -> int:
        """How often the node says that it refused something."""
        return sum(int(value) for key, value in self.health.items() if key.startswith("refused, "))

    def sample(self, usage: Usage, time: float) -> None:
        """Notes how the node is, at a ``time`` [s]."""
        memory, processes = usage.memory(), usage.processes()
        figures = {
            "time": time, "memory": memory["resident"] - memory["shared"],
            "descriptors": sum(process.num_fds() for process in processes),
            "threads": sum(process.num_threads() for process in processes),
            "topics": len(self.get_topic_names_and_types()),
            "factor": self.windows[-1].real_time_factor if self.windows else 0.0, "latency": self.ping(),
            "below": float(self.health.get("below ground", 0)),
        }  # fmt: skip
        for name, value in figures.items():
            self.samples[name].append(float(value))
        say(f"{len(self.alive)} bodies, {self.refused()} refused, {memory['resident']:.0f} MiB")

    def _on_states(self, message: TrackedBodyArray) -> None:
        self.seen = {body.id for body in message.bodies}


def source_parameters(rng: np.random.Generator) -> dict[str, Any]:
    """Terrain of another size than before, whole or in regions."""
    size = int(rng.choice(SIZES))
    return {
        "scene": str(rng.choice(["waves", "heave", "rut"])), "rows": size, "columns": size, "resolution": 0.1,
        "rate": 20.0, "mode": str(rng.choice(["full", "regions"])), "wave.amplitude": 0.1,
    }  # fmt: skip


def run(minutes: float) -> dict[str, Any]:
    """Soak a node for so long; return what was sampled, done and counted."""
    rng = np.random.default_rng(1)
    shown = {"publish.patches": 10.0, "publish.body_states": 10.0}
    with Process("terrain_collider", shown) as collider, Soak(rng) as node, ExitStack() as source:
        source.callback(Process("terrain_source", source_parameters(rng)).close)
        node.wait_for(node.ready, "map")
        usage = Usage(collider.process.pid)
        start = monotonic()

        def restart_source() -> None:
            source.close()
            # What was killed leaves its shared memory, in two hours more than many machines have.
            subprocess.run(["fastdds", "shm", "clean"], check=True, stdout=subprocess.DEVNULL)
            source.callback(Process("terrain_source", source_parameters(rng)).close)
            node.done["sources killed"] += 1

        actions: tuple[tuple[float, Callable[[], None]], ...] = (
            (SOURCE_EVERY, restart_source), (SPAWN_EVERY, node.spawn), (SETTING_EVERY, node.change_setting),
            (BAD_EVERY, node.send_bad), (SAMPLE_EVERY, lambda: node.sample(usage, monotonic() - start)),
        )  # fmt: skip
        due = [start if every < SOURCE_EVERY else start + every for every, _ in actions]
        while (now := monotonic()) < start + 60.0 * minutes and collider.process.poll() is None:
            for index, (every, act) in enumerate(actions):
                if now >= due[index]:
                    due[index] = now + every
                    act()
            node.spin(min(due) - monotonic())
        if collider.process.poll() is not None:
            raise RuntimeError(f"the node ended: {collider.output[-2000:]}")
        node.spin(3.0)
        return {
            "minutes": round(node.samples["time"][-1] / 60.0, 1), "samples": node.samples, "done": node.done,
            "refused": node.refused(), "lost": len(set(node.alive) - node.seen) + node.missing,
            "below_ground": int(node.health.get("below ground", 0)),
        }  # fmt: skip


def main(args: list[str] | None = None) -> None:
    """Runs the soak."""
    parser = Parser(description=__doc__)
    parser.add_argument("--minutes", type=number(float, 1.0, 1e5), default=10.0, help="how long; 120 = the long form")
    parser.add_argument("--document", action="store_true", help="write the table and the picture of the docs")
    options = parser.parse_args(args)
    use_large_message_profile()
    with isolated_unless_chosen():
        report(run(options.minutes), document=options.document)


# The start is left out: buffers grow to the largest map and message, and pools of colliders fill. Share of the time.
WARM_UP = 0.2
# Samples in a row are alike; the slope's error is that of the means of so many blocks.
BLOCKS = 12
FIGURES = {
    "memory": ("resident memory, without DDS's segments", "MiB"), "descriptors": ("file descriptors", ""),
    "threads": ("threads", ""), "topics": ("topics", ""), "latency": ("latency of a service call", "ms"),
    "factor": ("real-time factor", ""),
}  # fmt: skip


class Slope(NamedTuple):
    """Change per hour, its standard error, and the median."""

    per_hour: float
    error: float
    median: float


def slope_of(times: NDArray[np.float64], values: NDArray[np.float64]) -> Slope:
    """The line through the means of blocks, by least squares; ``times`` in seconds."""
    if not np.ptp(values):
        return Slope(0.0, 0.0, float(values[0]))  # and not what rounding leaves
    t, v = (np.array([block.mean() for block in np.array_split(each, BLOCKS)]) for each in (times / 3600.0, values))
    (per_hour, _), covariance = np.polyfit(t, v, 1, cov=True)
    return Slope(float(per_hour), float(np.sqrt(covariance[0, 0])), float(np.median(values)))


def is_flat(slope: Slope) -> bool:
    """Return True if a slope is within two standard errors of zero, or below a hundredth of the median an hour."""
    return abs(slope.per_hour) <= max(2.0 * slope.error, 0.01 * abs(slope.median))


def report(data: dict[str, Any], *, document: bool) -> None:
    """Print the table, and write it and the picture into the page if ``document``."""
    samples = {name: np.array(values) for name, values in data["samples"].items()}
    kept = samples["time"] >= WARM_UP * samples["time"].max()
    slopes = {name: slope_of(samples["time"][kept], samples[name][kept]) for name in FIGURES}
    rows = []
    for name, (what, unit) in FIGURES.items():
        s = slopes[name]
        rows.append([what, f"{s.median:.4g} {unit}", f"{s.per_hour:+.3g} {unit} ± {s.error:.2g}",
                     "flat" if is_flat(s) else "**changes**"])  # fmt: skip
    done = data["done"]
    words = (
        f"{data['minutes']:g} minutes: {done['sources killed']} sources killed and started with a map of another size, "
        f"{done['spawned']} bodies spawned and {done['removed']} removed, settings changed {done['settings changed']} "
        f"times. Bad messages and calls: {done['bad messages'] + done['bad calls']} sent, {data['refused']} refused by "
        f"the node's count. Bodies lost: {data['lost']} of {done['spawned']}; below the ground at the end: "
        f"{data['below_ground']}, at any sample at most {max(samples['below']):.0f}."
    )
    text = table(["figure", "median", "change per hour", ""], rows) + "\n\n" + words
    print(f"\n{text}")
    if document:
        _draw(samples, slopes, data["minutes"], PICTURES / "soak.png")
        fill(PAGE, {"soak": text})


def _draw(samples: dict[str, NDArray[np.float64]], slopes: dict[str, Slope], minutes: float, path: Path) -> None:
    figure = Figure(figsize=(11, 6), layout="constrained")
    axes = figure.subplots(2, 2, sharex=True)
    time = samples["time"] / 60.0
    for axis, name in zip(axes.flat, ("memory", "descriptors", "latency", "factor"), strict=True):
        what, unit = FIGURES[name]
        axis.plot(time, samples[name], linewidth=0.8, color="#084594")
        axis.axvspan(0.0, WARM_UP * time.max(), color="grey", alpha=0.15, label="not in the slope")
        s = slopes[name]
        axis.set_title(f"{what}: {s.per_hour:+.3g} ± {s.error:.2g} {unit} per hour", fontsize=10)
        axis.set_ylabel(f"{what}{f' [{unit}]' if unit else ''}", fontsize=8)
        axis.set_ylim(bottom=0.0)
        axis.grid(alpha=0.3)
    axes[0, 0].legend(fontsize=8)
    for axis in axes[1]:
        axis.set_xlabel("time [min]")
    figure.suptitle(f"The node while everything around it changes, {minutes:g} minutes")
    figure.savefig(path, dpi=110)
