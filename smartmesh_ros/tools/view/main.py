"""``ros2 run smartmesh_ros view``: shows a running terrain_collider in the browser.

The view uses only the node's topics and services, so the node may run on another machine of the same DDS domain.
"""

from __future__ import annotations

import argparse
import math
import sys
from contextlib import closing, nullcontext
from time import monotonic

from smartmesh_ros.node.parameters.helping import own_arguments
from smartmesh_ros.node.running import Stop
from smartmesh_ros.startup.arguments import Parser, number
from smartmesh_ros.startup.dds import isolated_unless_chosen
from smartmesh_ros.tools.client.remote import Remote, following
from smartmesh_ros.tools.demo.demo import demo_running

# Time after which the view says that its node is not there [s].
PATIENCE = 3.0


def main(args: list[str] | None = None) -> None:
    """Run the view until SIGINT or SIGTERM."""
    given = sys.argv if args is None else ["view", *args]
    parser = Parser("view", description=__doc__)
    parser.add_argument("--node", default="/terrain_collider", help="full name of the node (%(default)s)")
    parser.add_argument("--host", default="localhost", help="address to listen on; 0.0.0.0 = all (%(default)s)")
    port, rate = number(int, 0, 65535), number(float, 1.0, 100.0)
    parser.add_argument("--port", type=port, default=8080, help="port, or the next free one (%(default)s)")
    parser.add_argument("--rate", type=rate, default=12.0, help="updates of the page a second, 1 to 100 (%(default)s)")
    parser.add_argument("--demo", action="store_true", help="start the demo's nodes and show them")
    options = parser.parse_args(own_arguments(given))
    domain = isolated_unless_chosen() if options.demo else nullcontext()
    with domain, following(options.node, "view", given) as (remote, stop):
        try:
            show(remote, options, stop)
        except ModuleNotFoundError as error:
            sys.exit(f"the view needs {error.name}, which is not installed: pip install 'viser[urdf]'")


def show(remote: Remote, options: argparse.Namespace, stop: Stop) -> None:
    """Show a node until ``stop`` is asked for."""
    from smartmesh_ros.tools.view.page import Page

    with demo_running(remote) if options.demo else nullcontext() as demo:
        stop.starting = False  # the page is ended in order
        with closing(Page(remote, options.host, options.port)) as page:
            print(f"{remote.name} is shown at {page.url}", flush=True)
            patience = monotonic() + PATIENCE
            while not stop.asked:
                if monotonic() > patience:
                    patience = math.inf
                    if remote.missing:
                        print(f"{remote.missing}; waiting for it (--node names another)", file=sys.stderr, flush=True)
                start = monotonic()
                page.refresh()
                took = monotonic() - start
                remote.spin(max(1.0 / options.rate - took, took))  # at least half of the time
                if demo is not None and not stop.asked:
                    demo.require_nodes()
                    demo.drive()
