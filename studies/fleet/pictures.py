"""Pictures of the fleet study."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

# Errors are shown up to this [% or cm].
HIGHEST = 12.0


def draw_errors(path: Path, errors: list[dict[str, Any]], machine: str) -> None:
    """Errors of encounters against delay and against loss."""
    figure = Figure(figsize=(11.0, 4.6), dpi=90, layout="constrained")
    FigureCanvasAgg(figure)
    for axes, key, scale, label in zip(
        figure.subplots(1, 2), ("delay_ms", "loss"), (1.0, 100.0), ("delay [ms]", "messages lost [%]"), strict=True
    ):
        for name in dict.fromkeys(error["encounter"] for error in errors):
            chosen = [error for error in errors if error["encounter"] == name]
            step = min((e["delay_ms"] for e in chosen if e["loss"]), default=0.0)
            some = (
                [e for e in chosen if not e["loss"]]
                if key == "delay_ms"
                else [e for e in chosen if e["loss"] or abs(e["delay_ms"] - step) < 0.1]
            )
            some.sort(key=lambda error: error[key])
            unit = "m" if some and some[0]["pushing"] else "of the speed"
            x, y = [scale * error[key] for error in some], [100.0 * error["worst"] for error in some]
            axes.plot(x, y, marker="o", label=f"{name} [{'cm' if unit == 'm' else '%'}]")
        axes.axhline(5.0, color="black", linestyle="--", linewidth=1)
        axes.set_xlabel(label)
        axes.set_ylabel("worst error of velocity [%] or place [cm]")
        axes.set_ylim(0.0, HIGHEST)
        axes.grid(alpha=0.3)
    figure.axes[1].legend(fontsize=8)
    figure.suptitle(f"Bodies of several worlds against those of one, 240 Hz ({machine})", fontsize=10)
    figure.savefig(path)


def draw_capacity(path: Path, capacities: list[dict[str, Any]], machine: str) -> None:
    """Real-time factors against the number of bodies."""
    figure = Figure(figsize=(7.0, 4.2), dpi=90, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    for capacity in capacities:
        runs = capacity["runs"]
        which = f"{capacity['nodes']} node{'s' if capacity['nodes'] > 1 else ''}"
        label = f"{which}{'' if capacity['meet'] else ' by themselves'}: {capacity['carried']:.0f} bodies"
        style = "o-" if capacity["meet"] else "o:"
        axes.plot([r["bodies"] for r in runs], [r["real_time"] for r in runs], style, label=label)
    axes.axhline(0.98, color="black", linestyle="--", linewidth=1)
    axes.set_xlabel("bodies of the fleet")
    axes.set_ylabel("real-time factor of the slowest node")
    axes.grid(alpha=0.3)
    axes.legend()
    axes.set_title(machine, fontsize=9)
    figure.savefig(path)
