"""The parameter file that a search writes, with the measured figures as comments."""

from __future__ import annotations

import json
import textwrap
from collections.abc import Mapping
from typing import Any

import yaml

from smartmesh_ros.tools.evaluation.machine import describe
from smartmesh_ros.tools.tune.case import Case, MapTopic
from smartmesh_ros.tools.tune.confirm import Verdict
from smartmesh_ros.tools.tune.figures import Asked, Figures
from smartmesh_ros.tools.tune.space import defaults
from smartmesh_ros.tools.tune.start import DEFAULTS, NODE

WIDTH = 118
COLUMNS = f"{'':18} {'cost':>9} {'longest':>10} {'penetration':>12} {'hover':>9} {'deviation':>10} {'lost':>6}"


def parameter_file(case: Case, asked: Asked, verdict: Verdict) -> str:
    """Return the text of the file: comments, then all given parameters with the chosen values of the searched ones."""
    machine = describe()
    about = [f"Found by `ros2 run smartmesh_ros tune` for {case.title}. Asked: {asked.words}."]
    about += [_map_words(topic) for topic in case.map_topics]
    if not verdict.keeps:
        about.append("NOT POSSIBLE: these are the nearest settings that were found.")
    if verdict.on_front:
        about.append("No settings better than the defaults were found here.")
    about.append(
        f"Measured over {verdict.chosen.figures.ran:.3g} s of simulated time, in turns, on {machine['cores']} cores of "
        f"{machine['cpu']}. Cost: processor time per simulated second, which is the share of a core. Longest: processor"
        " time of the longest step. Penetration and hover: 99 %. Deviation: of bodies from a run at an eighth of the "
        "step, median."
    )
    lines = [line for text in about for line in textwrap.wrap(text, WIDTH, initial_indent="# ", subsequent_indent="# ")]
    lines += ["#", *(f"# {line}" for line in table(verdict).split("\n")), "/**:", "  ros__parameters:"]
    values = {**case.start, **verdict.chosen.values}
    if case.start.get("physics.friction") == DEFAULTS["physics.friction"]:
        values.pop("physics.friction")
    return "\n".join([*lines, *_entries(values)]) + "\n"


def _map_words(topic: MapTopic) -> str:
    """Return a sentence with a topic of maps and the node's input topic for them."""
    own = f"~/{topic.taken_on}"
    remap = "" if topic.name == own.replace("~", NODE) else f": start it with -r {own}:={topic.name}"
    return f"Maps: {topic.name} ({topic.type_name}), which the node takes on {own}{remap}."


def table(verdict: Verdict) -> str:
    """Return the figures of the chosen point, the defaults, the presets and the user's settings."""
    rows = [
        COLUMNS,
        row("this file", verdict.chosen.figures),
        row("  in the search", verdict.short),
        row("defaults", verdict.defaults),
    ]
    return "\n".join(rows + [row(name, figures) for name, figures in verdict.others.items()])


def row(name: str, figures: Figures) -> str:
    """Return figures as a line of the table."""

    def millimetres(value: float) -> str:
        return "-" if value != value else f"{1e3 * value:.3g} mm"

    if figures.note:
        return f"{name:18} {figures.note}"
    return (
        f"{name:18} {figures.cost:9.3g} {1e3 * figures.longest:7.3g} ms {millimetres(figures.penetration):>12} "
        f"{millimetres(figures.hover):>9} {millimetres(figures.deviation):>10} {figures.lost:>6}"
    )


def _entries(values: Mapping[str, Any]) -> list[str]:
    """Return the lines of the parameters, the searched ones first."""
    known = defaults()
    lines = []
    for name in [*known, *(name for name in values if name not in known)]:
        value = values[name]
        if isinstance(value, list) and not value:
            continue  # rcl cannot read an empty list
        text = _text(value)
        note = f"  # default {_text(known[name])}" if name in known and known[name] != value else ""
        lines.append(f"    {name}: {text}{note}")
    return lines


def _text(value: Any) -> str:
    """Return a value as YAML on one line."""
    if isinstance(value, float):
        text = repr(value)
        return text.replace("e", ".0e") if "e" in text and "." not in text else text
    if isinstance(value, str):
        return json.dumps(value)
    return str(yaml.safe_dump(value, default_flow_style=True, width=10**6)).removesuffix("\n...\n").strip()
