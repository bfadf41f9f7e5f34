"""Access to message packages that may not be installed."""

from __future__ import annotations

import importlib
from types import ModuleType
from typing import Any, Literal

from smartmesh_ros.errors import InputError


def find_message(package: str, name: str) -> Any | None:
    """Return the class of a message; None if its package is not installed."""
    module = find_interfaces(package, "msg")
    return None if module is None else getattr(module, name)


def find_interfaces(package: str, kind: Literal["msg", "srv", "action"]) -> ModuleType | None:
    """Return the module of a package's messages, services or actions; None if the package is not installed."""
    try:
        return importlib.import_module(f"{package}.{kind}")
    except ModuleNotFoundError:
        return None


def require_message(package: str, name: str, what: str) -> Any:
    """Return the class of a message that ``what`` needs; else raises `InputError` naming the package to install."""
    found = find_message(package, name)
    if found is None:
        debian = "ros-jazzy-" + package.replace("_", "-")
        raise InputError("missing", f"{what} needs {package}/{name}, which is not installed; apt install {debian}")
    return found
