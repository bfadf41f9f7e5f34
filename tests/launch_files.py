"""Launch files taken apart. Real ROS launch is not at hand everywhere: stand-ins record what the files ask for."""

import runpy
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

LAUNCH = Path(__file__).parent.parent / "launch"


class Recorded:
    """Anything a launch file makes, with what it was made of."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        self.args, self.kwargs = args, kwargs

    def perform(self, context: dict[str, str]) -> str:
        """As of a LaunchConfiguration: the value of the argument of its name."""
        return context.get(self.args[0], self.kwargs["default"]) if "default" in self.kwargs else context[self.args[0]]


class Launch:
    """A launch file, as far as it can be taken apart without ROS launch."""

    def __init__(self, path: Path, kinds: dict[str, type[Recorded]]) -> None:
        [self._items] = runpy.run_path(str(path))["generate_launch_description"]().args
        self._kinds = kinds
        declared = [item for item in self._items if type(item) is kinds["DeclareLaunchArgument"]]
        assert all(item.kwargs["description"].endswith(".") for item in declared)
        self.declared = {item.args[0]: item for item in declared}
        self.defaults = {name: item.kwargs["default_value"] for name, item in self.declared.items()}

    def of(self, kind: str, **arguments: str) -> list[Recorded]:
        """What it makes of a kind with these arguments and the defaults of the others. ``ros_namespace``: as an outer
        launch file pushes one."""
        assert set(arguments) <= {*self.defaults, "ros_namespace"}
        items = [item for item in self._items if type(item) is not self._kinds["OpaqueFunction"]]
        for item in self._items[len(items) :]:
            items += item.kwargs["function"]({**self.defaults, **arguments})
        return [item for item in items if type(item) is self._kinds[kind]]


@pytest.fixture
def stand_ins(monkeypatch: pytest.MonkeyPatch) -> Iterator[dict[str, type[Recorded]]]:
    """Modules of ROS launch in which every name makes a `Recorded`; the kinds by name."""
    kinds: dict[str, type[Recorded]] = {}
    for module, names in {
        "launch": ("LaunchDescription",),
        "launch.actions": ("DeclareLaunchArgument", "OpaqueFunction", "SetEnvironmentVariable"),
        "launch.substitutions": ("LaunchConfiguration",),
        "launch_ros": (),
        "launch_ros.actions": ("Node",),
    }.items():
        made = ModuleType(module)
        for name in names:
            kinds[name] = type(name, (Recorded,), {})
            setattr(made, name, kinds[name])
        monkeypatch.setitem(sys.modules, module, made)
    monkeypatch.delitem(sys.modules, "smartmesh_ros.startup.launching", raising=False)
    monkeypatch.delenv("FASTRTPS_DEFAULT_PROFILES_FILE", raising=False)
    yield kinds
    sys.modules.pop("smartmesh_ros.startup.launching", None)  # it is made of stand-ins
