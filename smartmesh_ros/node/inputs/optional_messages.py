"""Access to message packages that may not be installed."""

from __future__ import annotations

import importlib
from types import ModuleType
from typing import Any

from smartmesh_ros.errors import InputError


def find_interfaces(package: str, kind: str) -> ModuleType | None:
    """Return the module of a package's interfaces of a kind (msg, srv or action); None if the package is not
    installed."""
    try:
        return importlib.import_module(f"{package}.{kind}")
    except ModuleNotFoundError:
        return None


def find_class(name: str) -> Any | None:
    """Return the class of an interface, such as ``sensor_msgs/msg/Imu``; None if it is not installed."""
    package, kind, short = name.split("/")
    return getattr(find_interfaces(package, kind), short, None)


def class_of(name: str, user: str = "") -> Any:
    """Return the class of an interface, as `find_class` does. Raises `InputError`, which names the package to install
    and the ``user``, what the interface is for, if it is not installed."""
    found = find_class(name)
    if found is None:
        words = f"{user} needs {name}, which" if user else name
        debian = "ros-jazzy-" + name.partition("/")[0].replace("_", "-")
        raise InputError("missing", f"{words} is not installed; source its workspace, or apt install {debian}")
    return found
