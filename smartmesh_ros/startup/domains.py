"""DDS domains that nobody else on this machine uses.

Nodes in one domain hear each other; a demo or a test in a domain of its own neither disturbs other nodes of the machine
nor is disturbed by them.
"""

from __future__ import annotations

import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager

DOMAIN, DISCOVERY = "ROS_DOMAIN_ID", "ROS_AUTOMATIC_DISCOVERY_RANGE"
# Not 0, which is everybody's, and none whose ports Linux gives to other connections.
CHOICE = range(1, 100)
# The RTPS standard gives each domain these UDP ports, of which a participant on this machine holds some.
FIRST_PORT, PORTS = 7400, 250
# A port that is held as long as a domain is in use here keeps it from others that choose at the same time.
LOCKS = 24700


@contextmanager
def isolated() -> Iterator[int]:
    """A free DDS domain for this process and those it starts, limited to this machine; as before at the end.

    Raises `RuntimeError` if there is none.
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
    """As `isolated`, but the domain of ``ROS_DOMAIN_ID`` where the user has set it. Prints which it is."""
    if os.environ.get(DOMAIN):
        os.environ.setdefault(DISCOVERY, "LOCALHOST")
        print(f"DDS domain {os.environ[DOMAIN]}, from {DOMAIN}", flush=True)
        yield int(os.environ[DOMAIN])
        return
    with isolated() as number:
        print(f"DDS domain {number}, a free one; to watch, set {DOMAIN}={number} and {DISCOVERY}=LOCALHOST", flush=True)
        yield number


def in_use(number: int) -> bool:
    """Whether a DDS participant on this machine is in the domain: it holds a UDP port of it."""
    first = FIRST_PORT + PORTS * number
    return not all(_is_free(port) for port in range(first, first + PORTS))


def _is_free(port: int) -> bool:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind(("", port))
        except OSError:
            return False
    return True


def _lock_free_domain() -> tuple[socket.socket, int]:
    for number in CHOICE:
        lock = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        try:
            lock.bind(("127.0.0.1", LOCKS + number))
        except OSError:
            lock.close()
            continue
        if not in_use(number):
            return lock, number
        lock.close()
    raise RuntimeError(f"every DDS domain from {CHOICE.start} to {CHOICE.stop - 1} is in use on this machine")
