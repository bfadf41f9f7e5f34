"""The tab with the node's state and controls."""

from __future__ import annotations

from collections.abc import Callable
from queue import SimpleQueue
from time import monotonic
from typing import Any

import numpy as np
from geometry_msgs.msg import Point, Pose, Quaternion
from shape_msgs.msg import SolidPrimitive
from smartmesh_msgs.srv import SpawnBody, StepPhysics
from std_srvs.srv import SetBool, Trigger
from viser import uplot

from smartmesh_ros.tools.view import picking
from smartmesh_ros.tools.view.cameras import Cameras
from smartmesh_ros.tools.view.looks import PatchLook
from smartmesh_ros.tools.view.remote import Remote
from smartmesh_ros.tools.view.scene import Scene, radius_of
from smartmesh_ros.tools.view.sunk import Band, Depth, Grip

# Time span of the plot and period of its refreshes [s].
MINUTE, PLOT_PERIOD = 60.0, 1.0
# Stages of a step in the plot, and their colours.
STAGES = {
    "total": "#222222", "step": "#1f77b4", "search": "#2ca02c", "collider": "#ff7f0e", "publish": "#9467bd",
    "bodies": "#8c564b",
}  # fmt: skip
SELECT = "shows what it is"
SPAWNS = {
    "spawns a ball": (SolidPrimitive.SPHERE, [0.5]),
    "spawns a box": (SolidPrimitive.BOX, [1.2, 0.8, 0.6]),
    "spawns a cylinder": (SolidPrimitive.CYLINDER, [0.8, 0.5]),
}
# Height of a spawned body above the ground, in sizes, and its density [kg/m^3], that of wood.
ABOVE, DENSITY = 1.5, 600.0


class Panel:
    """The controls of a viser server."""

    def __init__(self, server: Any, remote: Remote, scene: Scene, cameras: Cameras, tab: Any) -> None:
        self._server, self._remote, self._scene, self._cameras = server, remote, scene, cameras
        self._actions: SimpleQueue[Callable[[], None]] = SimpleQueue()  # from the page's threads
        self._plot_due = 0.0
        self._selected: str | None = None
        self._spawned = 0
        self._shown: dict[int, str] = {}
        gui = server.gui
        with tab:
            self._status = gui.add_markdown("looking for the node ...")
            self._pause = gui.add_button("Pause", color="blue")
            self._look = gui.add_button("Look at the bodies", color="gray")
            with gui.add_folder("Patches"):
                gui.add_html(_legend(PatchLook))
                self._contacts = gui.add_checkbox("contacts", True, hint="Arrows: the larger the force, the longer.")
                self._shadows = gui.add_checkbox("shadows", False, hint="Slow without a graphics card.")
            with gui.add_folder("Ground", expand_by_default=False):
                gui.add_html(_legend(Grip))
                self._sunk = gui.add_checkbox("sunk ground", False, hint="It lies below its first map, such as ruts.")
                gui.add_html(_legend(Depth))
            with gui.add_folder("Step and reset", expand_by_default=False):
                self._steps = gui.add_number("steps", 1, min=1, max=100_000, step=1)
                self._step = gui.add_button("Step")
                self._reset = gui.add_button("Reset", color="gray")
            with gui.add_folder("A click"):
                self._click = gui.add_dropdown("a click", (SELECT, *SPAWNS), initial_value=SELECT)
                self._size = gui.add_slider("size [m]", 0.1, 3.0, 0.05, 0.5)
                self._about = gui.add_markdown("Click on a body to see its name and its patch.")
            with gui.add_folder("Median time of a stage [ms]"):
                self._plot = self._make_plot()
            with gui.add_folder("Warnings and refusals"):
                self._warnings = gui.add_markdown("none")
        self._connect()

    def update(self) -> None:
        """Run the user's actions, and show the node's state."""
        while not self._actions.empty():
            self._actions.get()()
        remote = self._remote
        self._write(self._status, self._status_words())
        self._pause.label = "Continue" if remote.paused else "Pause"
        lines = [*remote.warnings, *remote.log]
        self._write(self._warnings, "\n".join(f"- {line}" for line in lines) or "none")
        self._show_selected()
        if (now := monotonic()) >= self._plot_due:
            self._plot_due = now + PLOT_PERIOD
            self._plot.data = plot_data(list(remote.timings), now)

    def _write(self, handle: Any, words: str) -> None:
        if self._shown.get(id(handle)) != words:
            self._shown[id(handle)] = words
            handle.content = words

    def _status_words(self) -> str:
        remote, sight = self._remote, self._remote.sight
        if not remote.is_running:
            return f"**no node** `{remote.name}` in this DDS domain"
        head = "**paused**" if remote.paused else "**running**"
        if not remote.timings:
            return head
        timing = remote.timings[-1][1]
        missed = sum(message.deadline_misses for came, message in remote.timings if came > monotonic() - MINUTE)
        bodies, patches = len(sight.appearances), len(sight.patches)
        ground = "" if remote.ground.tiles else "\n\nno map has come yet; the next one is shown"
        return (
            f"{head} `{remote.name}`\n\nreal-time factor **{timing.real_time_factor:.2f}**, "
            f"deadlines missed in the last minute **{missed}**\n\n{bodies} bodies, {patches} patches{ground}"
        )

    def _make_plot(self) -> Any:
        series = ({"label": "s"}, *({"label": stage, "stroke": colour, "width": 2} for stage, colour in STAGES.items()))
        return self._server.gui.add_uplot(
            data=plot_data([], 0.0),
            series=series,
            scales={"x": {"time": False, "range": [-MINUTE, 0.0]}},
            aspect=1.3,
            legend=uplot.Legend(live=False),  # live values would be those under the mouse only
        )

    def _connect(self) -> None:
        remote = self._remote
        self._on(self._pause, lambda: self._call("pause", SetBool, data=not remote.paused))
        self._on(self._step, lambda: self._call("step", StepPhysics, steps=int(self._steps.value)))
        self._on(self._reset, lambda: self._call("reset", Trigger))
        self._on(self._look, lambda: self._cameras.look(remote.ground, remote.sight))
        self._shadows.on_update(lambda _: self._actions.put(lambda: self._scene.light(shadows=self._shadows.value)))
        self._contacts.on_update(lambda _: setattr(self._scene, "show_contacts", self._contacts.value))
        self._sunk.on_update(lambda _: setattr(self._scene, "show_sunk", self._sunk.value))

        self._server.scene.on_click()(self._on_click)

    def _on(self, button: Any, act: Callable[[], None]) -> None:
        button.on_click(lambda _: self._actions.put(act))

    def _call(self, service: str, kind: Any, **fields: Any) -> None:
        def done(refused: str) -> None:
            if refused:
                self._remote.log.append(f"{service}: {refused}")
            elif service == "pause":
                self._remote.paused = fields["data"]

        self._remote.call(service, kind, done, **fields)

    def _on_click(self, event: Any) -> None:
        """Let the loop answer a click on the ground."""
        origin, direction = np.array(event.ray_origin), np.array(event.ray_direction)
        self._actions.put(lambda: self._clicked(origin, direction / np.linalg.norm(direction)))

    def _clicked(self, origin: Any, direction: Any) -> None:
        if self._click.value == SELECT:
            self._selected = picking.body_hit(origin, direction, self._remote.sight)
            return
        place = picking.ground_hit(origin, direction, self._remote.ground)
        if place is None:
            self._write(self._about, "There is no ground where you clicked.")
            return
        self._spawn(place)

    def _spawn(self, place: Any) -> None:
        kind, proportions = SPAWNS[self._click.value]
        size = float(self._size.value)
        dimensions = [size * proportion for proportion in proportions]
        self._spawned += 1
        names = self._remote.sight.appearances
        while (name := f"{self._click.value.rpartition(' ')[2]}_{self._spawned}") in names:
            self._spawned += 1
        position = Point(x=float(place[0]), y=float(place[1]), z=float(place[2]) + ABOVE * size)
        self._call(
            "spawn_body", SpawnBody, id=name, shape=SolidPrimitive(type=kind, dimensions=dimensions),
            mass=DENSITY * float(np.prod(dimensions)) if kind == SolidPrimitive.BOX else DENSITY * 0.5 * size**3,
            pose=Pose(position=position, orientation=Quaternion(w=1.0)),
        )  # fmt: skip

    def _show_selected(self) -> None:
        name, sight = self._selected, self._remote.sight
        pose = sight.poses.get(name) if name else None
        if name is None or pose is None:
            self._scene.mark(None)
            return
        self._scene.mark(pose.position, radius_of(sight, name))
        self._write(self._about, selected_words(name, sight))


def selected_words(name: str, sight: Any) -> str:
    """Return the page's text on a body: name, position, and kind, stride and deviation of its patches."""
    x, y, z = sight.poses[name].position
    lines = [f"**{name}** at {x:.2f}, {y:.2f}, {z:.2f} m"]
    for patch in sight.patches:
        if patch.name == name or patch.name.startswith(f"{name}/"):
            known = "unknown" if np.isnan(patch.deviation) else f"{1000 * patch.deviation:.3f} mm"
            part = patch.name.removeprefix(name).strip("/")
            lines.append(f"{part or 'patch'}: {patch.kind}, stride {patch.stride}, deviation {known}")
    if len(lines) == 1:
        lines.append("no patch: no ground within reach")
    return "\n\n".join(lines)


def plot_data(timings: list[tuple[float, Any]], now: float) -> tuple[Any, ...]:
    """Return times relative to ``now`` [s] and the median of each of `STAGES` [ms], from messages of ~/timing with
    their times [s]."""
    recent = [(came, message) for came, message in timings if came > now - MINUTE]
    times = np.array([came - now for came, _ in recent])
    medians = [{stage.stage: 1e-3 * stage.p50_us for stage in message.stages} for _, message in recent]
    return (times, *(np.array([of_stages.get(stage, np.nan) for of_stages in medians]) for stage in STAGES))


def _legend(looks: type[PatchLook] | type[Band]) -> str:
    rows = "".join(
        f'<div style="margin:1px 12px"><span style="display:inline-block;width:12px;height:12px;margin-right:8px;'
        f'background:rgb{look.colour}"></span>{look.words}</div>'
        for look in looks
    )
    return f'<div style="font-size:12px;line-height:1.3">{rows}</div>'
