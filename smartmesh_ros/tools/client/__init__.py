"""Clients of a running ``terrain_collider``: patches for other simulators (docs/other_simulators.md), and, in `remote`,
what the view and the demo show."""

from smartmesh_ros.tools.client.mujoco_field import write_field
from smartmesh_ros.tools.client.patch import Patch
from smartmesh_ros.tools.client.patch_client import PatchClient, TrackedLink

__all__ = ["Patch", "PatchClient", "TrackedLink", "write_field"]
