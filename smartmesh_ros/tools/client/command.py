"""``smartmesh``: a running terrain_collider by commands, and its start, also where there is no ``ros2``.

smartmesh run terrain_collider                       # as ros2 run smartmesh_ros terrain_collider
smartmesh spawn ball --sphere 0.3 --at 1 2           # on the ground; --z 3.0 instead starts it there
smartmesh spawn robot --urdf my_robot.urdf
smartmesh list                                       # bodies, and where they are
smartmesh echo body_states --once                    # messages of a topic of the node
smartmesh param physics.rate 480
smartmesh status                                     # what the diagnostics say
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from time import monotonic
from typing import Any
from xml.etree import ElementTree

import yaml
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.parameter import parameter_value_to_python
from rclpy.qos import QoSProfile
from shape_msgs.msg import SolidPrimitive
from smartmesh_msgs.msg import TrackedBody

from smartmesh_ros.errors import InputError, suggestion
from smartmesh_ros.node.inputs.optional_messages import class_of
from smartmesh_ros.node.parameters.helping import own_arguments
from smartmesh_ros.node.transport import colliders
from smartmesh_ros.startup.arguments import Parser, number
from smartmesh_ros.startup.executables import INTERRUPTED, STARTED_BY_NAME
from smartmesh_ros.tools.client.remote import Remote, following
from smartmesh_ros.tools.client.sight import KINDS
from smartmesh_ros.tools.messages import BEST, parameter_from, pose_message
from smartmesh_ros.world.robots.description import named_file, urdf_text, xml_of

SHAPES = {
    "sphere": (SolidPrimitive.SPHERE, ("RADIUS",)), "box": (SolidPrimitive.BOX, ("X", "Y", "Z")),
    "cylinder": (SolidPrimitive.CYLINDER, ("HEIGHT", "RADIUS")),
    "capsule": (TrackedBody.SHAPE_CAPSULE, ("HEIGHT", "RADIUS")),
}  # fmt: skip
# Most entries of a sequence that are printed.
MOST_PRINTED = 12
LEVELS = {DiagnosticStatus.OK: "ok", DiagnosticStatus.WARN: "warning", DiagnosticStatus.ERROR: "error"}
# After this long without another one, all nodes count as discovered [s]. One that is too busy to answer at once
# answers later: this process announces itself for 3 s (config/fastdds.xml).
DISCOVERY = 3.5


def messages(remote: Remote, topic: str, kind: Any, *, raw: bool = False) -> list[Any]:
    """Subscribe to a topic, wait for a message, and return the list of all, which grows."""
    node, came = remote.node, list[Any]()
    remote.wait_for(lambda: node.count_publishers(topic), f"publisher of {topic}")
    node.create_subscription(kind, topic, came.append, QoSProfile(depth=10, **BEST), raw=raw)
    remote.wait_for(lambda: came, f"message on {topic}")
    return came


def spawn(remote: Remote, options: argparse.Namespace) -> str:
    """Spawn a body or a robot."""
    if options.z is not None and (options.clearance or options.align):
        raise InputError("arguments", "--clearance and --align put a body onto the ground; leave --z out")
    fields: dict[str, Any] = {"id": options.name, "mass": options.mass, "on_ground": options.z is None}
    fields |= {"clearance": options.clearance, "align": options.align}
    chosen = [name for name in SHAPES if getattr(options, name) is not None]
    if options.urdf is not None:
        fields["urdf"] = text_of(options.urdf)
    elif chosen:
        fields["shape"] = SolidPrimitive(type=SHAPES[chosen[0]][0], dimensions=getattr(options, chosen[0]))
    fields["pose"] = pose_message((*options.at, options.z or 0.0), options.yaw)
    return remote.call("spawn_body", **fields) or f"{options.name} is there"


def text_of(file: Path) -> str:
    """Return the text of a URDF file for a node that cannot see its folder: meshes are named by their full paths where
    they are found. Raises `InputError`."""
    robot = xml_of(urdf_text(str(file)))
    for mesh in robot.iter("mesh"):
        if not (name := mesh.get("filename", "")).startswith("package://"):
            with suppress(InputError):  # the node opens meshes of collision shapes alone, and says which are missing
                mesh.set("filename", str(named_file(name, file.absolute().parent)))
    return ElementTree.tostring(robot, encoding="unicode")


def show_bodies(remote: Remote, _: argparse.Namespace) -> str:
    """Return the bodies of the node, a line each."""
    sight, lines = remote.sight, []
    topics = ("body_descriptions", "body_states")
    came = {topic: messages(remote, f"{remote.name}/{topic}", KINDS[topic], raw=True) for topic in topics}

    def complete() -> bool:
        """Whether the bodies of the newest messages are the same: a latched description may be an old one."""
        for topic, received in came.items():
            sight.take(topic, received[-1])
        return sight.poses.keys() == {name for name, body in sight.appearances.items() if not body.tracked}

    remote.wait_for(complete, "description of all bodies")
    kinds = {number: name for name, (number, _) in SHAPES.items()}
    for name, body in sight.appearances.items():
        kind = kinds.get(body.shape, "robot")
        size = " x ".join(f"{value:g}" for value in body.dimensions)
        if body.tracked:  # ~/body_states has simulated bodies alone
            how = "tracked, where the topic with its poses says"
        else:
            place = ", ".join(f"{value:.3f}" for value in sight.poses[name].position)
            how = f"{'asleep' if name in sight.asleep else 'simulated'}, at ({place})"
        lines.append(f"{name}: {' '.join(filter(None, (kind, size)))}, {how}")
    return "\n".join(lines) or "no bodies"


def echo(remote: Remote, options: argparse.Namespace) -> str:
    """Print messages of a topic of the node as YAML."""
    full = options.topic if options.topic.startswith("/") else f"{remote.name}/{options.topic}"

    def known() -> dict[str, list[str]]:
        return dict(remote.node.get_topic_names_and_types())

    try:
        types = remote.wait_for(lambda: known().get(full), f"topic {full}")
    except InputError as error:
        names = [name.removeprefix(f"{remote.name}/") for name in known()]
        raise InputError("timeout", f"{error}{suggestion(options.topic, names)}") from None
    came = messages(remote, full, class_of(types[0]))
    while True:
        for message in came[:1] if options.once else came:
            print(yaml.safe_dump(plain(message), sort_keys=False, default_flow_style=None, width=120), end="---\n")
        if options.once:
            return ""
        came.clear()
        remote.spin(0.1)


def plain(value: Any) -> Any:
    """Return a message as dictionaries, lists and numbers, its long sequences shortened."""
    if hasattr(value, "get_fields_and_field_types"):
        return {name: plain(getattr(value, name)) for name in value.get_fields_and_field_types()}
    if isinstance(value, str | bool | int | float):
        return value
    if isinstance(value, bytes):
        return list(value)
    items = [plain(item.item() if hasattr(item, "item") else item) for item in value[:MOST_PRINTED]]
    return items if len(value) <= MOST_PRINTED else [*items, f"... {len(value) - MOST_PRINTED} more"]


def param(remote: Remote, options: argparse.Namespace) -> str:
    """Get a parameter, all of them, or set one."""
    client = remote.parameters
    remote.wait_for(client.services_are_ready, "services for parameters")

    def answer(future: Any) -> Any:
        return remote.wait_for(lambda: future.done() and future.result(), "answer")

    def known() -> list[str]:
        return sorted(answer(client.list_parameters([], 0)).result.names)

    if options.value is not None:
        wanted = parameter_from(options.name, options.value)
        [result] = answer(client.set_parameters([wanted])).results
        if not result.successful:
            raise InputError("refused", result.reason)
        return ""
    names = known() if options.name is None else [options.name]
    values = answer(client.get_parameters(names)).values
    if len(values) != len(names):
        hint = suggestion(options.name, known())
        raise InputError("parameter", f"{remote.name} has no parameter {options.name!r}{hint}")
    plain_values = [parameter_value_to_python(value) for value in values]
    if options.name is not None:
        return str(plain_values[0])
    return "\n".join(f"{name}: {value}" for name, value in zip(names, plain_values, strict=True))


def status(remote: Remote, _: argparse.Namespace) -> str:
    """Return what the node's diagnostics say."""
    tasks = remote.wait_for(lambda: remote.tasks, "diagnostics")
    lines = []
    for name, task in tasks.items():
        lines.append(f"{name}: {LEVELS.get(task.level, '?')}, {task.message}")
        lines += [f"    {pair.key}: {pair.value}" for pair in task.values]
    return "\n".join(lines)


def show_nodes(remote: Remote, _: argparse.Namespace) -> str:
    """Return the names of the running nodes, once no more are discovered: they are, one after the other."""
    found = remote.wait_for(lambda: colliders(remote.node), "node")
    changed = monotonic()
    while monotonic() < changed + DISCOVERY:
        remote.spin(0.02)
        if (now := colliders(remote.node)) != found:
            found, changed = now, monotonic()
    return "\n".join(found)


def run(_: Remote, options: argparse.Namespace) -> str:
    """Refuse options before the word run; without any, `executables.smartmesh` starts the executable."""
    raise InputError("arguments", f"put no option before run: smartmesh run {options.executable} ...")


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    made = Parser("smartmesh", description=__doc__)
    made.add_argument("--node", default="/terrain_collider", help="full name of the node (%(default)s)")
    patience = number(float, 0.0, math.inf)
    made.add_argument("--timeout", type=patience, default=10.0, help="longest wait for it [s] (%(default)s)")
    commands = made.add_subparsers(required=True, metavar="COMMAND")

    def command(name: str, words: str, act: Callable[[Remote, argparse.Namespace], str]) -> Any:
        found = commands.add_parser(name, help=words, description=words)
        found.set_defaults(act=act)
        return found

    starts = command("run", f"start one of {', '.join(STARTED_BY_NAME)}; more arguments are its own", run)
    starts.add_argument("executable", choices=STARTED_BY_NAME, metavar="EXECUTABLE")
    command("nodes", "the running nodes", show_nodes)
    command("list", "the bodies: kinds, sizes, places", show_bodies)
    spawns = command("spawn", "add a body or a robot, on the ground unless --z is given", spawn)
    spawns.add_argument("name")
    shape = spawns.add_mutually_exclusive_group(required=True)
    for name, (_, dimensions) in SHAPES.items():
        shape.add_argument(f"--{name}", nargs=len(dimensions), type=float, metavar=dimensions, help="[m]")
    shape.add_argument("--urdf", type=Path, help="file of a robot")
    spawns.add_argument("--mass", type=float, default=1.0, help="[kg] (%(default)s)")
    spawns.add_argument("--at", nargs=2, type=float, default=(0.0, 0.0), metavar=("X", "Y"), help="[m] (0 0)")
    spawns.add_argument("--z", type=float, help="height of the centre of mass [m]; default: on the ground")
    spawns.add_argument("--clearance", type=float, default=0.0, help="of the lowest point above the ground [m]")
    spawns.add_argument("--align", action="store_true", help="tilt it with the ground")
    spawns.add_argument("--yaw", type=number(float, -1000.0, 1000.0), default=0.0, help="turn about z [rad]")
    removes = command("remove", "remove bodies", lambda remote, o: remote.call("remove_bodies", ids=o.names))
    removes.add_argument("names", nargs="+", metavar="NAME")
    echoes = command("echo", "print a topic of the node, such as body_states", echo)
    echoes.add_argument("topic")
    echoes.add_argument("--once", action="store_true", help="one message")
    params = command("param", "show all parameters, or one, or set one", param)
    params.add_argument("name", nargs="?")
    params.add_argument("value", nargs="?", help="as in YAML")
    command("status", "what the diagnostics say", status)
    command("pause", "pause the physics", lambda remote, _: remote.call("pause", data=True))
    command("resume", "let it run", lambda remote, _: remote.call("pause", data=False))
    command("reset", "put bodies back to where they were spawned", lambda remote, _: remote.call("reset"))
    steps = command("step", "run steps of a paused physics", lambda remote, o: remote.call("step", steps=o.count))
    steps.add_argument("count", nargs="?", type=number(int, 1, 100_000), default=1)
    return made


def main(args: list[str] | None = None) -> None:
    """Do what a command line asks for."""
    given = sys.argv if args is None else ["smartmesh", *args]
    options = parser().parse_args(own_arguments(given))
    with following(options.node, "smartmesh", given, options.timeout, interrupted=INTERRUPTED) as (remote, _):
        if words := options.act(remote, options):
            print(words)
