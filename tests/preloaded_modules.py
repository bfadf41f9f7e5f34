"""What the process imports whose forks are nodes; see `tests.preloaded`."""

from importlib import import_module

from smartmesh_ros.startup.executables import silence_pybullet

silence_pybullet()
for name in ("fleet.front", "sensor.terrain_sensor", "terrain_collider"):
    import_module(f"smartmesh_ros.node.{name}")
for name in ("demo.terrain_source", "score.terrain_score"):
    import_module(f"smartmesh_ros.tools.{name}")
# Tests wait for diagnostics, which a node publishes once a second [Hz].
import_module("smartmesh_ros.node.outputs.diagnostics").DIAGNOSTICS_RATE = 5.0
