"""The tab with the node's state and controls."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from queue import SimpleQueue
from time import monotonic
from typing import Any

import numpy as np
from shape_msgs.msg import SolidPrimitive
from viser import uplot

from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.tools.client.remote import Remote
from smartmesh_ros.tools.messages import pose_message
from smartmesh_ros.tools.view.camera import Cameras
from smartmesh_ros.tools.view.looks import Legend, PatchLook
from smartmesh_ros.tools.view.scene import Scene
from smartmesh_ros.tools.view.terrain_scene import Depth, Give, Grip

# Time over which missed deadlines are counted [s].
WINDOW = 10.0
SELECT = "shows what it is"
# What a click spawns: kind, dimensions in sizes, and volume in cubes of the size.
SPAWNS = {
    "spawns a ball": (SolidPrimitive.SPHERE, [0.5], 0.52),
    "spawns a box": (SolidPrimitive.BOX, [1.2, 0.8, 0.6], 0.58),
    "spawns a cylinder": (SolidPrimitive.CYLINDER, [0.8, 0.5], 0.63),
}
# Height of a spawned body above the ground, in sizes, and its density [kg/m^3], that of wood.
ABOVE, DENSITY = 1.5, 600.0
# Time span of the chart and period of its refreshes [s].
MINUTE, PERIOD = 60.0, 1.0
# Stages of a step in the chart, and their colours.
STAGES = {
    "total": "#222222", "step": "#1f77b4", "search": "#2ca02c", "collect": "#ff7f0e", "publish": "#9467bd",
}  # fmt: skip
# Number of uPlot's logarithmic scale, on which a stall does not flatten the rest.
LOGARITHMIC = 3


class Panel:
    """The controls of a viser server."""

    def __init__(self, server: Any, remote: Remote, scene: Scene, cameras: Cameras, tab: Any) -> None:
        self._remote, self._scene = remote, scene
        self._actions: SimpleQueue[Callable[[], None]] = SimpleQueue()  # from the page's threads
        self._selected: str | None = None
        self._spawned = 0
        gui = server.gui
        with tab:
            self._status = gui.add_markdown("looking for the node ...")
            self._pause = gui.add_button("Pause", color="blue")
            look = gui.add_button("Look at the bodies", color="gray")
            with gui.add_folder("Patches"):
                gui.add_html(_legend(PatchLook))
                self._contacts = gui.add_checkbox("contacts", True, hint="Arrows: the larger the force, the longer.")
                shadows = gui.add_checkbox("shadows", False, hint="Slow without a graphics card.")
            with gui.add_folder("Ground", expand_by_default=False):
                gui.add_html(_legend(Grip))
                gui.add_html(_legend(Give))
                self._sunk = gui.add_checkbox("sunk ground", False, hint="It lies below its first map, such as ruts.")
                gui.add_html(_legend(Depth))
            with gui.add_folder("Step and reset", expand_by_default=False):
                self._steps = gui.add_number("steps", 1, min=1, max=100_000, step=1)
                step = gui.add_button("Step")
                reset = gui.add_button("Reset", color="gray")
            with gui.add_folder("A click"):
                self._click = gui.add_dropdown("a click", (SELECT, *SPAWNS), initial_value=SELECT)
                self._size = gui.add_slider("size [m]", 0.1, 3.0, 0.05, 0.5)
                self._about = gui.add_markdown("Click on a body to see its name and its patch.")
            with gui.add_folder("Median time of a stage [ms]"):
                self._chart = Chart(gui)
            with gui.add_folder("Warnings and refusals"):
                self._warnings = gui.add_markdown("none")
        self._on(self._pause.on_click, lambda: self._call("pause", data=self._pause.label == "Pause"))
        self._on(step.on_click, lambda: self._call("step", steps=int(self._steps.value)))
        self._on(reset.on_click, lambda: self._call("reset"))
        self._on(look.on_click, lambda: cameras.look(remote.ground, remote.sight))
        self._on(shadows.on_update, lambda: scene.light(shadows=shadows.value))
        server.scene.on_click()(lambda event: self._actions.put(lambda: self._clicked(event)))

    def update(self) -> None:
        """Run the user's actions, and show the node's state."""
        while not self._actions.empty():
            self._actions.get()()
        self._scene.show_contacts, self._scene.show_sunk = self._contacts.value, self._sunk.value
        remote = self._remote
        self._status.content = self._status_words()
        self._pause.label = "Continue" if remote.paused else "Pause"
        lines = dict.fromkeys([*remote.warnings, *self._scene.faults, *remote.log])  # each once
        self._warnings.content = "\n".join(f"- {line}" for line in lines) or "none"
        self._show_selected()
        self._chart.update(remote.timings)

    def _status_words(self) -> str:
        remote, sight = self._remote, self._remote.sight
        if not remote.runs:
            return f"**no node** `{remote.name}` in this DDS domain"
        head = "**paused**" if remote.paused else "**running**"
        if not remote.timings:
            return head
        factor = remote.timings[-1][1].real_time_factor
        missed = sum(message.deadline_misses for came, message in remote.timings if came > monotonic() - WINDOW)
        ground = "" if remote.ground.shown else "\n\nno map has come yet; the next one is shown"
        return (
            f"{head} `{remote.name}`\n\nreal-time factor **{factor:.2f}**, deadlines missed in the last {WINDOW:g} s: "
            f"**{missed}**\n\nbodies: {len(sight.appearances)}, patches: {len(sight.patches)}{ground}"
        )

    def _on(self, listen: Callable[[Any], Any], act: Callable[[], None]) -> None:
        """Let the loop, not the page's thread, do the act."""
        listen(lambda _: self._actions.put(act))

    def _call(self, service: str, **fields: Any) -> None:
        """Call a service without a wait for the answer."""
        remote, client = self._remote, self._remote.clients[service]

        def done(future: Any) -> None:
            if not future.result().success:  # the node's log has the same words
                remote.log.append(f"{service} refused: {future.result().message}")
            elif service == "pause":
                remote.paused = fields["data"]

        if client.service_is_ready():
            client.call_async(client.srv_type.Request(**fields)).add_done_callback(done)
        else:
            remote.log.append(f"{service} refused: there is no service {client.srv_name}: is the node running?")

    def _clicked(self, event: Any) -> None:
        origin, direction = np.array(event.ray_origin), np.array(event.ray_direction)
        direction /= np.linalg.norm(direction)
        if self._click.value == SELECT:
            self._selected = self._remote.sight.hit(origin, direction)
        elif np.isfinite(distance := self._remote.ground.distances(origin[None], direction[None])[0]):
            self._spawn(*(origin + distance * direction).tolist())
        else:
            self._selected, self._about.content = None, "There is no ground where you clicked."

    def _spawn(self, x: float, y: float, z: float) -> None:
        (kind, proportions, volume), size = SPAWNS[self._click.value], float(self._size.value)
        shape = SolidPrimitive(type=kind, dimensions=[size * proportion for proportion in proportions])
        self._spawned += 1
        while (name := f"{self._click.value.rpartition(' ')[2]}_{self._spawned}") in self._remote.sight.appearances:
            self._spawned += 1
        pose = pose_message((x, y, z + ABOVE * size))
        self._call("spawn_body", id=name, shape=shape, mass=DENSITY * volume * size**3, pose=pose)

    def _show_selected(self) -> None:
        """Mark the selected body, and tell its position and the size of its patches."""
        name, sight = self._selected, self._remote.sight
        if name is None or name not in sight.poses:
            self._scene.mark(None)
            return
        x, y, z = sight.poses[name].position
        self._scene.mark((x, y, z), sight.radius_of(name))
        lines = []
        for patch in sight.patches.values():
            if patch.name == name or patch.name.startswith(f"{name}/"):
                part = patch.name.removeprefix(name).strip("/") or "patch"
                lines.append(f"{part}: {len(patch.triangles)} triangles of ground in reach")
        lines = lines or ["no ground in reach"]
        self._about.content = "\n\n".join([f"**{name}** at {x:.2f}, {y:.2f}, {z:.2f} m", *lines])


def _legend(entries: type[Legend]) -> str:
    rows = "".join(
        f'<div style="margin:1px 12px"><span style="display:inline-block;width:12px;height:12px;margin-right:8px;'
        f'background:rgb{entry.colour}"></span>{entry.words}</div>'
        for entry in entries
    )
    return f'<div style="font-size:12px;line-height:1.3">{rows}</div>'


class Chart:
    """The medians of `STAGES` over the last minute."""

    def __init__(self, gui: Any) -> None:
        self._due = 0.0
        self._plot = gui.add_uplot(
            data=chart_data([], 0.0),
            series=({"label": "s"}, *({"label": name, "stroke": line, "width": 2} for name, line in STAGES.items())),
            scales={"x": {"time": False, "range": [-MINUTE, 0.0]}, "y": {"distr": LOGARITHMIC}},
            aspect=1.3,
            legend=uplot.Legend(live=False),  # live values would be those under the mouse only
        )

    def update(self, timings: Sequence[tuple[float, Any]]) -> None:
        """Show messages of ~/timing with their times [s], if it is time for that."""
        if (now := monotonic()) >= self._due:
            self._due = now + PERIOD
            self._plot.data = chart_data(timings, now)


def chart_data(timings: Sequence[tuple[float, Any]], now: float) -> tuple[FloatArray, ...]:
    """Return times relative to ``now`` [s] with the median of each of `STAGES` [ms], NaN where it did not run, from
    messages of ~/timing with their times [s]."""
    recent = [(came, message) for came, message in timings if came > now - MINUTE]
    medians = np.full((len(STAGES), len(recent)), np.nan)
    for column, (_, message) in enumerate(recent):
        known = {stage.stage: 1e-3 * stage.p50_us for stage in message.stages}
        medians[:, column] = [known.get(stage) or np.nan for stage in STAGES]
    return (np.array([came - now for came, _ in recent]), *medians)
