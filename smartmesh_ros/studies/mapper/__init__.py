"""A mapper to test with: maps as robots make them - noise, holes, drift, corrections - and the truth beside them."""

from smartmesh_ros.studies.mapper.drift import NO_DRIFT, DriftConfig
from smartmesh_ros.studies.mapper.elevation_mapper import MapperConfig
from smartmesh_ros.studies.mapper.mapping import Drive, MapFrame, MappingConfig, mapped_terrain
from smartmesh_ros.studies.mapper.poses import LoopPath, Pose
from smartmesh_ros.studies.mapper.sensors import DepthCamera, Lidar, RangeNoise, RangeSensor
from smartmesh_ros.studies.mapper.truth import TruthConfig, true_ground

__all__ = [
    "NO_DRIFT",
    "DepthCamera",
    "DriftConfig",
    "Drive",
    "Lidar",
    "LoopPath",
    "MapFrame",
    "MapperConfig",
    "MappingConfig",
    "Pose",
    "RangeNoise",
    "RangeSensor",
    "TruthConfig",
    "mapped_terrain",
    "true_ground",
]
