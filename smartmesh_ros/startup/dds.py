"""DDS of this process: settings of Fast DDS for large maps and for sending without blocking, and free domains.

Nodes discover each other only within a domain. A demo or test in a free domain is isolated from the machine's other
nodes.
"""

from __future__ import annotations

import os
import re
import socket
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from ament_index_python.packages import get_package_share_directory

# Makes rmw_fastrtps apply the profile's memory policy: buffers have the size of their message and are freed after use.
POLICY_VARIABLE = "RMW_FASTRTPS_USE_QOS_FROM_XML"
VARIABLE = "FASTRTPS_DEFAULT_PROFILES_FILE"
TRANSPORTS_VARIABLE = "FASTDDS_BUILTIN_TRANSPORTS"


def use_large_message_profile() -> None:
    """Set the package's ``config/fastdds.xml`` for this process and its children, unless another profile is set.

    Takes effect only before the first node is created, because Fast DDS reads its settings once.
    """
    if VARIABLE in os.environ:
        return
    os.environ[POLICY_VARIABLE] = "1"
    os.environ[VARIABLE] = str(Path(get_package_share_directory("smartmesh_ros")) / "config" / "fastdds.xml")


def send_without_waiting() -> None:
    """Make this process drop datagrams that the network does not accept at once; DDS resends reliable messages later.

    Otherwise a send to a disconnected machine blocks the physics for seconds, until the kernel gives up. No effect if
    the variable is set already or a profile has its own transports. Takes effect only before the first node is created.
    """
    os.environ.setdefault(TRANSPORTS_VARIABLE, "DEFAULT?non_blocking=true")


DOMAIN, DISCOVERY = "ROS_DOMAIN_ID", "ROS_AUTOMATIC_DISCOVERY_RANGE"
# Highest domain: the ports of higher ones do not exist.
HIGHEST_DOMAIN = 232
# Domains to choose from: not 0, the default domain, and none whose ports are in Linux's ephemeral range.
CANDIDATES = range(1, 100)
# First UDP port of domain 0 and number of UDP ports of each domain (RTPS standard). Participants bind some of them.
FIRST_PORT, PORTS = 7400, 250
# First TCP port of the locks, one per domain. A process binds it while it uses the domain, so that processes that
# choose at the same time choose different domains.
LOCK_PORT = 24700


def domain_of(text: str) -> int:
    """Return the number of a domain as rcl reads it, which takes 010 for 8. Raises `ValueError` if it is no number."""
    return int(text, 8 if re.fullmatch("0[0-7]+", text) else 0)


def require_domain() -> None:
    """Exit if ``ROS_DOMAIN_ID`` is no domain, with the reason, which neither rcl nor Fast DDS gives."""
    given = os.environ.get(DOMAIN, "")
    with suppress(ValueError):
        if not given or 0 <= domain_of(given) <= HIGHEST_DOMAIN:
            return
    print(f"cannot start: {DOMAIN} is {given!r}; it must be a number from 0 to {HIGHEST_DOMAIN}", file=sys.stderr)
    sys.exit(2)


@contextmanager
def isolated() -> Iterator[int]:
    """Use a free DDS domain, limited to this machine, in this process and its children; yield its number.

    Restores the environment at the end. Raises `RuntimeError` if no domain is free.
    """
    lock, number = _lock_free_domain()
    saved = {name: os.environ.get(name) for name in (DOMAIN, DISCOVERY)}
    os.environ.update({DOMAIN: str(number), DISCOVERY: "LOCALHOST"})
    try:
        yield number
    finally:
        for name, value in saved.items():
            os.environ.pop(name, None)
            if value is not None:
                os.environ[name] = value
        lock.close()


@contextmanager
def isolated_unless_chosen() -> Iterator[int]:
    """Use the domain of ``ROS_DOMAIN_ID`` if it is set, or else a free one as `isolated` does; print and yield it."""
    if os.environ.get(DOMAIN):
        os.environ.setdefault(DISCOVERY, "LOCALHOST")
        print(f"DDS domain {os.environ[DOMAIN]}, from {DOMAIN}", flush=True)
        yield domain_of(os.environ[DOMAIN])
        return
    with isolated() as number:
        print(f"DDS domain {number}, a free one; to watch, set {DOMAIN}={number} and {DISCOVERY}=LOCALHOST", flush=True)
        yield number


def in_use(number: int) -> bool:
    """Return True if a process on this machine holds a UDP port of the domain, as a DDS participant does."""
    first = FIRST_PORT + PORTS * number
    for port in range(first, first + PORTS):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            try:
                probe.bind(("", port))
            except OSError:
                return True
    return False


def _lock_free_domain() -> tuple[socket.socket, int]:
    for number in CANDIDATES:
        lock = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        with suppress(OSError):
            lock.bind(("127.0.0.1", LOCK_PORT + number))
            if not in_use(number):
                return lock, number
        lock.close()
    raise RuntimeError(f"every DDS domain from {CANDIDATES.start} to {CANDIDATES.stop - 1} is in use on this machine")
