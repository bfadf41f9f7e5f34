"""The name of `smartmesh_ros.testing.bags` before."""

import warnings

from smartmesh_ros.testing.bags import *  # noqa: F403

warnings.warn("smartmesh_ros.bags is smartmesh_ros.testing.bags", DeprecationWarning, stacklevel=2)
