"""Message packages that are used only where they are installed."""

from __future__ import annotations

import importlib
from types import ModuleType
from typing import Any, Literal

from smartmesh_ros.errors import InputError


def find_message(package: str, name: str) -> Any | None:
    """The class of a message; None where its package is not installed."""
    module = find_interfaces(package, "msg")
    return None if module is None else getattr(module, name)


def find_interfaces(package: str, kind: Literal["msg", "srv"]) -> ModuleType | None:
    """The messages or services of a package; None where it is not installed."""
    try:
        return importlib.import_module(f"{package}.{kind}")
    except ModuleNotFoundError:
        return None


def require_message(package: str, name: str, what: str) -> Any:
    """The class of a message that ``what`` needs; raises `InputError` naming the package to install."""
    found = find_message(package, name)
    if found is None:
        debian = "ros-jazzy-" + package.replace("_", "-")
        raise InputError("missing", f"{what} needs {package}/{name}, which is not installed; apt install {debian}")
    return found
