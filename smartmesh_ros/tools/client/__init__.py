"""Client for other simulators: patches of a running ``terrain_collider`` over topics. See docs/other_simulators.md."""

from smartmesh_ros.tools.client.mujoco_field import write_field
from smartmesh_ros.tools.client.patch import Patch
from smartmesh_ros.tools.client.patch_client import PatchClient, TrackedLink

__all__ = ["Patch", "PatchClient", "TrackedLink", "write_field"]
