"""YAML that users write."""

from __future__ import annotations

from typing import Any

from smartmesh_ros.errors import InputError


def parsed_yaml(text: str, *, aliases: bool = True) -> Any:
    """Return what a YAML text says. Raises `InputError` if it is no YAML, or has ``aliases`` that are not allowed."""
    try:
        import yaml  # every ROS has it; the core alone needs it for soils by name only
    except ImportError:
        raise InputError("yaml", "this needs PyYAML: pip install pyyaml") from None
    # The C parser takes a tenth of the time, which matters for a thousand bodies.
    loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
    try:
        if not aliases and any(isinstance(event, yaml.AliasEvent) for event in yaml.parse(text, loader)):
            raise InputError("yaml", "it has aliases (*name), which ROS does not read either")
        return yaml.load(text, loader)
    except InputError:
        raise
    except Exception as error:  # noqa: BLE001  # those of its tags and of too many brackets have no common base
        raise InputError("yaml", f"this is no YAML: {str(error)[:300]}") from None
