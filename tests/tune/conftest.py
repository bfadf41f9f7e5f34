"""Fixtures of the tests over DDS."""

from smartmesh_ros.testing import domain, probe

__all__ = ["domain", "probe"]
