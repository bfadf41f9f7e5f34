"""Fixtures of the tests over DDS."""

from smartmesh_ros.tools.testing import domain, probe

__all__ = ["domain", "probe"]
